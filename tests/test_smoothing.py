"""Smoothing: nothing where all was foreseen, never worse than the filter, never over a gap, the same from anywhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracker.geometry import Floats, Pose
from tracker.pose_filter import FilterConfig, FilterStep, PoseFilter, Prediction
from tracker.result import TrackResult, TrackState
from tracker.smoothing import Smoothed, smooth, smooth_results

SEEDS = st.integers(0, 10_000)
START = Pose.exp((0.3, -0.2, 0.5, 0.02, -0.05, 0.7))
VELOCITY = np.array([0.4, -0.3, 0.8, 0.1, 0.05, -0.2])  # rad/s about the object's origin, then m/s
FRAME_NS = 33_333_333
SIGMAS = np.array([0.02] * 3 + [0.002] * 3)
KNOWN = np.diag(SIGMAS**-2)


def moving(frame: int) -> Pose:
    return START.nudged(VELOCITY * (frame * FRAME_NS / 1e9))


def waving(frame: int) -> Pose:
    """There and back in two seconds, as by a hand."""
    return START.nudged(np.array([0.3, 0.1, -0.2, 0.05, 0.02, 0.04]) * np.sin(np.pi * frame * FRAME_NS / 1e9))


def still(_: int) -> Pose:
    return START


MOTIONS = (moving, waving, still)


def trembling(poses: Sequence[Pose], seed: int) -> list[Pose]:
    noise = np.random.default_rng(seed).normal(size=(len(poses), 6)) * SIGMAS
    return [pose.nudged(n) for pose, n in zip(poses, noise, strict=True)]


def run(poses: Sequence[Pose], information: Floats = KNOWN) -> list[FilterStep]:
    pose_filter, steps = PoseFilter(FilterConfig()), []
    for k, pose in enumerate(poses):
        found = pose_filter.update(pose, information, k * FRAME_NS)
        assert found.step is not None
        steps.append(found.step)
    return steps


def present(smoothed: Sequence[Smoothed | None]) -> list[Smoothed]:
    assert all(smoothed)
    return [s for s in smoothed if s]


def off(found: Pose, truth: Pose) -> float:
    """Radians and metres together."""
    return found.angle_to_rad(truth) + found.distance_to_m(truth)


def errors(found: Sequence[Pose], truth: Sequence[Pose]) -> Floats:
    """(2,) root mean squares in radians and metres."""
    pairs = list(zip(found, truth, strict=True))
    squares = [(f.angle_to_rad(t) ** 2, f.distance_to_m(t) ** 2) for f, t in pairs]
    return np.sqrt(np.mean(squares, axis=0))


@settings(max_examples=20)
@given(SEEDS)
def test_where_every_prediction_came_true_smoothing_changes_nothing(seed: int) -> None:
    """A constant velocity without noise, whatever the filter thinks of its certainty."""
    rng, transition = np.random.default_rng(seed), np.eye(12) + np.eye(12, k=6) * FRAME_NS / 1e9
    steps: list[FilterStep] = []
    for k in range(20):
        root = rng.normal(size=(12, 12))
        before = None
        if steps:
            expected = transition @ steps[-1].covariance @ transition.T + root @ root.T
            before = Prediction(moving(k), VELOCITY, expected, transition)
        covariance = 0.5 * before.covariance if before else root @ root.T + np.eye(12)
        steps.append(FilterStep(moving(k), VELOCITY, covariance, np.eye(6), 1, before))
    for k, found in enumerate(present(smooth(steps))):
        assert off(found.T_cam_obj, moving(k)) < 1e-9
        assert np.abs(found.velocity - VELOCITY).max() < 1e-9


def test_a_constant_velocity_that_the_filter_has_learnt_is_left_as_it_is() -> None:
    steps = run([moving(k) for k in range(500)])
    for k, found in list(enumerate(present(smooth(steps))))[300:]:
        assert off(found.T_cam_obj, moving(k)) < 1e-9


@settings(max_examples=10)
@given(SEEDS, st.sampled_from(MOTIONS))
def test_a_smoothed_track_is_nearer_to_the_truth_than_the_filtered_one(
    seed: int, motion: Callable[[int], Pose]
) -> None:
    truth = [motion(k) for k in range(120)]
    steps = run(trembling(truth, seed))
    filtered = errors([s.T_cam_obj for s in steps], truth)
    smoothed = errors([s.T_cam_obj for s in present(smooth(steps))], truth)
    assert (smoothed < 0.9 * filtered).all()


@settings(max_examples=10)
@given(SEEDS)
def test_no_covariance_is_larger_than_the_filter_s(seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps = []
    pose_filter = PoseFilter(FilterConfig())
    for k, pose in enumerate(trembling([waving(k) for k in range(60)], seed)):
        root = rng.normal(size=(6, 6)) / SIGMAS[:, None]
        found = pose_filter.update(pose, root @ root.T, k * FRAME_NS + int(rng.integers(FRAME_NS)))
        steps.append(found.step or pose_filter.start(pose, root @ root.T, (k + 1) * FRAME_NS).step)
    smoothed = present(smooth(steps))
    for step, found in zip(steps, smoothed, strict=True):
        assert step is not None
        scale = np.sqrt(np.diag(step.covariance))
        assert np.linalg.eigvalsh((step.covariance - found.covariance) / np.outer(scale, scale)).min() > -1e-6
        assert np.linalg.eigvalsh(found.pose_covariance).min() > 0
    assert np.array_equal(smoothed[-1].covariance, steps[-1].covariance)


@settings(max_examples=10)
@given(SEEDS)
def test_smoothing_is_equivariant_under_a_turn_and_a_shift_of_the_camera(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion, measured = Pose.exp(rng.normal(size=6)), trembling([waving(k) for k in range(40)], seed)
    both, root = np.zeros((6, 6)), rng.normal(size=(6, 6)) / SIGMAS[:, None]
    both[:3, :3] = both[3:, 3:] = motion.rotation
    known = 0.01 * root @ root.T + 0.5 * KNOWN
    plain = present(smooth(run(measured, known)))
    turned = present(smooth(run([motion @ pose for pose in measured], both @ known @ both.T)))
    for a, b in zip(plain, turned, strict=True):
        assert off(motion @ a.T_cam_obj, b.T_cam_obj) < 1e-6
        assert np.allclose(both @ a.pose_covariance @ both.T, b.pose_covariance, rtol=1e-4, atol=1e-10)


def test_a_stretch_is_smoothed_by_itself_and_not_over_a_frame_without_a_pose() -> None:
    steps: list[FilterStep | None] = [*run(trembling([waving(k) for k in range(40)], 3))]
    whole = smooth(steps)
    broken = smooth([*steps[:20], None, *steps[21:]])
    parts = [*smooth(steps[:20]), None, *smooth(steps[21:])]
    for a, b in zip(broken, parts, strict=True):
        assert (a is None) == (b is None)
        assert a is None or b is None or np.array_equal(a.T_cam_obj.matrix, b.T_cam_obj.matrix)
    last, over = broken[19], whole[19]
    assert last is not None
    assert over is not None
    assert np.array_equal(last.T_cam_obj.matrix, steps[19].T_cam_obj.matrix)  # pyright: ignore[reportOptionalMemberAccess]
    assert off(over.T_cam_obj, last.T_cam_obj) > 1e-4


def test_a_stretch_ends_where_the_filter_was_started_anew() -> None:
    pose_filter, steps = PoseFilter(FilterConfig()), []
    for k, pose in enumerate(trembling([START] * 30, 4)):
        if k == 15:  # said to be elsewhere between two frames
            pose_filter.start(START.nudged(np.full(6, 0.004)), KNOWN, k * FRAME_NS - 1)
        steps.append(pose_filter.update(pose, KNOWN, k * FRAME_NS).step)
    assert steps[15] is not None
    assert steps[15].before is not None
    for k in (14, 29):
        kept, found = steps[k], smooth(steps)[k]
        assert kept is not None
        assert found is not None
        assert np.array_equal(found.T_cam_obj.matrix, kept.T_cam_obj.matrix)


def result_of(object_id: str, frame: int, step: FilterStep | None) -> TrackResult:
    pose, state = (step.T_cam_obj, TrackState.TRACKING) if step else (None, TrackState.LOST)
    covariance = step.covariance[:6, :6] + step.lasting if step else None
    return TrackResult(
        frame * FRAME_NS, object_id, pose, state, 0.8, covariance, "a reason", pose, None, {"total": 1.0}, step=step
    )


@pytest.mark.parametrize("lost", [set(), {10}, {0, 20, 21, 39}])
def test_results_keep_all_but_pose_and_covariance_and_objects_do_not_mix(lost: set[int]) -> None:
    of_a, of_b = (run(trembling([waving(k) for k in range(40)], seed)) for seed in (5, 6))
    gaps = [None if k in lost else step for k, step in enumerate(of_a)]
    alone = smooth_results([result_of("a", k, step) for k, step in enumerate(gaps)])
    pairs = zip(gaps, of_b, strict=True)
    given_ = [r for k, (a, b) in enumerate(pairs) for r in (result_of("a", k, a), result_of("b", k, b))]
    found = smooth_results(given_)
    for before, after in zip(given_, found, strict=True):
        assert (before.stamp_ns, before.object_id, before.state) == (after.stamp_ns, after.object_id, after.state)
        assert (before.confidence, before.reason, before.raw_pose) == (after.confidence, after.reason, after.raw_pose)
        assert (before.pose is None) == (after.pose is None) == (after.covariance is None)
    for one, other in zip(alone, found[::2], strict=True):
        assert one.pose is None or other.pose is None or np.array_equal(one.pose.matrix, other.pose.matrix)
    moved = [a.pose and b.pose and off(a.pose, b.pose) for a, b in zip(given_, found, strict=True)]
    assert max(m for m in moved if m is not None) > 1e-4
