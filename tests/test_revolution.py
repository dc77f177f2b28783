"""The axis of what is nearly a solid of revolution, and the poses that its shape alone does not tell apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracker.concept import ConceptModel
from tracker.declared_symmetry import parse_symmetry
from tracker.geometry import Pose
from tracker.revolution import TURNS, Turns, revolution_axis

T_OBJ_BODY = Pose.exp([0.3, -0.8, 0.5, 0.1, 0.02, -0.3])


def tin_with_a_handle(model: ConceptModel, seen_rad: float) -> ConceptModel:
    """The surface of a noisy tin, as far around as it was seen, and a block beside it; anyhow in the object frame."""
    rng = np.random.default_rng(0)
    angles, height_m = rng.uniform(0, seen_rad, 2000), rng.uniform(-0.05, 0.05, 2000)
    around = np.stack((np.cos(angles), np.sin(angles), 0 * angles), axis=1)
    tin = 0.04 * around + height_m[:, None] * [0, 0, 1]
    sides = np.vstack((np.eye(3), -np.eye(3)))[rng.integers(6, size=300)]
    block = [0.06, 0.01, 0] + (rng.uniform(-1, 1, (300, 3)) * (sides == 0) + sides) * [0.01, 0.005, 0.03]
    normals = np.vstack((around, sides)) + rng.normal(0, 0.05, (2300, 3))
    return replace(
        model,
        points=T_OBJ_BODY @ (np.vstack((tin, block)) + rng.normal(0, 0.0003, (2300, 3))),
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True) @ T_OBJ_BODY.rotation.T,
        diameter_m=0.13,
    )


@pytest.mark.parametrize("seen_rad", [2.0, 2.5, 6.28])
def test_the_axis_is_met_by_the_normals_even_beside_a_handle(seen_rad: float, can_model: ConceptModel) -> None:
    axis, point_m = revolution_axis(tin_with_a_handle(can_model, seen_rad))
    beside_m = np.cross(point_m - T_OBJ_BODY.translation_m, axis)
    assert abs(axis @ T_OBJ_BODY.rotation[:, 2]) > np.cos(np.radians(3))
    assert np.linalg.norm(beside_m) < 0.005


def test_turns_go_all_around_and_leave_the_axis_where_it_is(can_model: ConceptModel) -> None:
    T_cam_obj = Pose.exp([0.4, 1.0, -0.2, 0.1, 0.2, 0.7])
    axis, point_m = revolution_axis(can_model)
    on_axis = np.stack((point_m, point_m + axis))
    poses = Turns(can_model).of(T_cam_obj)
    for pose in poses:
        assert pose @ on_axis == pytest.approx(T_cam_obj @ on_axis, abs=1e-9)
    angles_rad = [Rotation.from_matrix(T_cam_obj.rotation.T @ p.rotation).as_rotvec() @ axis for p in poses]
    steps = np.sort(np.mod(angles_rad, 2 * np.pi))
    assert steps == pytest.approx(2 * np.pi * np.arange(1, TURNS) / TURNS, abs=1e-6)


def test_where_any_turn_looks_the_same_there_is_no_other_pose(can_model: ConceptModel) -> None:
    assert Turns(replace(can_model, symmetry=parse_symmetry("z:inf"))).of(Pose.identity()) == []
