"""How much of an object can be seen: its silhouette alone, and which of it the world leaves to the camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracker.geometry import Intrinsics, Pose
from tracker.sources.synthetic.rendering.picture import pixel_rays
from tracker.sources.synthetic.rendering.raycast import Group
from tracker.sources.synthetic.rendering.world import Placed, World

COARSE_WIDTH_PX = 160  # every pixel of a picture this wide is counted, of a larger one every second, third ..
FEW_SAMPLES = 24  # fewer seen than this are counted again pixel by pixel
BEYOND = 1.0  # a silhouette counts up to this many picture sizes outside the picture
NEAR_M = 0.02


@dataclass(frozen=True, slots=True)
class Visible:
    """pixels: in the picture. fraction: their share of the whole silhouette, what is hidden or outside included."""

    pixels: int
    fraction: float


class VisibilityCounter:
    """Counts for the tracked things, which are the first ones of the world."""

    def __init__(self, world: World, tracked: Sequence[Placed], camera: Intrinsics) -> None:
        self._world, self._camera = world, camera
        self._meshes = [placed.thing.mesh for placed in tracked]
        self._alone = [Group([(0, mesh)], (1, 1)) for mesh in self._meshes]
        self._coarse_step = max(1, round(camera.width / COARSE_WIDTH_PX))

    def count(self, number: int, T_world_cam: Pose, T_cam_obj: Pose, time_s: float) -> Visible:
        visible = self._count(number, T_world_cam, T_cam_obj, time_s, self._coarse_step)
        if self._coarse_step > 1 and visible.pixels < FEW_SAMPLES * self._coarse_step**2:
            return self._count(number, T_world_cam, T_cam_obj, time_s, 1)
        return visible

    def _count(self, number: int, T_world_cam: Pose, T_cam_obj: Pose, time_s: float, step: int) -> Visible:
        vertices_cam = T_cam_obj @ self._meshes[number].vertices_m
        if vertices_cam[:, 2].min() < NEAR_M:  # beside or behind the camera, which never comes that near
            return Visible(0, 0.0)
        size = np.array([self._camera.width, self._camera.height])
        corners = self._camera.project(vertices_cam)
        low = np.maximum(corners.min(0), -BEYOND * size) // step * step
        high = np.minimum(corners.max(0) + 1, (1 + BEYOND) * size)
        columns, rows = (
            axis.ravel() for axis in np.meshgrid(*(np.arange(a, b, step) for a, b in zip(low, high, strict=True)))
        )
        silhouette = self._alone[number].trace(*pixel_rays(T_cam_obj.inverse(), self._camera, columns, rows)).owner == 0
        inside = silhouette & (columns >= 0) & (rows >= 0) & (columns < size[0]) & (rows < size[1])
        rays = pixel_rays(T_world_cam, self._camera, columns[inside], rows[inside])
        seen = int((self._world.trace(*rays, time_s).owner == number).sum()) if inside.any() else 0
        return Visible(seen * step**2, seen / max(int(silhouette.sum()), 1))
