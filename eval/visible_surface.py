"""VSD, the visible surface discrepancy, as BOP has measured it since 2019.

Hodan et al. 2016, "On Evaluation of 6D Object Pose Estimation", section 3.2, with the visibility masks of 2019
(`visibility.py` and `pose_error.vsd` of bop_toolkit). All images hold distances from the camera's centre, not z.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tracker.geometry import Floats, Intrinsics, Pose
from tracker.system_libraries import system_libraries_of

DELTA_M = 0.015  # by how much a surface may lie behind what the camera measured and still count as seen
TAUS = np.arange(1, 11) / 20  # of the diameter: 0.05, 0.10 .. 0.50
NEAREST_M = 1e-3  # a box that comes nearer to the camera's plane has no outline to cut the image down to


class SurfaceRenderer:
    """Distance images of one mesh. vertices_m: (N, 3) object coordinates. triangles: (M, 3) indices into them."""

    def __init__(self, vertices_m: Floats, triangles: npt.NDArray[np.integer]) -> None:
        with system_libraries_of("open3d"):
            import open3d as o3d

        self._scene: Any = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(np.float32(vertices_m), np.ascontiguousarray(triangles, np.uint32))
        ends = np.stack((vertices_m.min(axis=0), vertices_m.max(axis=0)))
        self._corners_m = np.stack(np.meshgrid(*ends.T), axis=-1).reshape(-1, 3)

    def distances_m(self, T_cam_obj: Pose, rays: Floats) -> Floats:
        """(H, W) distance of the surface along rays (H, W, 3) with z = 1, in camera coordinates; 0 where there is none.

        The rays are moved into the object's frame, where the mesh stays.
        """
        inverse = np.linalg.inv(T_cam_obj.rotation)
        directions = rays @ inverse.T
        origins = np.broadcast_to(-inverse @ T_cam_obj.translation_m, rays.shape)
        hits = self._scene.cast_rays(np.concatenate((origins, directions), axis=-1).astype(np.float32))
        depth_m = hits["t_hit"].numpy().astype(np.float64)
        return np.where(np.isfinite(depth_m), depth_m, 0.0) * np.linalg.norm(rays, axis=-1)

    def window(self, T_cam_obj: Pose, camera: Intrinsics) -> tuple[Floats, Floats]:
        """First and one past the last (column, row) of the image that the object can cover."""
        corners_cam = T_cam_obj @ self._corners_m
        size = np.array([camera.width, camera.height])
        if corners_cam[:, 2].min() < NEAREST_M:
            return np.zeros(2), size
        pixels = camera.project(corners_cam)
        return np.clip(np.floor(pixels.min(axis=0)), 0, size), np.clip(np.ceil(pixels.max(axis=0)) + 1, 0, size)


def vsd(
    renderer: SurfaceRenderer,
    diameter_m: float,
    estimated: Pose,
    truth: Pose,
    depth_m: npt.NDArray[np.floating],
    camera: Intrinsics,
) -> Floats:
    """(10,) errors in [0, 1] of one pose for the misalignments TAUS, in shares of the diameter.

    depth_m: (H, W) what the camera measured, z in metres, 0 where nothing.
    """
    (low, high), (true_low, true_high) = (renderer.window(pose, camera) for pose in (estimated, truth))
    (left, top), (right, bottom) = np.minimum(low, true_low).astype(int), np.maximum(high, true_high).astype(int)
    if right <= left or bottom <= top:
        return np.ones(len(TAUS))
    rows, columns = np.mgrid[top:bottom, left:right]
    rays = camera.unproject(columns.ravel(), rows.ravel(), np.ones(rows.size)).reshape(*rows.shape, 3)
    scene_m = depth_m[top:bottom, left:right] * np.linalg.norm(rays, axis=-1)
    return discrepancy(scene_m, renderer.distances_m(estimated, rays), renderer.distances_m(truth, rays), diameter_m)


def discrepancy(scene_m: Floats, estimated_m: Floats, true_m: Floats, diameter_m: float) -> Floats:
    """(10,) VSD for TAUS from three distance images (H, W) in metres, 0 where there is nothing.

    Of the pixels where either surface is seen, the share where only one is, or where they are tau or more apart; 1
    where neither is seen at all.
    """
    seen_true = _seen(true_m, scene_m)
    seen = _seen(estimated_m, scene_m) | (seen_true & (estimated_m > 0))
    both, either = seen & seen_true, int((seen | seen_true).sum())
    if not either:
        return np.ones(len(TAUS))
    apart = np.abs(true_m[both] - estimated_m[both]) / diameter_m
    wrong = (apart >= TAUS[:, None]).sum(axis=1) + either - int(both.sum())
    return wrong / either


def _seen(surface_m: Floats, scene_m: Floats) -> npt.NDArray[np.bool_]:
    """A surface is seen where the camera measured nothing, or nothing more than delta in front of it."""
    return (surface_m > 0) & ((surface_m - scene_m <= DELTA_M) | (scene_m == 0))
