"""A world of rigid groups: all that stands still is one group, each thing that moves is one of its own.

A group's acceleration structure is built once, in the group's frame; what moves between pictures are the rays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracker.geometry import Pose
from tracker.sources.synthetic.motion import Motion
from tracker.sources.synthetic.rendering.atlas import Atlas
from tracker.sources.synthetic.rendering.raycast import Float32s, Group, Hits
from tracker.sources.synthetic.things.mesh import Mesh
from tracker.sources.synthetic.things.texture import pack
from tracker.sources.synthetic.things.thing import Thing


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A thing and where it is in the world: fixed, or a motion (seconds -> T_world_thing)."""

    thing: Thing
    T_world_thing: Pose | Motion

    def at(self, time_s: float) -> Pose:
        return self.T_world_thing if isinstance(self.T_world_thing, Pose) else self.T_world_thing(time_s)


class World:
    """Things with their textures in one atlas. Rays are (N, 3) float32 origins and directions in the world frame."""

    def __init__(self, placed: Sequence[Placed]) -> None:
        texture, windows = pack({number: p.thing.texture for number, p in enumerate(placed)})
        self.atlas = Atlas.of(texture)
        size_px = (texture.shape[1], texture.shape[0])
        still: list[tuple[int, Mesh]] = []
        self._moving: list[tuple[Group, Placed]] = []
        for number, p in enumerate(placed):
            mesh = p.thing.mesh.in_window(*windows[number])
            if isinstance(p.T_world_thing, Pose):
                still.append((number, mesh.moved(p.T_world_thing)))
            else:
                self._moving.append((Group([(number, mesh)], size_px), p))
        self._still = Group(still, size_px)

    def trace(self, origins: Float32s, directions: Float32s, time_s: float) -> Hits:
        """The nearest surfaces."""
        hits = self._still.trace(origins, directions)
        for group, placed in self._moving:
            T_world_group = placed.at(time_s)
            near = np.flatnonzero(group.may_meet(origins, directions, T_world_group))
            if len(near):
                local = _into(T_world_group, origins[near], directions[near])
                _keep_nearer(hits, group.trace(*local), near, T_world_group)
        return hits

    def occluded(self, origins: Float32s, directions: Float32s, time_s: float) -> npt.NDArray[np.bool_]:
        """(N,) whether anything lies between the origin and origin + direction."""
        blocked = self._still.occluded(origins, directions)
        for group, placed in self._moving:
            T_world_group = placed.at(time_s)
            near = np.flatnonzero(~blocked & group.may_meet(origins, directions, T_world_group))
            if len(near):
                blocked[near] = group.occluded(*_into(T_world_group, origins[near], directions[near]))
        return blocked


def _into(T_world_group: Pose, origins: Float32s, directions: Float32s) -> tuple[Float32s, Float32s]:
    """Rays of the world in the frame of a group."""
    rotation = T_world_group.rotation.astype(np.float32)
    return (origins - T_world_group.translation_m.astype(np.float32)) @ rotation, directions @ rotation


def _keep_nearer(hits: Hits, other: Hits, where: npt.NDArray[np.integer], T_world_group: Pose) -> None:
    """Overwrites those of `hits` (at `where`) before which a group's hits lie."""
    nearer = other.distance < hits.distance[where]
    target = where[nearer]
    hits.distance[target], hits.owner[target] = other.distance[nearer], other.owner[nearer]
    hits.normals[target] = other.normals[nearer] @ T_world_group.rotation.T.astype(np.float32)
    hits.uv[target], hits.texel_m[target] = other.uv[nearer], other.texel_m[nearer]
