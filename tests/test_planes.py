"""Planes behind a thing are found, its own faces are not among them."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.planes import planes_behind
from tracker.geometry import Floats

TABLE = np.array([0.0, -0.8, -0.6])  # seen from above, half a metre away
OFFSET_M = 0.5


def on_plane(normal: Floats, offset_m: float, rng: np.random.Generator, count: int, width_m: float = 0.5) -> Floats:
    """(count, 3) points of it around the one nearest to the camera, with a camera's noise."""
    sideways = np.linalg.svd(normal[None])[2][1:]
    flat = rng.uniform(-width_m / 2, width_m / 2, (count, 2)) @ sideways
    return flat - offset_m * normal + rng.normal(0, 0.001, (count, 1)) * normal


@settings(max_examples=25)
@given(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.floats(0.3, 1.5), st.integers(0, 99))
def test_a_plane_under_clutter_is_found_and_looks_at_the_camera(x: float, y: float, offset_m: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    normal = np.array([x, y, -1.0]) / np.linalg.norm([x, y, -1.0])
    points = on_plane(normal, offset_m, rng, 3000)
    clutter = points[:1500] + rng.uniform(0.01, 0.2, (1500, 1)) * normal
    (plane,) = planes_behind(np.concatenate((points, clutter)), None, rng)
    assert plane.normal @ normal > np.cos(np.radians(1))
    assert abs(plane.offset_m - offset_m) < 0.003
    assert plane.height_m(np.zeros((1, 3)))[0] > 0


def test_of_the_table_and_a_face_only_the_table_is_behind_what_is_meant() -> None:
    rng = np.random.default_rng(0)
    foot = np.array([0.0, 0.2, 0.34 / 0.6])  # on the table
    ahead = np.array([0.0, 0.6, -0.8])  # along the table, towards the camera
    across, up = rng.uniform(-0.05, 0.05, (2000, 1)) * [1, 0, 0], rng.uniform(0, 0.12, (2000, 1)) * TABLE
    face = foot + across + up + rng.normal(0, 0.001, (2000, 1)) * ahead
    flat = rng.uniform(-0.25, 0.25, (4000, 2)) @ np.array([[1, 0, 0], ahead])
    table = foot + flat + rng.normal(0, 0.001, (4000, 1)) * TABLE
    meant = face.mean(axis=0, keepdims=True)
    (plane,) = planes_behind(np.concatenate((table, face)), meant, rng)
    assert plane.normal @ TABLE > 0.999


def test_where_nothing_is_flat_there_is_no_plane_of_a_line_or_of_two_points() -> None:
    rng = np.random.default_rng(0)
    line = np.linspace(0, 1, 50)[:, None] * np.array([[0.1, 0.2, 1.0]]) + [0, 0, 0.5]
    for points in (line, line[:2]):
        assert planes_behind(points, None, rng) == []
