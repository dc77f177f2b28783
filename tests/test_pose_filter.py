"""The pose over time: no lag, less tremble, honest covariances, real seconds."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracker.geometry import Floats, Pose
from tracker.pose_filter import FilterConfig, Filtered, PoseFilter

SEEDS = st.integers(0, 10_000)
START = Pose.exp((0.3, -0.2, 0.5, 0.02, -0.05, 0.7))
FRAME_NS = 33_333_333
VELOCITY = np.array([0.4, -0.3, 0.8, 0.1, 0.05, -0.2])  # rad/s about the object's origin, then m/s


def information(sigma_rad: float, sigma_m: float) -> Floats:
    return np.diag([sigma_rad**-2] * 3 + [sigma_m**-2] * 3)


SHARP = information(0.005, 0.001)


def moving(time_s: float) -> Pose:
    """At `START` at time 0, with a constant velocity."""
    return START.nudged(VELOCITY * time_s)


def off(found: Pose, truth: Pose) -> float:
    """Radians and metres together."""
    return found.angle_to_rad(truth) + found.distance_to_m(truth)


def run(poses: list[Pose], stamps_ns: list[int], given_: Floats = SHARP) -> tuple[PoseFilter, list[Filtered]]:
    pose_filter = PoseFilter(FilterConfig())
    return pose_filter, [pose_filter.update(p, given_, t) for p, t in zip(poses, stamps_ns, strict=True)]


def trembling(seed: int, count: int, sigma_rad: float, sigma_m: float) -> list[Pose]:
    noise = np.random.default_rng(seed).normal(size=(count, 6)) * ([sigma_rad] * 3 + [sigma_m] * 3)
    return [START.nudged(n) for n in noise]


def test_an_empty_filter_expects_nothing_and_starts_at_its_first_measurement() -> None:
    pose_filter = PoseFilter(FilterConfig())
    assert pose_filter.predict(0) is None
    first = pose_filter.update(START, SHARP, 5 * FRAME_NS)
    assert first.T_cam_obj is START
    assert first.within_gate
    expected = pose_filter.predict(6 * FRAME_NS)
    assert expected is not None
    assert off(expected, START) < 1e-12
    pose_filter.clear()
    assert pose_filter.predict(6 * FRAME_NS) is None


@settings(max_examples=20)
@given(st.lists(st.integers(5, 90), min_size=40, max_size=40))
def test_a_constant_velocity_is_followed_without_lag_at_any_frame_rate(steps_ms: list[int]) -> None:
    stamps_ns = np.cumsum(steps_ms).astype(int) * 1_000_000
    pose_filter, found = run([moving(t / 1e9) for t in stamps_ns], stamps_ns.tolist())
    for index in range(20, 40):
        assert off(found[index].T_cam_obj, moving(stamps_ns[index] / 1e9)) < 1e-4
    later_ns = int(stamps_ns[-1]) + 100_000_000
    expected = pose_filter.predict(later_ns)
    assert expected is not None
    assert off(expected, moving(later_ns / 1e9)) < 2e-3


@pytest.mark.parametrize(("sigma_rad", "sigma_m"), [(0.02, 0.003), (0.06, 0.01)])
def test_a_still_object_gets_smoother_than_its_measurements(sigma_rad: float, sigma_m: float) -> None:
    measured = trembling(1, 400, sigma_rad, sigma_m)
    _, found = run(measured, [k * FRAME_NS for k in range(400)], information(sigma_rad, sigma_m))
    filtered = [f.T_cam_obj for f in found]
    for of_angles in (True, False):
        steps, before = (
            [a.angle_to_rad(b) if of_angles else a.distance_to_m(b) for a, b in pairwise(poses[50:])]
            for poses in (filtered, measured)
        )
        assert np.sqrt(np.mean(np.square(steps))) < 0.8 * np.sqrt(np.mean(np.square(before)))
    errors = np.array([[p.angle_to_rad(START), p.distance_to_m(START)] for p in filtered[50:]])
    errors_before = np.array([[p.angle_to_rad(START), p.distance_to_m(START)] for p in measured[50:]])
    assert (np.sqrt((errors**2).mean(axis=0)) < 0.95 * np.sqrt((errors_before**2).mean(axis=0))).all()


@settings(max_examples=20)
@given(SEEDS)
def test_covariances_stay_symmetric_and_positive_definite(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose_filter, stamp_ns = PoseFilter(FilterConfig()), 0
    for _ in range(60):
        stamp_ns += int(rng.integers(1, 700)) * 1_000_000
        root = rng.normal(size=(6, 6)) * 10.0 ** rng.uniform(-3, 4)
        found = pose_filter.update(moving(stamp_ns / 1e9), root @ root.T, stamp_ns)
        assert np.allclose(found.covariance, found.covariance.T, rtol=1e-6)
        assert np.linalg.eigvalsh(found.covariance).min() > 0


def test_a_measurement_makes_the_pose_surer_and_time_makes_it_less_sure() -> None:
    pose_filter, found = run([START] * 10, [k * FRAME_NS for k in range(10)])
    first, last = found[0].covariance, found[-1].covariance
    late = pose_filter.update(START, np.zeros((6, 6)), 9 * FRAME_NS + 400_000_000).covariance
    assert np.linalg.eigvalsh(first - last).min() > 0
    assert np.linalg.eigvalsh(late - first).min() > 0


@settings(max_examples=20)
@given(SEEDS)
def test_an_outlier_is_refused_and_leaves_no_trace(seed: int) -> None:
    measured = trembling(seed, 30, 0.005, 0.001)
    stamps_ns = [k * FRAME_NS for k in range(30)]
    one, _ = run(measured[:20], stamps_ns[:20])
    other, _ = run(measured[:20], stamps_ns[:20])
    kick = np.random.default_rng([seed, 1]).normal(size=6)
    outlier = START.nudged(kick / np.linalg.norm(kick) * ([1.5] * 3 + [0.3] * 3))
    expected = other.predict(stamps_ns[20])
    refused = other.update(outlier, SHARP, stamps_ns[20])
    assert expected is not None
    assert not refused.within_gate
    assert refused.squared_distance > 50
    assert off(refused.T_cam_obj, expected) < 1e-12
    for pose, stamp_ns in zip(measured[21:], stamps_ns[21:], strict=True):
        a, b = (f.update(pose, SHARP, stamp_ns) for f in (one, other))
        assert np.array_equal(a.T_cam_obj.matrix, b.T_cam_obj.matrix)
        assert np.array_equal(a.covariance, b.covariance)


def test_true_measurements_lie_within_the_gate_and_at_the_distance_that_chance_gives_them() -> None:
    """The squared distance of six numbers is six on the average where the filter knows its uncertainty; of a still
    object it is less, as the filter allows for accelerations that do not come."""
    _, found = run(trembling(2, 500, 0.02, 0.003), [k * FRAME_NS for k in range(500)], information(0.02, 0.003))
    assert all(f.within_gate for f in found)
    assert 2 < np.mean([f.squared_distance for f in found[20:]]) < 7


@given(st.integers(1, 200), st.integers(1, 200))
def test_two_steps_of_time_predict_what_their_sum_does(first_ms: int, second_ms: int) -> None:
    stamps_ns = [k * FRAME_NS for k in range(30)]
    pose_filter, _ = run([moving(t / 1e9) for t in stamps_ns], stamps_ns)
    start, middle, end = (
        pose_filter.predict(stamps_ns[-1] + ms * 1_000_000) for ms in (0, first_ms, first_ms + second_ms)
    )
    assert start is not None
    assert middle is not None
    assert end is not None
    turn = middle.rotation @ start.rotation.T
    share = second_ms / first_ms
    shift_m = middle.translation_m - start.translation_m
    step = Pose(turn, np.zeros(3)).log()[:3] * share
    assert off(middle.nudged(np.r_[step, shift_m * share]), end) < 1e-9


def test_prediction_changes_nothing() -> None:
    stamps_ns = [k * FRAME_NS for k in range(10)]
    asked, _ = run([moving(t / 1e9) for t in stamps_ns], stamps_ns)
    left, _ = run([moving(t / 1e9) for t in stamps_ns], stamps_ns)
    for ms in (50, 10, 400, 900):
        asked.predict(stamps_ns[-1] + ms * 1_000_000)
    a, b = (f.update(moving(0.4), SHARP, 400_000_000) for f in (asked, left))
    assert np.array_equal(a.T_cam_obj.matrix, b.T_cam_obj.matrix)
    assert np.array_equal(a.covariance, b.covariance)


@pytest.mark.parametrize("axis", range(6))
def test_a_direction_of_which_a_measurement_knows_nothing_takes_nothing_from_it(axis: int) -> None:
    pose_filter, _ = run([START] * 20, [k * FRAME_NS for k in range(20)])
    blind = SHARP.copy()
    blind[axis, axis] = 0
    kick = np.zeros(6)
    kick[axis] = 0.05
    found = pose_filter.update(START.nudged(kick), blind, 20 * FRAME_NS)
    sighted, _ = run([START] * 20, [k * FRAME_NS for k in range(20)])
    taken = sighted.update(START.nudged(kick * 0.02), SHARP, 20 * FRAME_NS)
    assert found.within_gate
    assert off(found.T_cam_obj, START) < 1e-9
    assert off(taken.T_cam_obj, START) > 0.1 * 0.02 * 0.05


@settings(max_examples=20)
@given(SEEDS)
def test_however_long_a_motion_is_free_the_measured_pose_does_not_pull_along_it(seed: int) -> None:
    """Any mixture of turn and shift, the filter as unsure of it as a hundred frames in motion make it."""
    rng = np.random.default_rng(seed)
    least = np.array([FilterConfig().least_sigma_rad] * 3 + [FilterConfig().least_sigma_m] * 3)
    root = rng.normal(size=(6, 5))
    free = np.linalg.svd(root)[0][:, 5] * least  # in the root's null space, as the information below has it
    known = (root @ root.T) / np.outer(least, least)
    straying, straight = PoseFilter(FilterConfig()), PoseFilter(FilterConfig())
    for k in range(100):
        stamp_ns = k * FRAME_NS
        expected = straight.predict(stamp_ns) or START
        own = rng.normal(size=6) * least * (k % 7 > 0)
        b = straight.update(expected.nudged(own), known, stamp_ns)
        a = straying.update(expected.nudged(own + free * rng.normal() * 3 * (k > 0)), known, stamp_ns)
        assert off(a.T_cam_obj, b.T_cam_obj) < 1e-3 * np.linalg.norm(free)


def test_what_starts_to_move_after_a_long_rest_is_followed_at_once_and_rests_again() -> None:
    """Five seconds still, three at 0.3 m/s, five still, with the noise that is stated: no lag, and no overshoot."""
    rng, speed = np.random.default_rng(5), np.array([0, 0, 0.5, 0.3, 0, 0])
    seconds = [(min(max(k / 30 - 5, 0), 3)) for k in range(390)]
    truth = [START.nudged(speed * s) for s in seconds]
    measured = [pose.nudged(rng.normal(size=6) * ([0.005] * 3 + [0.001] * 3)) for pose in truth]
    _, found = run(measured, [k * FRAME_NS for k in range(390)])
    assert all(f.within_gate for f in found)
    behind_m = [t.translation_m[0] - f.T_cam_obj.translation_m[0] for t, f in zip(truth, found, strict=True)]
    assert np.abs(behind_m).max() < 0.005
    assert abs(np.mean(behind_m[160:240])) < 0.0003
    still = [f.T_cam_obj for f in found[50:150]], measured[50:150]
    filtered, raw = (np.median([a.distance_to_m(b) for a, b in pairwise(poses)]) for poses in still)
    assert filtered < 0.7 * raw


def test_a_bias_that_all_frames_share_is_not_averaged_away() -> None:
    config = FilterConfig()
    least = np.array([config.least_sigma_rad] * 3 + [config.least_sigma_m] * 3)
    _, found = run([START] * 300, [k * FRAME_NS for k in range(300)])
    assert (np.sqrt(np.diag(found[-1].covariance)) > 0.99 * least).all()
    assert (np.diag(found[-1].covariance) < 0.8 * np.diag(found[0].covariance)).all()


def test_no_measurement_is_trusted_more_than_the_least_sigmas() -> None:
    config = FilterConfig(least_sigma_rad=0.01, least_sigma_m=0.002)
    found = PoseFilter(config).start(START, information(1e-9, 1e-9), 0)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx([0.01] * 3 + [0.002] * 3)


@settings(max_examples=20)
@given(SEEDS)
def test_the_filter_is_equivariant_under_a_turn_and_a_shift_of_the_camera(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = Pose.exp(rng.normal(size=6))
    both = np.kron(np.eye(2), motion.rotation)
    roots = rng.normal(size=(15, 6, 6)) * 100
    plain, moved = PoseFilter(FilterConfig()), PoseFilter(FilterConfig())
    for k, (pose, root) in enumerate(zip(trembling(seed, 15, 0.01, 0.002), roots, strict=True)):
        known = root @ root.T
        a = plain.update(pose, known, k * FRAME_NS)
        b = moved.update(motion @ pose, both @ known @ both.T, k * FRAME_NS)
        assert off(motion @ a.T_cam_obj, b.T_cam_obj) < 1e-6
        assert np.allclose(both @ a.covariance @ both.T, b.covariance, rtol=1e-4, atol=1e-10)
        assert a.squared_distance == pytest.approx(b.squared_distance, rel=1e-3, abs=1e-6)


def test_after_a_long_gap_the_object_is_expected_where_it_was_and_the_filter_starts_anew() -> None:
    stamps_ns = [k * FRAME_NS for k in range(30)]
    pose_filter, found = run([moving(t / 1e9) for t in stamps_ns], stamps_ns)
    soon, late = stamps_ns[-1] + 400_000_000, stamps_ns[-1] + 600_000_000
    in_motion, at_rest = pose_filter.predict(soon), pose_filter.predict(late)
    assert in_motion is not None
    assert at_rest is not None
    assert off(in_motion, moving(soon / 1e9)) < 0.01
    assert off(at_rest, found[-1].T_cam_obj) < 1e-12
    elsewhere = START.nudged(np.full(6, 0.5))
    anew = pose_filter.update(elsewhere, SHARP, late)
    assert anew.within_gate
    assert anew.T_cam_obj is elsewhere
    expected = pose_filter.predict(late + FRAME_NS)
    assert expected is not None
    assert off(expected, elsewhere) < 1e-12


def test_a_turn_by_any_angle_is_filtered_without_a_seam() -> None:
    """Three rounds about an axis: no angle wraps."""
    stamps_ns = [k * FRAME_NS for k in range(120)]
    rounds = [START.nudged(np.array([0, 2 * np.pi * 3 * k / 120, 0, 0, 0, 0])) for k in range(120)]
    _, found = run(rounds, stamps_ns)
    assert all(f.within_gate for f in found)
    assert max(f.T_cam_obj.angle_to_rad(p) for f, p in zip(found[10:], rounds[10:], strict=True)) < 0.005
