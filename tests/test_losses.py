"""Every wrong pose has a cause, and it is the one that was planted."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import eval.__main__
from eval.datasets.synthetic import SyntheticDataset
from eval.losses.cause import CAUSES, WRONG_M, Loss, Tracer
from eval.losses.scene import FARTHEST_M, UNDER, points_lost
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame, Mask
from tracker.geometry import Pose
from tracker.saliency import SaliencyBackend
from tracker.sources.synthetic import SyntheticScene

CAN = "soup_can"


@pytest.fixture
def trace(can_scene: SyntheticScene, can_model: ConceptModel, attributes: SaliencyBackend) -> Tracer:
    return Tracer(can_model, SyntheticDataset(can_scene).model(CAN), attributes, TrackerConfig())


def test_a_right_pose_has_no_cause_and_its_error(trace: Tracer, can_frames: list[Frame], can_truth: Pose) -> None:
    loss = trace(can_frames[0], can_frames[0].masks[CAN], can_truth)
    assert loss.cause is None
    assert loss.error_m < 0.003


def test_an_empty_mask_shows_too_little(trace: Tracer, can_frames: list[Frame], can_truth: Pose) -> None:
    loss = trace(can_frames[0], np.zeros_like(can_frames[0].masks[CAN]), can_truth)
    assert loss == Loss(CAN, float("inf"), "little seen")


def upper_part(mask: Mask, share: float) -> Mask:
    rows = np.nonzero(mask.any(axis=1))[0]
    part = mask.copy()
    part[rows[0] + round(share * len(rows)) :] = False
    return part


def test_what_is_found_with_the_whole_mask_was_lost_to_the_mask(
    trace: Tracer, can_frames: list[Frame], can_truth: Pose
) -> None:
    loss = trace(can_frames[0], upper_part(can_frames[0].masks[CAN], 0.15), can_truth)
    assert loss.cause == "mask"
    assert loss.error_m > WRONG_M


def test_what_the_model_does_not_explain_at_the_true_pose_is_a_side_that_it_does_not_know(
    trace: Tracer, can_frames: list[Frame], can_truth: Pose
) -> None:
    own = can_frames[0].masks[CAN]
    above = np.zeros_like(own)
    above[: np.nonzero(own.any(axis=1))[0][0]] = True
    assert trace(can_frames[0], upper_part(own, 0.25) | above, can_truth).cause == "unseen side"


def test_points_are_the_area_that_is_lacking() -> None:
    losses = [Loss("a", 0.002, None), Loss("a", 0.03, "turn"), Loss("a", np.inf, "mask"), Loss("a", 0.2, "mask")]
    cost = points_lost(losses)
    assert cost["turn"] == pytest.approx(100 * 0.03 / FARTHEST_M / 4)
    assert cost["mask"] == pytest.approx(50)
    assert cost[UNDER] == pytest.approx(0.5)
    assert sum(cost.values()) == pytest.approx(100 * (0.02 + 0.3 + 2) / 4)
    assert set(cost) == {*CAUSES, UNDER}


def test_the_command_has_a_row_an_object_and_writes_its_points(
    program: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    line = ("--dataset", "synthetic:turn?object=tea_box&size=160x120&frames=6", "--json", tmp_path / "losses.json")
    code, said = program(eval.__main__.main, "losses", *line)
    assert code == 0, said
    assert "tea_box" in said
    figures = json.loads((tmp_path / "losses.json").read_text())
    assert figures["instances"] == 5  # of six frames, one of them the reference
    assert figures["objects"]["tea_box"] == figures["pooled"]
    code, said = program(eval.__main__.main, "losses", *line[:2], "--objects", "cup")
    assert code == 1
    assert "no target" in said
