"""Planes in a picture's points: what things stand on, and walls behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracker.geometry import Floats

NEARBY_M = 0.4  # around what is pointed at: planes that matter are seen there
TRIED, SAMPLED, NEAR_PLANE_M = 400, 3000, 0.008  # RANSAC: planes, points to compare by, what is on one
LEAST_THICK_M, MOST_THICK_M = 0.004, 0.012  # of what is taken away with a plane: three sigma of its points, within this
MOST_PLANES, LEAST_PLANE_SHARE = 5, 0.08  # the table, walls, faces of the thing; of the points that are looked at
LEAST_ABOVE = 0.2  # of the points in a box that have to be before a plane which is behind the thing


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """normal (3,) points to the camera's side; thick_m is what counts as on it."""

    normal: Floats
    offset_m: float
    thick_m: float

    def height_m(self, points: Floats) -> Floats:
        """(N,) of points (N, 3), above 0 on the camera's side."""
        return points @ self.normal + self.offset_m


def planes_behind(points: Floats, meant: Floats | None, rng: np.random.Generator) -> list[Plane]:
    """Of the largest planes around what is meant those that have it on the camera's side, the largest first. Where
    nothing is meant, the largest of all."""
    if meant is not None:
        points = points[np.linalg.norm(points - np.median(meant, axis=0), axis=1) < NEARBY_M]
    planes, least, left = [], max(LEAST_PLANE_SHARE * len(points), 3), points
    for _ in range(1 if meant is None else MOST_PLANES):
        plane = _largest_plane(left, rng) if len(left) >= least else None
        if plane is None:
            break
        on = np.abs(plane.height_m(left)) < max(plane.thick_m, NEAR_PLANE_M)
        if on.sum() < least:
            break
        through_several_things = plane.thick_m == MOST_THICK_M  # or a slice of something round
        before_it = meant is None or (plane.height_m(meant) > plane.thick_m).mean() >= LEAST_ABOVE
        if before_it and not through_several_things:
            planes.append(plane)
        left = left[~on]
    return planes


def _largest_plane(points: Floats, rng: np.random.Generator) -> Plane | None:
    """By RANSAC, then fitted to its points (of N, 3). None where all points are on a line."""
    corners = points[rng.integers(len(points), size=(TRIED, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    usable = lengths > 1e-9
    if not usable.any():
        return None
    normals = normals[usable] / lengths[usable, None]
    offsets = -np.einsum("ij,ij->i", normals, corners[usable, 0])
    compared = points[rng.integers(len(points), size=SAMPLED)]
    best = int(np.argmax((np.abs(compared @ normals.T + offsets) < NEAR_PLANE_M).sum(axis=0)))
    plane = Plane(normals[best], float(offsets[best]), NEAR_PLANE_M)
    for _ in range(2):
        near = points[np.abs(plane.height_m(points)) < NEAR_PLANE_M]
        centre = near.mean(axis=0)
        normal = np.linalg.eigh(np.cov((near - centre).T))[1][:, 0]
        normal = normal if normal @ centre < 0 else -normal  # the camera is the origin
        sigma_m = 1.4826 * float(np.median(np.abs((near - centre) @ normal)))
        plane = Plane(normal, -float(normal @ centre), float(np.clip(3 * sigma_m, LEAST_THICK_M, MOST_THICK_M)))
    return plane
