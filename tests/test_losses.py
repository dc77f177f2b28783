"""Every wrong pose has a cause, and it is the one that was planted."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import eval.__main__
from eval.datasets.synthetic import SyntheticDataset
from eval.losses.cause import CAUSES, Loss, Tracer
from eval.losses.scene import FARTHEST_M, UNDER, points_lost
from reference.onboard import onboard
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame, PosedFrame
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


def test_a_mask_of_something_else_is_the_mask_s_fault(trace: Tracer, can_frames: list[Frame], can_truth: Pose) -> None:
    own = can_frames[0].masks[CAN]
    around = np.zeros_like(own)
    rows, columns = np.nonzero(own)
    around[max(rows.min() - 60, 0) : rows.max() + 60, max(columns.min() - 60, 0) : columns.max() + 60] = True
    loss = trace(can_frames[0], around & ~own, can_truth)
    assert loss.cause in {"unseen side", "mask", "little seen"}
    assert loss.error_m > 0.01


def test_a_side_that_the_model_does_not_know_is_the_cause(
    can_scene: SyntheticScene, can_model: ConceptModel, attributes: SaliencyBackend
) -> None:
    sighting = can_scene.sightings(CAN)[0]
    frame = can_scene[0]
    lower = frame.masks[CAN].copy()
    rows = np.nonzero(lower.any(axis=1))[0]
    lower[: rows[0] + (2 * len(rows)) // 3] = False  # the model knows the lower third alone
    model = onboard([PosedFrame(frame, CAN, sighting.T_cam_obj, lower)], attributes)
    model = replace(model, diameter_m=can_model.diameter_m)
    trace = Tracer(model, SyntheticDataset(can_scene).model(CAN), attributes, TrackerConfig())
    upper = frame.masks[CAN] & ~lower
    assert trace(frame, upper, sighting.T_cam_obj).cause in {"unseen side", "little seen"}


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
