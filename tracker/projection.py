"""The points of a model at a pose, as the camera of a view sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracker.frame import Mask
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.view import Float32s

CELL_PX = 2  # of the coarse depth buffer that finds what the object hides of itself
HIDDEN_BEHIND = 0.07  # of the diameter: a point this far behind the front of its cell is hidden


@dataclass(frozen=True, slots=True, eq=False)
class Projection:
    """points_cam, normals_cam: (N, 3). columns, rows: (N,) pixels of the view. facing: (N,) cosine between the normal
    and the direction to the camera, negative on the far side."""

    points_cam: Floats
    normals_cam: Floats
    columns: Floats
    rows: Floats
    facing: Floats

    def within(self, camera: Intrinsics, margin_px: int) -> Mask:
        """(N,) bool, in front of the camera and at least margin_px inside its picture."""
        inside = (self.columns >= margin_px) & (self.columns <= camera.width - 1 - margin_px)
        inside &= (self.rows >= margin_px) & (self.rows <= camera.height - 1 - margin_px)
        return inside & (self.points_cam[:, 2] > 0)


def project(points_obj: Floats, normals_obj: Floats, T_cam_obj: Pose, camera: Intrinsics) -> Projection:
    points_cam = T_cam_obj @ points_obj
    normals_cam = normals_obj @ T_cam_obj.rotation.T
    depth_m = np.maximum(points_cam[:, 2], 1e-6)
    columns = points_cam[:, 0] / depth_m * camera.fx + camera.cx
    rows = points_cam[:, 1] / depth_m * camera.fy + camera.cy
    facing = -np.einsum("ni,ni->n", normals_cam, points_cam) / np.sqrt(np.einsum("ni,ni->n", points_cam, points_cam))
    return Projection(points_cam, normals_cam, columns, rows, facing)


def not_self_hidden(projection: Projection, diameter_m: float, cell_px: float = CELL_PX) -> Mask:
    """(N,) bool: no point of the same object lies clearly in front. By a depth buffer of cells so coarse that the
    points of a surface leave none empty."""
    cells = np.stack((projection.rows, projection.columns), axis=1) // cell_px
    cells = (cells - cells.min(axis=0)).astype(np.int64)
    cell = cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1]
    depth_m = projection.points_cam[:, 2]
    if cell.max() > 10_000_000:  # a point beside the camera projects to anywhere
        return np.ones(len(depth_m), bool)
    front_m = np.full(int(cell.max()) + 1, np.inf)
    np.minimum.at(front_m, cell, depth_m)
    return depth_m < front_m[cell] + HIDDEN_BEHIND * diameter_m


def nearest_pixels(projection: Projection, camera: Intrinsics) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Rows and columns (N,) of the nearest pixels, clipped to the picture."""
    columns = np.clip(np.rint(projection.columns), 0, camera.width - 1).astype(np.intp)
    rows = np.clip(np.rint(projection.rows), 0, camera.height - 1).astype(np.intp)
    return rows, columns


def interpolate(image: Float32s, columns: Floats, rows: Floats) -> Float32s:
    """(N, C) values of an image (h, w, C) between its pixels; columns and rows at least one pixel inside."""
    left, top = columns.astype(np.intp), rows.astype(np.intp)
    a, b = (np.asarray(part, np.float32)[:, None] for part in (columns - left, rows - top))
    width, corner = image.shape[1], top * image.shape[1] + left
    pixels = image.reshape(-1, image.shape[2])
    upper = pixels.take(corner, axis=0) * (1 - a) + pixels.take(corner + 1, axis=0) * a
    lower = pixels.take(corner + width, axis=0) * (1 - a) + pixels.take(corner + width + 1, axis=0) * a
    return upper * (1 - b) + lower * b
