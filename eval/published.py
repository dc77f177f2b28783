"""Published numbers on YCB-V, to stand beside a run's, and whether they are of the same pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from eval.datasets import Dataset
from eval.datasets.ycb_objects import YCB_VIDEO_CLASSES

YCBV_SCENES = tuple(range(48, 60))
# The archive ycbv_base.zip of BOP has it; pictures that somebody rendered at the same poses come without.
YCBV_CAMERA_FILE = "camera_uw.json"
FEW_SHOT = "no CAD model; BOP's test targets; area up to 10 cm, its integration and averaging are not stated"
POSECNN = "CAD models; all 2949 keyframes; ADD and ADD-S of every object, area up to 10 cm (VOCap), twelve sequences"


@dataclass(frozen=True, slots=True)
class Published:
    """add_auc, adds_auc: percent. convention: what the number depends on, as far as it is stated. source: who says so.
    on_keyframes: measured on all keyframes of YCB-Video; else on BOP's targets, a part of them."""

    method: str
    add_auc: float
    adds_auc: float
    convention: str
    source: str
    on_keyframes: bool = False


CONCEPTPOSE_TABLE = "ConceptPose's table of few-shot tracking (Kuang et al., CVPR 2026)"
PUBLISHED = (
    Published(
        "ConceptPose",
        90.1,
        95.4,
        f"training-free, 2 fixed reference frames, which are left out (4068 pairs); {FEW_SHOT}",
        CONCEPTPOSE_TABLE,
    ),
    Published(
        "FoundationPose",
        87.4,
        94.3,
        f"trained, fixed reference frames; {FEW_SHOT}",
        f"Wen et al., CVPR 2024, as in {CONCEPTPOSE_TABLE}",
    ),
    Published(
        "UA-Pose",
        92.8,
        96.5,
        f"trained, completes the model while it tracks; {FEW_SHOT}",
        f"UA-Pose, CVPR 2025, as in {CONCEPTPOSE_TABLE}",
    ),
    Published("PoseCNN", 53.7, 75.9, f"trained, colour alone; {POSECNN}", "Xiang et al., RSS 2018", True),
    Published("PoseCNN+ICP", 79.3, 93.0, f"trained, depth; {POSECNN}", "Xiang et al., RSS 2018", True),
)


def why_not_ycbv(dataset: Dataset, protocol: Mapping[str, object]) -> str | None:
    """None where the run was scored on YCB-V's own test pictures, every scene, object and listed frame of them.

    Decided by facts of the dataset, not by its name: its layout, its list of targets, its scenes and objects.
    protocol: what scoring stated, with `scenes` and `objects`.
    """
    kind, _, path = dataset.name.partition(":")
    if kind == "bop":
        if "test_targets_bop19.json" not in dataset.target_rule or "no test_targets" in dataset.target_rule:
            return "its targets are not BOP's list"
        if not any((folder / YCBV_CAMERA_FILE).exists() for folder in (Path(path), Path(path).resolve().parent)):
            return f"no {YCBV_CAMERA_FILE}, which YCB-V has beside its scenes"
        expected = {str(number) for number in range(1, len(YCB_VIDEO_CLASSES) + 1)}
    elif kind == "ycb-video":
        if "no keyframe" in dataset.target_rule:
            return "its frames are not YCB-Video's keyframes"
        expected = set(YCB_VIDEO_CLASSES)
    else:
        return f"{kind} is not YCB-V"
    scenes, objects = protocol.get("scenes"), protocol.get("objects")
    if not isinstance(scenes, list) or sorted(scenes) != list(YCBV_SCENES):
        return "not the scenes 48 to 59 of YCB-V's test"
    if not isinstance(objects, list) or set(objects) != expected:
        return "not all of the 21 objects of YCB-V"
    return None


def data_of(published: Published, dataset: Dataset, why_not: str | None) -> str:
    """Whether a published number is of this run's data, in words. why_not: what `why_not_ycbv` says."""
    if why_not is not None:
        return "not the same data"
    on_keyframes = dataset.name.startswith("ycb-video:")
    return "the same frames" if published.on_keyframes == on_keyframes else "the same recordings, other frames of them"
