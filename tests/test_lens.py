"""Undistorted pictures: a point is where the pinhole camera sees it, and an unknown lens is refused."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from tracker.errors import SourceError
from tracker.geometry import Floats, Intrinsics
from tracker.sources.lens import MODELS, Lens

CAMERA = Intrinsics(150.0, 155.0, 80.5, 59.0, 160, 120)
COEFFICIENTS = [-0.2, 0.08, 0.004, -0.003, -0.02]
POINTS_CAM = np.array([[0.25, 0.2, 1.0], [-0.35, 0.1, 1.0], [0.4, -0.3, 1.0], [0.0, 0.0, 1.0], [-0.3, -0.25, 1.0]])


def distorted(points_cam: Floats, model: str, coefficients: Sequence[float]) -> Floats:
    """(N, 2) pixels, by OpenCV's own projection."""
    nowhere = np.zeros(3)
    if model in ("kannala_brandt4", "equidistant", "fisheye"):
        pixels, _ = cv2.fisheye.projectPoints(
            points_cam[None], nowhere, nowhere, CAMERA.matrix, np.array(coefficients[:4])
        )
    else:
        pixels, _ = cv2.projectPoints(points_cam, nowhere, nowhere, CAMERA.matrix, np.array(coefficients))
    return np.asarray(pixels, float).reshape(-1, 2)


def painted(pixels: Floats) -> np.ndarray:
    """White spots of 7 x 7 pixels on black, three channels."""
    picture = np.zeros((120, 160, 3), np.uint8)
    for x, y in pixels.round().astype(int):
        picture[y - 3 : y + 4, x - 3 : x + 4] = 255
    return picture


@pytest.mark.parametrize("model", MODELS)
def test_a_point_is_where_the_pinhole_camera_sees_it(model: str) -> None:
    counts, _ = MODELS[model]
    coefficients = (COEFFICIENTS + [0.0] * 9)[: counts[0]]
    rgb = painted(distorted(POINTS_CAM, model, coefficients))
    depth_m = np.where(rgb[:, :, 0] > 0, np.float32(0.5), np.float32(0))
    straight, straight_depth_m = Lens(CAMERA, model, coefficients).undistort(rgb, depth_m)
    moved_px = np.linalg.norm(CAMERA.project(POINTS_CAM) - distorted(POINTS_CAM, model, coefficients), axis=1)
    assert moved_px.max() > 2
    for x, y in CAMERA.project(POINTS_CAM):
        rows, columns = np.nonzero(straight[int(y) - 7 : int(y) + 9, int(x) - 7 : int(x) + 9, 0] > 127)
        centre = np.array([columns.mean() + int(x) - 7, rows.mean() + int(y) - 7])
        assert np.abs(centre - (x, y)).max() < 0.8  # spots are drawn to half a pixel
        assert straight_depth_m[round(y), round(x)] == np.float32(0.5)


def test_depth_is_never_in_between_and_where_the_picture_does_not_reach_there_is_none() -> None:
    depth_m = np.where(np.arange(160) % 16 < 8, np.float32(0.5), np.float32(2))[None].repeat(120, axis=0)
    rgb = np.full((120, 160, 3), 200, np.uint8)
    straight, straight_depth_m = Lens(CAMERA, "brown_conrady", [0.3, 0, 0, 0, 0]).undistort(rgb, depth_m)
    assert set(np.unique(straight_depth_m)) == {0, np.float32(0.5), np.float32(2)}
    assert straight_depth_m[0, 0] == 0
    assert (straight[0, 0] == 0).all()


@pytest.mark.parametrize(("model", "coefficients"), [("none", []), ("brown_conrady", [0.0] * 5), ("none", [0.0] * 5)])
def test_a_pinhole_camera_changes_nothing(model: str, coefficients: list[float]) -> None:
    rgb, depth_m = np.ones((120, 160, 3), np.uint8), np.ones((120, 160), np.float32)
    same = Lens(CAMERA, model, coefficients).undistort(rgb, depth_m)
    assert same[0] is rgb
    assert same[1] is depth_m


def test_a_fisheye_lens_bends_with_coefficients_of_zero_too() -> None:
    rgb = np.broadcast_to(np.arange(160, dtype=np.uint8)[None, :, None], (120, 160, 3)).copy()
    straight, _ = Lens(CAMERA, "equidistant", [0.0] * 4).undistort(rgb, np.ones((120, 160), np.float32))
    assert not np.array_equal(straight, rgb)


@pytest.mark.parametrize(
    ("model", "coefficients", "complaint"),
    [
        ("ftheta", [0.1] * 5, r"cam 7: pictures with distortion 'ftheta' \[0.1, .* cannot be undistorted; known"),
        ("none", [0.1], "cam 7: pictures with distortion 'none'"),
        ("", [0.1] * 5, "cam 7: pictures with distortion ''"),
        ("ftheta", [0.0] * 5, "cannot be undistorted"),
        ("brown_conrady", [0.1] * 3, r"distortion 'brown_conrady' has \(4, 5, 8, 12, 14\) coefficients, got 3"),
        ("plumb_bob", [0.1, float("nan")], "not finite"),
    ],
)  # fmt: skip
def test_distortion_is_never_ignored(model: str, coefficients: list[float], complaint: str) -> None:
    with pytest.raises(SourceError, match=complaint):
        Lens(CAMERA, model, coefficients, "cam 7")
