"""Small motions by least squares: exact where a motion explains everything, blind to what is to be thrown away."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.geometry import Floats, Pose
from tracker.least_squares import DAMPING, MotionEquations, free_directions, moved, tukey

SEEDS = st.integers(0, 10_000)
POSE = Pose.exp((0.3, -0.2, 0.5, 0.02, -0.05, 0.7))


def scattered(seed: int, count: int = 60) -> tuple[Floats, Floats, Floats]:
    """Arms (N, 3) within a few centimetres, unit directions (N, 3) and weights (N,)."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return rng.uniform(-0.05, 0.05, (count, 3)), directions, rng.uniform(0.1, 2, count)


def displacement(motion: Floats, arms: Floats) -> Floats:
    """(N, 3) by which a small motion (turn, shift) moves the ends of the arms, to first order."""
    return np.cross(motion[:3], arms) + motion[3:]


def of_picture(gradients: Floats, residuals: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Structure (3, N) and pull (2, N) of one channel with gradients (N, 2)."""
    x, y = gradients.T
    return weights * np.stack((x * x, x * y, y * y)), weights * residuals * np.stack((x, y))


@given(st.floats(-5, 5), st.floats(0.01, 3))
def test_tukey_is_one_at_zero_even_falling_and_nothing_from_its_reach_on(residual: float, reach: float) -> None:
    weight = tukey(np.array([0.0, residual, -residual, 1.01 * residual, reach, 2 * reach]), reach)
    assert weight[0] == 1
    assert weight[1] == weight[2] >= weight[3]
    assert weight[4] == weight[5] == 0
    assert weight[1] > 0 or abs(residual) > 0.999 * reach
    assert weight[1] == pytest.approx(max(1 - (residual / reach) ** 2, 0) ** 2)


@given(SEEDS)
def test_a_motion_that_explains_all_residuals_solves_the_equations(seed: int) -> None:
    arms, directions, weights = scattered(seed)
    motion = np.random.default_rng([seed, 1]).normal(size=6) * (0.01, 0.01, 0.01, 0.001, 0.001, 0.001)
    residuals = (displacement(motion, arms) * directions).sum(axis=1)
    equations = MotionEquations()
    equations.add(arms, directions, residuals, weights)
    matrix, vector = equations.without_offset(0.0)
    assert np.allclose(np.linalg.solve(matrix, vector), motion, rtol=1e-6, atol=1e-9)


@given(SEEDS)
def test_the_matrix_is_symmetric_positive_definite_and_grows_with_every_observation(seed: int) -> None:
    equations, before = MotionEquations(), np.zeros((6, 6))
    for part in range(3):
        arms, directions, weights = scattered(seed + part)
        equations.add(arms, directions, np.zeros(len(arms)), weights)
        matrix, _ = equations.without_offset(1.0)
        assert np.allclose(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix - before).min() > 0
        before = matrix


@given(SEEDS)
def test_a_weight_counts_as_often_as_it_says(seed: int) -> None:
    arms, directions, _ = scattered(seed)
    residuals = np.random.default_rng([seed, 2]).normal(size=len(arms))
    once, twice = MotionEquations(), MotionEquations()
    once.add(arms, directions, residuals, np.full(len(arms), 2.0))
    for _ in range(2):
        twice.add(arms, directions, residuals, np.ones(len(arms)))
    assert all(np.allclose(a, b) for a, b in zip(once.without_offset(0.0), twice.without_offset(0.0), strict=True))


@given(SEEDS, st.floats(0.01, 100))
def test_the_offset_is_marginalised_as_in_the_full_eight_by_eight_system(seed: int, information: float) -> None:
    arms, directions, weights = scattered(seed)
    rng = np.random.default_rng([seed, 3])
    gradients, residuals = rng.normal(size=(len(arms), 2)), rng.normal(size=len(arms))
    depth, along = rng.normal(size=len(arms)), rng.normal(size=(2, len(arms), 3))
    colour = gradients[:, :1] * along[0] + gradients[:, 1:] * along[1]
    equations = MotionEquations()
    equations.add(arms, directions, depth, weights)
    equations.add_picture(arms, along[0], along[1], *of_picture(gradients, residuals, weights))
    matrix, vector = equations.without_offset(information)

    of_depth = np.hstack((np.cross(arms, directions), directions, np.zeros((len(arms), 2))))
    of_colour = np.hstack((np.cross(arms, colour), colour, gradients))
    full = (of_depth * weights[:, None]).T @ of_depth + (of_colour * weights[:, None]).T @ of_colour
    full[6:, 6:] += information * np.eye(2)
    right = of_depth.T @ (weights * depth) + of_colour.T @ (weights * residuals)
    assert np.allclose(np.linalg.solve(matrix, vector), np.linalg.solve(full, right)[:6], rtol=1e-6, atol=1e-9)
    assert np.allclose(np.linalg.inv(matrix), np.linalg.inv(full)[:6, :6], rtol=1e-6, atol=1e-9)


def test_a_shift_of_the_whole_colour_picture_moves_the_pose_only_where_the_offset_is_held() -> None:
    arms, _, weights = scattered(4)
    gradients = np.random.default_rng(5).normal(size=(len(arms), 2))
    along = [np.tile(axis, (len(arms), 1)) * 800 for axis in np.eye(3)[:2]]  # a pixel is 1.25 mm
    residuals = gradients @ [1.5, -0.5]  # what a picture that is 1.5 and 0.5 pixels off does
    solutions = {}
    for information in (0.0, 1e9):
        equations = MotionEquations()
        for axis in np.eye(3):  # depth that holds the pose where it is
            equations.add(arms, np.tile(axis, (len(arms), 1)), np.zeros(len(arms)), 1e4 * weights)
        equations.add_picture(arms, along[0], along[1], *of_picture(gradients, residuals, weights))
        solutions[information] = np.linalg.solve(*equations.without_offset(information))
    assert np.abs(solutions[0.0]).max() < 1e-6
    assert np.abs(solutions[1e9][3:5]).max() > 1e-3


@given(SEEDS)
def test_moved_turns_about_the_origin_of_the_object_and_shifts_in_camera_axes(seed: int) -> None:
    arms, directions, weights = scattered(seed, 200)
    motion = np.random.default_rng([seed, 6]).normal(size=6) * (0.02, 0.02, 0.02, 0.002, 0.002, 0.002)
    equations = MotionEquations()
    equations.add(arms, directions, (displacement(motion, arms) * directions).sum(axis=1), weights)
    found = moved(POSE, *equations.without_offset(0.0))
    expected = POSE.nudged(motion)
    size = np.linalg.norm(motion[:3]) + np.linalg.norm(motion[3:])
    assert found.angle_to_rad(expected) < 5 * DAMPING * size + 1e-9
    assert found.distance_to_m(expected) < 5 * DAMPING * size + 1e-9


@pytest.mark.parametrize("axis", range(3))
def test_what_the_data_leave_free_keeps_still(axis: int) -> None:
    """Planes seen along one direction say nothing about a slide across it, nor about a turn around it."""
    arms = np.random.default_rng(7).uniform(-0.05, 0.05, (80, 3))
    directions = np.tile(np.eye(3)[axis], (80, 1))
    equations = MotionEquations()
    equations.add(arms, directions, np.full(80, 0.002), np.ones(80))
    motion = moved(POSE, *equations.without_offset(0.0))
    shift_m = motion.translation_m - POSE.translation_m
    assert shift_m[axis] == pytest.approx(0.002, rel=0.01)
    assert np.abs(np.delete(shift_m, axis)).max() < 1e-9
    assert motion.angle_to_rad(POSE) < 1e-3


@given(st.integers(0, 2), st.floats(0.01, 1))
def test_a_plane_leaves_two_slides_and_a_turn_free_at_any_size(axis: int, radius_m: float) -> None:
    arms = np.random.default_rng(8).uniform(-radius_m, radius_m, (200, 3))
    arms[:, axis] = 0
    equations = MotionEquations()
    equations.add(arms, np.tile(np.eye(3)[axis], (200, 1)), np.zeros(200), np.ones(200))
    free = free_directions(equations.without_offset(0.0)[0], radius_m)
    assert len(free) == 3
    for motion in free:
        assert np.abs(displacement(motion, arms)[:, axis]).max() < 1e-6
        assert np.abs(displacement(motion, arms)).max() > 0.1


@given(SEEDS)
def test_nothing_is_free_where_points_face_everywhere(seed: int) -> None:
    arms, directions, weights = scattered(seed, 200)
    equations = MotionEquations()
    equations.add(arms, directions, np.zeros(200), weights)
    assert len(free_directions(equations.without_offset(0.0)[0], 0.05)) == 0


def test_no_data_at_all_move_nothing() -> None:
    still = moved(POSE, *MotionEquations().without_offset(0.0))
    assert still.distance_to_m(POSE) == 0
    assert still.angle_to_rad(POSE) < 1e-9
