"""Drawn onto the surface: by nearness, and by concepts where nearness does not know."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracker.closest_points import ClosestPoints, ClosestPointsConfig
from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.geometry import Floats, Pose
from tracker.matching import Correspondences, Matcher, MatchingConfig

CONFIG = ClosestPointsConfig()
SEEDS = st.integers(0, 10_000)
T_CAM_OBJ = Pose.exp((0.3, -0.2, 0.5, 0.02, -0.05, 0.7))


def ellipsoid(seed: int, count: int, radii_m: tuple[float, float, float] = (0.1, 0.06, 0.04)) -> tuple[Floats, Floats]:
    """Points and outward normals, (N, 3) each."""
    directions = np.random.default_rng([seed, 3]).normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    normals = directions / radii_m
    return directions * radii_m, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def model_of(points: Floats, normals: Floats, diameter_m: float = 0.2) -> ConceptModel:
    ones, nothing = np.ones(len(points), np.float32), np.zeros((len(points), 3), np.float32)
    return ConceptModel(
        "thing", points, normals, nothing, nothing[:, :1], ones.astype(np.int32), ones, np.eye(3)[:1], diameter_m,
        ("concept",), "none", "none",
    )  # fmt: skip


def cloud_of(points_obj: Floats, normals_obj: Floats, T_cam_obj: Pose = T_CAM_OBJ) -> PointCloud:
    nothing = np.zeros((len(points_obj), 3), np.float32)
    return PointCloud(T_cam_obj @ points_obj, normals_obj @ T_cam_obj.rotation.T, nothing, nothing[:, :1])


def all_right(count: int) -> Correspondences:
    return Correspondences(np.arange(count), np.arange(count), *np.zeros((2, count), np.float32))


def off(seed: int, angle_deg: float, distance_m: float) -> Pose:
    """`T_CAM_OBJ`, turned about any axis and shifted in any direction by so much."""
    turn, shift = np.random.default_rng([seed, 4]).normal(size=(2, 3))
    turn *= np.radians(angle_deg) / np.linalg.norm(turn)
    return T_CAM_OBJ.nudged(np.r_[turn, shift * distance_m / np.linalg.norm(shift)])


def errors(found: Pose | None, truth: Pose = T_CAM_OBJ) -> tuple[float, float]:
    """Millimetres and degrees."""
    assert found is not None
    return 1000 * found.distance_to_m(truth), float(np.degrees(found.angle_to_rad(truth)))


@settings(max_examples=20)
@given(SEEDS)
def test_alignment_from_near_by_ends_at_the_truth(seed: int) -> None:
    model, cloud = model_of(*ellipsoid(0, 8000)), cloud_of(*ellipsoid(1, 1000))
    assert max(errors(ClosestPoints(model, CONFIG).align(off(seed, 4, 0.006), cloud))) < 0.5


@settings(max_examples=20)
@given(SEEDS)
def test_alignment_is_equivariant_under_motions_of_the_camera(seed: int) -> None:
    closest, surface = ClosestPoints(model_of(*ellipsoid(0, 3000)), CONFIG), ellipsoid(1, 700)
    motion = Pose.exp(np.random.default_rng([seed, 5]).normal(size=6))
    start = off(seed, 4, 0.006)
    found, moved = (
        closest.align(start, cloud_of(*surface)),
        closest.align(motion @ start, cloud_of(*surface, motion @ T_CAM_OBJ)),
    )
    assert found is not None
    assert max(errors(moved, motion @ found)) < 1e-3


def test_points_that_lie_elsewhere_do_not_draw() -> None:
    """A third of the cloud is a wall ten centimetres behind the object."""
    points, normals = ellipsoid(1, 1000)
    wall = np.random.default_rng(0).uniform(-0.1, 0.1, (500, 3)) * (1, 1, 0) + (0, 0, 0.14)
    cloud = cloud_of(np.vstack((points, wall)), np.vstack((normals, np.tile((0.0, 0, -1), (500, 1)))))
    assert max(errors(ClosestPoints(model_of(*ellipsoid(0, 8000)), CONFIG).align(off(3, 4, 0.006), cloud))) < 0.5


def test_the_front_of_a_thin_sheet_is_never_drawn_onto_its_back() -> None:
    """A sheet of 6 mm. Shifted by 2 mm its sides are nearest to themselves; by 5 mm one of them to the other."""
    across = np.stack(np.meshgrid(np.linspace(-0.1, 0.1, 41), np.linspace(-0.1, 0.1, 41)), axis=2).reshape(-1, 2)
    front = np.hstack((across, np.full((len(across), 1), 0.003)))
    back = front * (1, 1, -1)
    up, down = np.tile((0.0, 0, 1), (len(across), 1)), np.tile((0.0, 0, -1), (len(across), 1))
    closest = ClosestPoints(model_of(np.vstack((front, back)), np.vstack((up, down)), 0.28), CONFIG)
    outwards = T_CAM_OBJ.rotation[:, 2]
    for points, normals in ((front, up), (back, down)):
        for shift_m in (-0.005, -0.002, 0.002, 0.005):
            start = Pose(T_CAM_OBJ.rotation, T_CAM_OBJ.translation_m + shift_m * outwards)
            found = closest.align(start, cloud_of(points, normals))
            assert found is not None or abs(shift_m) > 0.003
            if found is not None:
                assert (found.translation_m - T_CAM_OBJ.translation_m) @ outwards == pytest.approx(0, abs=2e-4)


def test_what_the_surface_leaves_free_is_left_as_it_was() -> None:
    """A ball turned about its centre looks the same."""
    ball = (0.06, 0.06, 0.06)
    closest = ClosestPoints(model_of(*ellipsoid(0, 8000, ball), 0.12), CONFIG)
    turned = T_CAM_OBJ @ Pose(Rotation.from_euler("xyz", (20, -30, 10), degrees=True).as_matrix(), np.zeros(3))
    start = turned.nudged(np.array((0, 0, 0, 0.004, 0, -0.003)))
    found = closest.align(start, cloud_of(*ellipsoid(1, 1000, ball)))
    assert found is not None
    assert found.distance_to_m(T_CAM_OBJ) < 0.0003
    assert np.degrees(found.angle_to_rad(turned)) < 2


def test_a_cloud_out_of_reach_or_too_small_is_aligned_to_nothing() -> None:
    closest = ClosestPoints(model_of(*ellipsoid(0, 3000)), CONFIG)
    away = T_CAM_OBJ.nudged(np.array((0, 0, 0, 0, 0, 0.5)))
    assert closest.align(away, cloud_of(*ellipsoid(1, 700))) is None
    assert closest.align(T_CAM_OBJ, cloud_of(*ellipsoid(1, 15))) is None
    assert closest.align(T_CAM_OBJ, cloud_of(*ellipsoid(1, 0))) is None


def test_no_steps_change_nothing() -> None:
    closest = ClosestPoints(model_of(*ellipsoid(0, 3000)), ClosestPointsConfig(steps=0, concept_steps=0))
    start, cloud = off(0, 3, 0.004), cloud_of(*ellipsoid(1, 700))
    assert closest.align(start, cloud) is start
    assert closest.pull(start, all_right(700), cloud) is start


@settings(max_examples=20)
@given(SEEDS, st.floats(0, 0.6))
def test_concepts_pull_from_afar_though_many_of_them_are_wrong(seed: int, wrong: float) -> None:
    surface = ellipsoid(0, 1500)
    rng = np.random.default_rng([seed, 6])
    index = np.where(rng.random(1500) < wrong, rng.integers(1500, size=1500), np.arange(1500))
    pairs = Correspondences(np.arange(1500), index, *np.zeros((2, 1500), np.float32))
    found = ClosestPoints(model_of(*surface), CONFIG).pull(off(seed, 15, 0.02), pairs, cloud_of(*surface))
    millimetres, degrees = errors(found)
    assert millimetres < 3
    assert degrees < 3


def test_concepts_that_are_all_right_pull_to_the_truth() -> None:
    surface = ellipsoid(0, 1500)
    found = ClosestPoints(model_of(*surface), CONFIG).pull(off(0, 20, 0.03), all_right(1500), cloud_of(*surface))
    assert max(errors(found)) < 1e-6


def test_one_step_is_enough_where_all_concepts_are_right() -> None:
    """Also of a cloud that is one end of the thing, whose middle is not the origin."""
    points, normals = ellipsoid(0, 1500)
    end = points[:, 0] > 0.05
    once = ClosestPointsConfig(concept_steps=1)
    pairs = all_right(int(end.sum()))
    found = ClosestPoints(model_of(points[end], normals[end]), once).pull(
        off(0, 20, 0.03), pairs, cloud_of(points[end], normals[end])
    )
    assert max(errors(found)) < 1e-6


def test_the_pull_is_equivariant_under_motions_of_the_camera() -> None:
    surface = ellipsoid(0, 800)
    index = np.random.default_rng(0).permutation(800)
    index[::2] = np.arange(0, 800, 2)
    pairs = Correspondences(np.arange(800), index, *np.zeros((2, 800), np.float32))
    closest, start, motion = ClosestPoints(model_of(*surface), CONFIG), off(1, 15, 0.02), Pose.exp((1, 2, -1, 3, 0, 1))
    found = closest.pull(start, pairs, cloud_of(*surface))
    moved = closest.pull(motion @ start, pairs, cloud_of(*surface, motion @ T_CAM_OBJ))
    assert max(errors(moved, motion @ found)) < 1e-6


def test_too_few_concepts_that_could_be_right_pull_nothing() -> None:
    points, normals = ellipsoid(0, 1500)
    closest, start = ClosestPoints(model_of(points, normals), CONFIG), off(0, 5, 0.005)
    assert closest.pull(start, all_right(0), cloud_of(points, normals)) is start
    assert closest.pull(start, all_right(19), cloud_of(points, normals)) is start
    assert closest.pull(start, all_right(1500), cloud_of(points, -normals)) is start  # another side of the thing
    far = start.nudged(np.array((0, 0, 0, 0.3, 0, 0)))
    assert closest.pull(far, all_right(1500), cloud_of(points, normals)) is far


def test_concepts_bring_back_the_turn_of_a_can_that_its_shape_does_not_show(
    can_model: ConceptModel, can_cloud: PointCloud, can_truth: Pose
) -> None:
    closest = ClosestPoints(can_model, CONFIG)
    pairs = Matcher(can_model, MatchingConfig(), torch.device("cpu"))(can_cloud)
    for angle_deg in (-30, 30):
        turn = Rotation.from_euler("z", angle_deg, degrees=True).as_matrix()
        start = can_truth @ Pose(turn, np.zeros(3))
        by_shape = closest.align(start, can_cloud)
        by_concepts = closest.align(closest.pull(start, pairs, can_cloud), can_cloud)
        assert errors(by_shape, can_truth)[1] > 20
        assert errors(by_concepts, can_truth)[1] < 15
        assert errors(by_concepts, can_truth)[0] < 2
