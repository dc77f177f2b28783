"""Rays against a rigid group of meshes. Rays are (N, 3) float32 origins and directions in the group's frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tracker.geometry import Pose
from tracker.sources.synthetic.things.mesh import Mesh
from tracker.system_libraries import system_libraries_of

Float32s = npt.NDArray[np.floating]  # float32 in fact: rays are many; numpy's type stubs lose that
NOTHING = -1


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """What N rays met. distance: in lengths of the ray's direction, infinite for nothing. owner: number of the thing.

    normals: (N, 3) unit, in the frame of the rays, smooth over curved surfaces. uv: (N, 2) in the atlas.
    texel_m: (N,) size of a texture pixel on the surface.
    """

    distance: Float32s
    owner: npt.NDArray[np.int16]
    normals: Float32s
    uv: Float32s
    texel_m: Float32s


class Group:
    """Meshes that do not move against each other, in their common frame."""

    def __init__(self, meshes: Sequence[tuple[int, Mesh]], atlas_size_px: tuple[int, int]) -> None:
        with system_libraries_of("open3d"):
            import open3d as o3d

        offsets = np.cumsum([0, *(len(mesh.vertices_m) for _, mesh in meshes)])
        faces = np.concatenate([m.faces + offset for (_, m), offset in zip(meshes, offsets, strict=False)])
        vertices = np.concatenate([mesh.vertices_m for _, mesh in meshes])
        attributes = np.concatenate([np.concatenate((mesh.normals, mesh.uv), axis=1) for _, mesh in meshes])[faces]
        # a + u b + v c at the barycentric coordinates (u, v): one lookup a ray
        a = attributes[:, 0]
        self._attributes = np.stack((a, attributes[:, 1] - a, attributes[:, 2] - a)).astype(np.float32)
        self._owner = np.concatenate([np.full(len(mesh.faces), number) for number, mesh in meshes]).astype(np.int16)
        self._texel_m = _texel_sizes_m(vertices[faces], attributes[..., 3:] * atlas_size_px)
        self._centre_m = (vertices.min(0) + vertices.max(0)) / 2
        self._radius_m = float(np.linalg.norm(vertices - self._centre_m, axis=1).max())
        self._scene: Any = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))

    def may_meet(self, origins: Float32s, directions: Float32s, T_world_group: Pose) -> npt.NDArray[np.bool_]:
        """(N,) whether the ray's line passes the bounding sphere, and not only behind its origin."""
        offset = (T_world_group @ self._centre_m[None])[0].astype(np.float32) - origins
        along, squared = dot(offset, directions), dot(directions, directions)
        beside = dot(offset, offset) - along**2 / squared
        return (beside < self._radius_m**2) & (along > -self._radius_m * np.sqrt(squared))

    def trace(self, origins: Float32s, directions: Float32s) -> Hits:
        found = self._scene.cast_rays(np.concatenate((origins, directions), axis=1))
        # Copied: Open3D ends a program that still holds its memory at exit with status 1.
        distance, face = found["t_hit"].numpy().copy(), found["primitive_ids"].numpy()
        missed = ~np.isfinite(distance)
        face = np.where(missed, 0, face)
        u, v = found["primitive_uvs"].numpy().T[..., None]
        values = np.take(self._attributes[0], face, axis=0)
        values += u * np.take(self._attributes[1], face, axis=0)
        values += v * np.take(self._attributes[2], face, axis=0)
        normals = values[:, :3] / np.sqrt(dot(values, values, 3))[:, None]
        owner = np.take(self._owner, face)
        owner[missed] = NOTHING
        return Hits(distance, owner, normals, values[:, 3:], np.take(self._texel_m, face))

    def occluded(self, origins: Float32s, directions: Float32s) -> npt.NDArray[np.bool_]:
        return self._scene.test_occlusions(np.concatenate((origins, directions), axis=1), 0.0, 1.0).numpy().copy()


def dot(a: Float32s, b: Float32s, columns: int = 3) -> Float32s:
    """(N,) products of the first columns of (N, k) arrays; for three columns twice as fast as einsum."""
    total = a[:, 0] * b[:, 0]
    for column in range(1, columns):
        total += a[:, column] * b[:, column]
    return total


def _texel_sizes_m(corners_m: npt.NDArray[np.floating], corners_px: npt.NDArray[np.floating]) -> Float32s:
    """(F,) size of a texture pixel on each face, from the ratio of its areas on the thing and in the atlas."""
    edges_m, edges_px = corners_m[:, 1:] - corners_m[:, :1], corners_px[:, 1:] - corners_px[:, :1]
    area_m2 = np.linalg.norm(np.cross(edges_m[:, 0], edges_m[:, 1]), axis=1)
    area_px = np.abs(edges_px[:, 0, 0] * edges_px[:, 1, 1] - edges_px[:, 0, 1] * edges_px[:, 1, 0])
    return np.sqrt(area_m2 / np.maximum(area_px, 1e-9)).astype(np.float32)
