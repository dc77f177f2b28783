"""Triangles with texture coordinates, and what is measured on them: surface samples and the diameter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull
from scipy.spatial.distance import pdist

from tracker.geometry import Floats, Pose
from tracker.system_libraries import system_libraries_of

Ints = npt.NDArray[np.int64]

MERGE_DIGITS = 8  # vertices on a texture seam agree to the last bits only


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """One or several closed bodies that may overlap (a handle ends inside the wall that carries it).

    vertices_m: (V, 3). faces: (F, 3), counter-clockwise seen from outside. normals: (V, 3), unit, for shading.
    uv: (V, 2) column and row in the texture, both in [0, 1], row 0 at the top of the picture.
    body: (F,) number of the closed body that a face belongs to.
    """

    vertices_m: Floats
    faces: Ints
    normals: Floats
    uv: Floats
    body: Ints

    def moved(self, T_to_here: Pose) -> Mesh:
        return replace(self, vertices_m=T_to_here @ self.vertices_m, normals=self.normals @ T_to_here.rotation.T)

    def inside_out(self) -> Mesh:
        """The same seen from within: a room."""
        return replace(self, faces=self.faces[:, ::-1].copy(), normals=-self.normals)

    def centred(self) -> Mesh:
        """The same with the centre of the bounding box at the origin."""
        centre_m = (self.vertices_m.min(0) + self.vertices_m.max(0)) / 2
        return replace(self, vertices_m=self.vertices_m - centre_m)

    def in_window(self, left: float, top: float, right: float, bottom: float) -> Mesh:
        """The same with its texture coordinates squeezed into a window of the texture, in [0, 1]."""
        return replace(self, uv=self.uv * [right - left, bottom - top] + [left, top])

    @property
    def half_height_m(self) -> float:
        return float(np.ptp(self.vertices_m[:, 2])) / 2

    @property
    def diameter_m(self) -> float:
        """The largest distance between two vertices."""
        return float(pdist(self.vertices_m[ConvexHull(self.vertices_m).vertices]).max())


def patch(vertices_m: Floats, faces: npt.ArrayLike, uv: Floats) -> Mesh:
    """A piece that is smooth in itself: vertices at one place share a normal, weighted by the area of their faces."""
    triangles = np.asarray(faces, np.int64)
    corners = vertices_m[triangles]
    doubled_areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    whole = np.linalg.norm(doubled_areas, axis=1) > 1e-12  # the rest closes a pole: no area, no normal
    triangles, doubled_areas = triangles[whole], doubled_areas[whole]
    _, place = np.unique(vertices_m.round(MERGE_DIGITS), axis=0, return_inverse=True)
    sums = np.zeros((int(place.max()) + 1, 3))
    for corner in range(3):
        np.add.at(sums, place.ravel()[triangles[:, corner]], doubled_areas)
    normals = sums[place.ravel()]
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Mesh(vertices_m, triangles, normals, uv, np.zeros(len(triangles), np.int64))


def joined(parts: Sequence[Mesh], separate: bool = False) -> Mesh:
    """One mesh of several: pieces of the same closed body, or (`separate`) bodies that are closed already."""
    vertex_offsets = np.cumsum([0, *(len(part.vertices_m) for part in parts)])
    body_offsets = np.cumsum([0, *(int(part.body.max()) + 1 for part in parts)]) * separate
    return Mesh(
        np.concatenate([part.vertices_m for part in parts]),
        np.concatenate([part.faces + offset for part, offset in zip(parts, vertex_offsets[:-1], strict=True)]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.uv for part in parts]),
        np.concatenate([part.body + offset for part, offset in zip(parts, body_offsets[:-1], strict=True)]),
    )


def surface_samples(mesh: Mesh, count: int) -> Floats:
    """About `count` points (N, 3) spread evenly over the surface that can be touched; always the same ones."""
    rng = np.random.default_rng(0)
    corners = mesh.vertices_m[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    steps = (np.arange(count) + rng.random(count)) / count  # stratified: every count-th of the area gets one point
    face = np.searchsorted(np.cumsum(areas) / areas.sum(), steps).clip(0, len(areas) - 1)
    a, b = np.sort(rng.random((2, count)), axis=0)
    weights = np.stack((a, b - a, 1 - b), axis=1)
    points_m = np.einsum("nk,nkd->nd", weights, corners[face])
    return points_m[~_buried(mesh, points_m, mesh.body[face])]


def _buried(mesh: Mesh, points_m: Floats, own_body: Ints) -> npt.NDArray[np.bool_]:
    """(N,) whether a point of one body lies inside another one."""
    with system_libraries_of("open3d"):
        import open3d as o3d

    buried = np.zeros(len(points_m), bool)
    for body in range(int(mesh.body.max()) + 1):
        others = np.flatnonzero(own_body != body)
        if not len(others):
            continue
        scene: Any = o3d.t.geometry.RaycastingScene()
        scene.add_triangles(mesh.vertices_m.astype(np.float32), mesh.faces[mesh.body == body].astype(np.uint32))
        inside = scene.compute_occupancy(points_m[others].astype(np.float32)).numpy() > 0.5
        buried[others[inside]] = True
    return buried
