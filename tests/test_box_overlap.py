"""3D IoU of posed boxes: by hand, by counting points, and by law."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.box_overlap import NOCS_STEPS, box_iou
from eval.symmetries import ASYMMETRIC, ObjectSymmetries
from tracker.geometry import Floats, Pose

NONE = ASYMMETRIC.motions()
CUBE_M = np.array(list(product((-0.05, 0.05), repeat=3)))
BRICK_M = CUBE_M * [2.0, 1.0, 0.5] + [0.01, 0, 0.03]  # not centred

twists = st.lists(st.floats(-2, 2), min_size=6, max_size=6)
off = st.tuples(*[st.floats(-0.5, 0.5)] * 3, *[st.floats(-0.06, 0.06)] * 3)


def moved(x_m: float = 0.0, turn_deg: float = 0.0) -> Pose:
    return Pose(Pose.exp([0, 0, np.radians(turn_deg), 0, 0, 0]).rotation, np.array([x_m, 0, 0]))


def iou(points_m: Floats, estimate: Pose, truth: Pose) -> float:
    return float(box_iou(points_m, NONE, [estimate], [truth])[0])


@pytest.mark.parametrize(
    ("estimate", "expected"),
    [
        (moved(), 1),
        (moved(0.05), 1 / 3),  # half of each is shared
        (moved(0.1), 0),  # they touch
        (moved(5), 0),
        (moved(turn_deg=45), np.sqrt(0.5)),  # they share an octagon of 2 (sqrt(2) - 1) of the square
        (moved(turn_deg=90), 1),
    ],
)
def test_cubes_by_hand(estimate: Pose, expected: float) -> None:
    assert iou(CUBE_M, estimate, moved()) == pytest.approx(expected, abs=1e-9)


def test_many_instances_at_once_are_each_by_itself() -> None:
    estimates = [moved(0.05), moved(7), moved()]
    assert box_iou(CUBE_M, NONE, estimates, [moved()] * 3).tolist() == pytest.approx([1 / 3, 0, 1])
    assert len(box_iou(CUBE_M, NONE, [], [])) == 0


def test_a_model_without_a_volume_has_no_overlap() -> None:
    assert iou(np.zeros((1, 3)), moved(), moved()) == 0
    assert iou(CUBE_M * [1, 1, 0], moved(), moved()) == 0


@settings(max_examples=10)
@given(truth=twists, motion=off)
def test_it_is_the_share_of_points_in_both(truth: list[float], motion: tuple[float, ...]) -> None:
    true = Pose.exp(truth)
    estimate = true.nudged(np.array(motion))
    low, high = BRICK_M.min(axis=0), BRICK_M.max(axis=0)
    inside = np.random.default_rng(1).uniform(low, high, (40_000, 3))
    seen = estimate.inverse() @ (true @ inside)
    shared = float(((seen >= low) & (seen <= high)).all(axis=1).mean())
    assert iou(BRICK_M, estimate, true) == pytest.approx(shared / (2 - shared), abs=0.015)


@settings(max_examples=40)
@given(truth=twists, motion=off)
def test_it_is_a_share_that_does_not_depend_on_the_order(truth: list[float], motion: tuple[float, ...]) -> None:
    true = Pose.exp(truth)
    estimate = true.nudged(np.array(motion))
    one, other = iou(BRICK_M, estimate, true), iou(BRICK_M, true, estimate)
    assert 0 <= one <= 1
    assert one == pytest.approx(other, abs=1e-8)
    assert iou(BRICK_M, true, true) == pytest.approx(1, abs=1e-8)


@settings(max_examples=20)
@given(truth=twists, motion=off, step=st.integers(0, 2 * NOCS_STEPS - 1))
def test_poses_that_look_alike_overlap_alike(truth: list[float], motion: tuple[float, ...], step: int) -> None:
    symmetries = ObjectSymmetries.listed([np.diag([1, -1, -1, 1])], [[0, 0, 1]], [[0, 0, 0]])
    motions = symmetries.motions(NOCS_STEPS)
    true = Pose.exp(truth)
    turned = true @ Pose(motions.turns[step], motions.shifts_m[step])
    estimate = true.nudged(np.array(motion))
    best = box_iou(BRICK_M, motions, [estimate] * 2, [true, turned])
    assert best[0] == pytest.approx(best[1], abs=1e-8)
    assert best[0] >= iou(BRICK_M, estimate, turned) - 1e-9
    assert box_iou(BRICK_M, motions, [turned], [true])[0] == pytest.approx(1, abs=1e-8)
