"""Points as a camera sees them: where, which way they face, and what hides them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from tracker.geometry import Floats, Intrinsics, Pose
from tracker.projection import CELL_PX, HIDDEN_BEHIND, Projection, interpolate, nearest_pixels, not_self_hidden, project

CAMERA = Intrinsics(250.0, 260.0, 63.0, 48.5, 128, 96)
SEEDS = st.integers(0, 10_000)


def ball(seed: int, count: int, radius_m: float = 0.05) -> tuple[Floats, Floats]:
    """Points and outward normals, (N, 3) each."""
    normals = np.random.default_rng([seed, 8]).normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return radius_m * normals, normals


def plate(depth_m: float, half_m: float, count: int = 41) -> Floats:
    """A square that faces the camera, on its optical axis."""
    x, y = np.meshgrid(*[np.linspace(-half_m, half_m, count)] * 2)
    return np.stack((x.ravel(), y.ravel(), np.full(x.size, depth_m)), axis=1)


def seen_from_the_origin(points_cam: Floats) -> Projection:
    return project(points_cam, np.tile((0.0, 0, -1), (len(points_cam), 1)), Pose.identity(), CAMERA)


@given(SEEDS)
def test_points_project_as_the_camera_says_and_normals_only_turn(seed: int) -> None:
    points, normals = ball(seed, 50)
    twist = np.random.default_rng(seed).normal(size=6) * (1, 1, 1, 0.02, 0.02, 0.02)
    T_cam_obj = Pose(np.eye(3), np.array([0, 0, 0.4])) @ Pose.exp(twist)
    at = project(points, normals, T_cam_obj, CAMERA)
    assert np.allclose(at.points_cam, T_cam_obj @ points)
    assert np.allclose(at.normals_cam, (T_cam_obj @ (points + normals)) - (T_cam_obj @ points))
    assert np.allclose(np.stack((at.columns, at.rows), axis=1), CAMERA.project(T_cam_obj @ points))
    rays = at.points_cam / np.linalg.norm(at.points_cam, axis=1, keepdims=True)
    assert np.allclose(at.facing, (-rays * at.normals_cam).sum(axis=1))


def test_of_a_ball_the_near_half_faces_the_camera_and_hides_the_other() -> None:
    points, normals = ball(0, 20_000)
    at = project(points, normals, Pose(np.eye(3), np.array([0, 0, 0.4])), CAMERA)
    visible = not_self_hidden(at, 0.1)
    assert at.facing.max() == pytest.approx(1, abs=0.01)
    assert at.facing[np.argmin(points[:, 2])] > 0.99
    assert visible[at.facing > 0.6].all()  # a steeper surface spans the slack within a cell
    assert visible[at.facing < -0.5].mean() < 0.01  # a cell may hold no point of the near side


def test_a_surface_hides_only_what_lies_clearly_behind_it() -> None:
    diameter_m = 0.2
    front, back = plate(0.5, 0.02), plate(0.5, 0.02)
    for gap, hidden in ((0.5, False), (0.9, False), (1.1, True), (3, True)):
        back[:, 2] = 0.5 + gap * HIDDEN_BEHIND * diameter_m
        visible = not_self_hidden(seen_from_the_origin(np.vstack((front, back * (0.9, 0.9, 1)))), diameter_m)
        assert visible[: len(front)].all()
        assert (~visible[len(front) :]).any() == hidden


def test_what_looks_past_the_surface_in_front_is_not_hidden() -> None:
    front, back = plate(0.5, 0.02), plate(0.6, 0.06)
    at = seen_from_the_origin(np.vstack((front, back)))
    visible = not_self_hidden(at, 0.2)[len(front) :]
    columns, rows = at.columns[len(front) :] - CAMERA.cx, at.rows[len(front) :] - CAMERA.cy
    edge_px = 0.02 / 0.5 * CAMERA.fx
    inside = (np.abs(columns) < edge_px - CELL_PX) & (np.abs(rows) < edge_px - CELL_PX)
    beside = (np.abs(columns) > edge_px + 2 * CELL_PX) | (np.abs(rows) > edge_px + 2 * CELL_PX)
    assert not visible[inside].any()
    assert visible[beside].all()


def test_points_beside_and_behind_the_camera_are_not_within_and_do_no_harm() -> None:
    points = np.vstack((plate(0.5, 0.02, 5), [(0.3, 0.2, 1e-9), (0.0, 0.0, -0.5)]))
    at = seen_from_the_origin(points)
    assert at.within(CAMERA, 0).tolist() == [True] * 25 + [False] * 2
    assert not_self_hidden(at, 0.1)[:25].all()
    rows, columns = nearest_pixels(at, CAMERA)
    assert min(rows.min(), columns.min()) >= 0
    assert (rows.max(), columns.max()) <= (95, 127)


EDGES_PX = st.integers(-4, 4).map(lambda quarters: quarters / 4 + 0.01)


@given(
    st.floats(-5, 135) | EDGES_PX | EDGES_PX.map(lambda px: 127 - px),
    st.floats(-5, 100) | EDGES_PX | EDGES_PX.map(lambda px: 95 - px),
    st.integers(0, 3),
)
def test_within_is_a_margin_inside_the_outermost_pixels(column: float, row: float, margin_px: int) -> None:
    ((x, y, z),) = CAMERA.unproject(np.array([column]), np.array([row]), np.array([0.5]))
    at = seen_from_the_origin(np.array([(x, y, z)]))
    assert (at.columns[0], at.rows[0]) == pytest.approx((column, row))
    inside = margin_px <= at.columns[0] <= 127 - margin_px and margin_px <= at.rows[0] <= 95 - margin_px
    assert at.within(CAMERA, margin_px)[0] == inside


def test_the_nearest_pixel_is_the_rounded_one_clipped_to_the_picture() -> None:
    pixels = np.array([(10.6, 20.4), (0.49, -0.2), (127.4, 95.9), (-8, 199)])
    points = CAMERA.unproject(pixels[:, 0], pixels[:, 1], np.full(4, 0.5))
    rows, columns = nearest_pixels(seen_from_the_origin(points), CAMERA)
    assert columns.tolist() == [11, 0, 127, 0]
    assert rows.tolist() == [20, 0, 95, 95]


@given(SEEDS)
def test_interpolation_is_bilinear(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = rng.random((96, 128, 3), np.float32)
    columns, rows = rng.uniform(1, 126, 30), rng.uniform(1, 94, 30)
    expected = [map_coordinates(image[:, :, c].astype(float), (rows, columns), order=1) for c in range(3)]
    assert np.allclose(interpolate(image, columns, rows), np.stack(expected, axis=1), atol=1e-6)
    whole = interpolate(image, columns.round(), rows.round())
    assert np.array_equal(whole, image[rows.round().astype(int), columns.round().astype(int)])
