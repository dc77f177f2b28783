"""Published numbers are of the same data only where the dataset's facts say so."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast

import pytest

from eval.datasets import Dataset
from eval.datasets.ycb_objects import YCB_VIDEO_CLASSES
from eval.published import PUBLISHED, data_of, why_not_ycbv

SCENES = list(range(48, 60))
NUMBERS = [str(number) for number in range(1, 22)]
BOP_RULE, KEYFRAME_RULE = "test_targets_bop19.json", "keyframe.txt, every object in these frames"


@dataclass(frozen=True)
class Facts:
    """As much of a dataset as is asked."""

    name: str
    target_rule: str


def why(name: str, rule: str, scenes: list[int] | None = None, objects: list[str] | None = None) -> str | None:
    protocol = {"scenes": SCENES if scenes is None else scenes, "objects": NUMBERS if objects is None else objects}
    return why_not_ycbv(cast("Dataset", Facts(name, rule)), protocol)


@pytest.fixture
def ycbv(tmp_path: Path) -> str:
    (tmp_path / "test").mkdir()
    (tmp_path / "camera_uw.json").write_text("{}")
    return f"bop:{tmp_path}"


def test_bop_s_ycbv_is_itself_by_its_root_or_its_split(ycbv: str) -> None:
    assert why(ycbv, BOP_RULE) is None
    assert why(f"{ycbv}/test", BOP_RULE) is None
    assert why(ycbv, BOP_RULE, SCENES[::-1], NUMBERS[::-1]) is None


def test_what_lacks_one_of_its_facts_is_not_ycbv_and_the_fact_is_named(ycbv: str, tmp_path: Path) -> None:
    assert "48 to 59" in str(why(ycbv, BOP_RULE, SCENES[:-1]))
    assert "21 objects" in str(why(ycbv, BOP_RULE, objects=NUMBERS[1:]))
    assert "BOP's list" in str(why(ycbv, "at least 10% visible, every frame (there is no test_targets_bop19.json)"))
    (tmp_path / "camera_uw.json").unlink()
    assert "camera_uw.json" in str(why(ycbv, BOP_RULE))
    assert why("synthetic:tabletop", "every frame") == "synthetic is not YCB-V"


def test_ycb_video_in_its_own_layout_needs_its_keyframes() -> None:
    names: list[str] = list(YCB_VIDEO_CLASSES)
    assert why("ycb-video:x", KEYFRAME_RULE, objects=names) is None
    assert "keyframes" in str(why("ycb-video:x", "every frame (there is no keyframe.txt)", objects=names))


def test_the_same_recordings_are_told_from_the_same_frames() -> None:
    by_name = {published.method: published for published in PUBLISHED}
    bop, keyframes = cast("Dataset", Facts("bop:x", BOP_RULE)), cast("Dataset", Facts("ycb-video:x", KEYFRAME_RULE))
    assert data_of(by_name["ConceptPose"], bop, None) == "the same frames"
    assert data_of(by_name["PoseCNN"], keyframes, None) == "the same frames"
    assert "other frames" in data_of(by_name["PoseCNN"], bop, None)
    assert "other frames" in data_of(by_name["UA-Pose"], keyframes, None)
    assert {data_of(published, bop, "some fact") for published in PUBLISHED} == {"not the same data"}


def test_the_numbers_are_those_published() -> None:
    found = {published.method: (published.add_auc, published.adds_auc) for published in PUBLISHED}
    assert found == {
        "ConceptPose": (90.1, 95.4),
        "FoundationPose": (87.4, 94.3),
        "UA-Pose": (92.8, 96.5),
        "PoseCNN": (53.7, 75.9),
        "PoseCNN+ICP": (79.3, 93.0),
    }
