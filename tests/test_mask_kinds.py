"""Which of a dataset's masks a run is given: what can be seen of an object, or its whole silhouette."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

import eval.__main__
import eval.predict
from eval.datasets import MaskKind, open_dataset
from eval.predict import track_scene
from eval.preset import Options
from eval.protocol import Protocol
from eval.track_run import MASKS, TrackRun
from eval.units import units_of
from tests.tiny_bop import write_bop
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, SourceError
from tracker.frame import Frame
from tracker.result import TrackResult
from tracker.saliency import SaliencyBackend

SCENE = 4


@pytest.fixture(scope="module")
def half_hidden(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A box that turns. The upper half of its silhouette is hidden, if its visible masks are to be believed."""
    root = tmp_path_factory.mktemp("half") / "bop"
    name = write_bop(root, {SCENE: "turn?size=160x120&frames=3&object=tea_box"})
    scene = root / "test" / f"{SCENE:06d}"
    shutil.copytree(scene / "mask_visib", scene / "mask")
    for file in (scene / "mask_visib").iterdir():
        mask = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        assert mask is not None
        mask[: int(np.median(np.nonzero(mask)[0]))] = 0
        cv2.imwrite(str(file), mask)
    return name


@pytest.fixture(scope="module")
def visible_only(half_hidden: str, tmp_path_factory: pytest.TempPathFactory) -> str:
    copy = tmp_path_factory.mktemp("visible") / "bop"
    shutil.copytree(half_hidden.removeprefix("bop:"), copy)
    shutil.rmtree(copy / "test" / f"{SCENE:06d}" / "mask")
    return f"bop:{copy}"


class Watching:
    """A method that answers nothing and keeps what it was given."""

    def __init__(self, models: Sequence[ConceptModel]) -> None:
        self.models = models
        self.mask_px: list[int] = []

    def step(self, frame: Frame) -> list[TrackResult]:
        self.mask_px.append(int(frame.masks["1"].sum()))
        return []


def given(dataset: str, masks: MaskKind, backend: SaliencyBackend, monkeypatch: pytest.MonkeyPatch) -> Watching:
    made: list[Watching] = []

    def opened(_method: str, models: Sequence[ConceptModel], *_: object) -> Watching:
        made.append(Watching(models))
        return made[0]

    monkeypatch.setattr(eval.predict, "open_method", opened)
    track_scene(open_dataset(dataset), SCENE, Protocol(backend, TrackerConfig(), views=1, masks=masks))
    return made[0]


def test_frames_and_models_have_the_masks_that_are_asked_for(
    half_hidden: str, attributes: SaliencyBackend, monkeypatch: pytest.MonkeyPatch
) -> None:
    visible, full = (given(half_hidden, kind, attributes, monkeypatch) for kind in ("visib", "full"))
    assert len(visible.mask_px) == len(full.mask_px) == 3
    for seen_px, whole_px in zip(visible.mask_px, full.mask_px, strict=True):
        assert 0.4 * whole_px < seen_px < 0.6 * whole_px
    assert full.models[0].diameter_m > visible.models[0].diameter_m


def test_what_counts_as_visible_does_not_depend_on_the_masks(half_hidden: str) -> None:
    dataset = open_dataset(half_hidden)
    told = [
        [(s.visible_px, s.visible_fraction) for s in dataset.scene(SCENE, k).sightings("1")] for k in ("visib", "full")
    ]
    assert told[0] == told[1]


def test_the_two_are_not_mixed_up_where_a_dataset_is_asked_for_both(half_hidden: str) -> None:
    dataset = open_dataset(half_hidden)
    before, whole, after = (int(dataset.scene(SCENE, kind)[0].masks["1"].sum()) for kind in ("visib", "full", "visib"))
    assert before == after < whole


@pytest.mark.parametrize("kind", ["visib", "full"])
def test_the_report_says_which_were_used(
    kind: str, half_hidden: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    line = ["eval", "track", "--dataset", half_hidden, "--masks", kind, "--out", str(out)]
    monkeypatch.setattr(sys, "argv", line)
    eval.__main__.main()
    assert json.loads((out / "scores.json").read_text())["protocol"]["masks"] == MASKS[kind]
    assert MASKS[kind] in (out / "report.html").read_text().replace("&#x27;", "'")


def test_a_dataset_without_full_masks_is_refused_before_anything_is_tracked(visible_only: str) -> None:
    refusal = rf"has no full masks \(a folder mask/ .*{SCENE:06d}\); it has visib \(mask_visib/\)"
    with pytest.raises(SourceError, match=refusal):
        units_of(TrackRun(visible_only, masks="full"), (SCENE,))


def test_a_layout_that_knows_no_full_masks_says_what_it_has() -> None:
    dataset = open_dataset("synthetic:turn?size=160x120&frames=3")
    with pytest.raises(SourceError, match=r"synthetic:.* has no full masks; it has visib"):
        dataset.scene(1, "full")
    assert len(dataset.scene(1, "visib")) == 3


def test_a_preset_may_ask_for_them() -> None:
    assert Options(masks="full").model_dump(exclude_none=True) == {"masks": "full"}


def test_carried_masks_are_the_run_s_and_the_config_s_whoever_says_so() -> None:
    carried = TrackerConfig(masks="carried")
    for run in (TrackRun("bop:here", masks="carried"), TrackRun("bop:here", carried)):
        assert (run.masks, run.config.masks, run.given_masks) == ("carried", "carried", "visib")
    with pytest.raises(ConfigError, match="--masks full"):
        TrackRun("bop:here", carried, masks="full")
    with pytest.raises(ConfigError, match="needs prior=true"):
        TrackRun("bop:here", TrackerConfig(prior=False), masks="carried")
