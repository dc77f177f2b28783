"""A view becomes points that lie on the surface, know which way it faces, and carry what the pixel said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracker.cloud import LEAST_POINTS, CloudConfig, inliers, lift, normals_of
from tracker.frame import PosedFrame
from tracker.geometry import Floats, Pose
from tracker.saliency import Saliency
from tracker.view import ObjectView, ViewConfig, view_object

CONFIG = CloudConfig()
AHEAD = Pose(np.eye(3), np.array([0.01, -0.005, 0.35]))
twists = st.lists(st.floats(-2, 2), min_size=6, max_size=6)


def viewed(ball: PosedFrame, extent_m: float = 0.1) -> ObjectView:
    view = view_object(ball.frame, ball.mask, extent_m, ViewConfig())
    assert view is not None
    return view


def places(view: ObjectView) -> Saliency:
    """Maps whose values are the column and the row of the frame, in hundreds."""
    box, (height, width) = view.box, view.inside.shape
    block = (box.x1 - box.x0) / width
    columns = box.x0 + (np.arange(width) + 0.5) * block - 0.5
    rows = box.y0 + (np.arange(height) + 0.5) * block - 0.5
    maps = np.stack(np.meshgrid(columns, rows)) / 100
    return Saliency(("column", "row"), maps.astype(np.float32), box)


def patch(count: int = 400, seed: int = 0) -> Floats:
    """(N, 3) points on a wavy piece of surface half a metre ahead."""
    x, y = np.random.default_rng(seed).uniform(-0.05, 0.05, (2, count))
    return np.stack((x, y, 0.5 + 0.01 * np.sin(40 * x) + 0.2 * y), axis=1)


def test_points_lie_on_the_ball_and_normals_point_out_of_it(globe: Callable[..., PosedFrame]) -> None:
    view = viewed(globe(AHEAD))
    cloud = lift(view, places(view), CONFIG)
    assert len(cloud) > 0.9 * view.has_depth.sum()
    outwards = (cloud.points - AHEAD.translation_m) / 0.05
    assert np.linalg.norm(outwards, axis=1) == pytest.approx(1, abs=0.02)
    assert np.linalg.norm(cloud.normals, axis=1) == pytest.approx(1, abs=1e-6)
    cosines = (cloud.normals * outwards).sum(axis=1)
    assert cosines.min() > np.cos(np.radians(12))
    assert np.median(cosines) > np.cos(np.radians(1))


def test_every_point_carries_the_colour_and_the_saliency_of_its_own_pixel(globe: Callable[..., PosedFrame]) -> None:
    ball = globe(AHEAD, paint=lambda outwards: 128 + 100 * outwards)
    view = viewed(ball)
    cloud = lift(view, places(view), CONFIG)
    pixels = ball.frame.intrinsics.project(cloud.points)
    assert cloud.saliency.shape == (len(cloud), 2)
    assert np.allclose(100 * cloud.saliency, pixels, atol=0.01)
    outwards = (cloud.points - AHEAD.translation_m) / 0.05
    difference = np.abs(cloud.colours - (128 + 100 * outwards))
    assert difference[:, :2].max() < 3
    assert np.median(difference) < 1


def test_flying_pixels_within_the_mask_do_not_become_points(globe: Callable[..., PosedFrame]) -> None:
    ball = globe(AHEAD)
    depth_m = ball.frame.depth_m.copy()
    depth_m[100:104, 160:164], depth_m[130:134, 180:184] = 0.8, 0.1
    assert ball.mask[100, 160] & ball.mask[133, 183]
    view = viewed(replace(ball, frame=replace(ball.frame, depth_m=depth_m)))
    cloud = lift(view, places(view), CONFIG)
    assert view.points()[:, 2].max() > 0.7
    assert np.linalg.norm(cloud.points - AHEAD.translation_m, axis=1) == pytest.approx(0.05, rel=0.02)
    assert len(cloud) > 0.85 * view.has_depth.sum()


def test_both_stages_remove_what_is_away_from_the_rest_and_little_else() -> None:
    points = patch()
    alone = np.array([[0.1, 0.1, 0.5], [0, 0, 0.7], [-0.2, 0, 0.2]])
    clump = np.random.default_rng(1).normal([0.25, 0, 0.5], 0.002, (20, 3))  # dense, so only its distance betrays it
    kept = inliers(np.concatenate((points, alone, clump)), CONFIG)
    assert not kept[400:].any()
    assert kept[:400].mean() > 0.9


@given(twist=twists, scale=st.floats(0.1, 10))
def test_which_points_are_outliers_depends_neither_on_place_nor_on_size(twist: list[float], scale: float) -> None:
    points = np.concatenate((patch(), [[0.1, 0.1, 0.6], [0.3, 0, 0.5]]))
    expected = inliers(points, CONFIG)
    assert not expected.all()
    assert (inliers(scale * (Pose.exp(twist) @ points), CONFIG) == expected).mean() > 0.995


def test_the_order_of_the_points_does_not_matter() -> None:
    points = np.concatenate((patch(), [[0.1, 0.1, 0.6], [0.3, 0, 0.5]]))
    order = np.random.default_rng(3).permutation(len(points))
    assert np.array_equal(inliers(points[order], CONFIG), inliers(points, CONFIG)[order])


@pytest.mark.parametrize("count", [0, 1, LEAST_POINTS - 1])
def test_of_too_few_points_none_is_kept(count: int) -> None:
    assert inliers(patch(count), CONFIG).tolist() == [False] * count


@pytest.mark.parametrize("neighbours", [8, 49, 64])
def test_enough_points_are_judged_even_by_more_neighbours_than_there_are(neighbours: int) -> None:
    points = np.concatenate((patch(LEAST_POINTS - 1), [[0, 0, 3.0]]))
    kept = inliers(points, CloudConfig(outlier_neighbours=neighbours, centre_sigmas=1e6))  # the first stage alone
    assert not kept[-1]
    assert kept[:-1].mean() > 0.8


def test_an_object_of_too_few_pixels_becomes_an_empty_cloud(globe: Callable[..., PosedFrame]) -> None:
    ball = globe(AHEAD)
    mask = np.zeros_like(ball.mask)
    mask[110:117, 160:167] = True
    view = viewed(replace(ball, mask=mask), extent_m=0.02)
    assert 0 < view.has_depth.sum() < LEAST_POINTS
    cloud = lift(view, places(view), CONFIG)
    assert len(cloud) == 0
    assert [part.shape for part in (cloud.points, cloud.normals, cloud.colours, cloud.saliency)] == [
        (0, 3), (0, 3), (0, 3), (0, 2)
    ]  # fmt: skip


@given(tilt=st.lists(st.floats(-1, 1), min_size=2, max_size=2))
def test_the_normals_of_a_plane_are_the_plane_s_and_face_the_camera(tilt: list[float]) -> None:
    x, y = np.random.default_rng(0).uniform(-0.05, 0.05, (2, 300))
    normals = normals_of(np.stack((x, y, 0.5 + tilt[0] * x + tilt[1] * y), axis=1), CONFIG)
    plane = np.array([tilt[0], tilt[1], -1]) / np.linalg.norm([*tilt, 1])
    assert normals @ plane == pytest.approx(1, abs=1e-6)


@given(turn=st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_normals_turn_with_the_cloud_about_the_camera(turn: list[float]) -> None:
    rotation = Rotation.from_rotvec(turn).as_matrix()
    points = patch()
    assert np.allclose(normals_of(points @ rotation.T, CONFIG), normals_of(points, CONFIG) @ rotation.T, atol=1e-6)


@pytest.mark.parametrize("count", [1, 5, 15])
def test_where_there_are_no_neighbours_normals_just_face_the_camera(count: int) -> None:
    points = patch(count)
    assert np.allclose(normals_of(points, CONFIG), -points / np.linalg.norm(points, axis=1, keepdims=True))
