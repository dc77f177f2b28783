"""The scene that the project renders itself, as a dataset of one scene with the exact poses and shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from eval.datasets import LEAST_VISIBLE_FRACTION, MaskKind, ObjectModel, Target, require, require_visible_masks
from eval.symmetries import ASYMMETRIC, ObjectSymmetries
from tracker.geometry import Floats
from tracker.sources import PosedSource

SCENE_ID = 1
TURNS_ABOUT_Z = ObjectSymmetries.listed(axes=[[0, 0, 1]], offsets_m=[[0, 0, 0]])


class Shape(Protocol):
    """What the renderer knows of an object: (N, 3) points in metres, their diameter, whether every turn about z looks
    the same, and the mesh, (V, 3) vertices in metres and (M, 3) triangles."""

    @property
    def points_m(self) -> Floats: ...

    @property
    def diameter_m(self) -> float: ...

    @property
    def symmetric(self) -> bool: ...

    @property
    def vertices_m(self) -> Floats: ...

    @property
    def triangles(self) -> npt.NDArray[np.integer]: ...


class ShapedSource(PosedSource, Protocol):
    """A source that also knows the shapes of its objects."""

    def shape(self, object_id: str) -> Shape: ...


class SyntheticDataset:
    """One scene, number 1, whose images are numbered by position. An object's number is its place, from 1, in the
    sorted names of the scene's objects."""

    def __init__(self, scene: ShapedSource) -> None:
        self.name = scene.name
        self.model_frame = "the renderer's own"
        self.target_rule = f"at least {LEAST_VISIBLE_FRACTION:.0%} visible, every frame"
        self.scene_ids = (SCENE_ID,)
        self.object_ids = tuple(sorted(scene.object_ids))
        self._scene = scene

    def scene(self, scene_id: int, masks: MaskKind = "visib") -> PosedSource:
        require("scene", scene_id, self.scene_ids, self.name)
        require_visible_masks(masks, self.name)
        return self._scene

    def image_ids(self, scene_id: int) -> Sequence[int]:
        return range(len(self.scene(scene_id)))

    def targets(self, scene_id: int) -> list[Target]:
        scene = self.scene(scene_id)
        targets = [
            Target(s.index, s.index, object_id, s.T_cam_obj, s.visible_px, s.visible_fraction)
            for object_id in self.object_ids
            for s in scene.sightings(object_id)
            if s.visible_fraction >= LEAST_VISIBLE_FRACTION
        ]
        return sorted(targets, key=lambda target: target.index)  # stable: objects keep their order

    def model(self, object_id: str) -> ObjectModel:
        require("object", object_id, self.object_ids, self.name)
        shape = self._scene.shape(object_id)
        symmetries = TURNS_ABOUT_Z if shape.symmetric else ASYMMETRIC
        mesh = shape.triangles, shape.vertices_m
        return ObjectModel(shape.points_m, shape.diameter_m, shape.symmetric, symmetries, *mesh)

    def number(self, object_id: str) -> int:
        require("object", object_id, self.object_ids, self.name)
        return self.object_ids.index(object_id) + 1

    def object_with(self, number: int) -> str:
        require("object number", number, range(1, len(self.object_ids) + 1), self.name)
        return self.object_ids[number - 1]


def open_synthetic(argument: str) -> SyntheticDataset:
    """`NAME[?options]` of `tracker.sources.synthetic`. Raises SourceError where there is no such scene."""
    from tracker.sources.synthetic import open_scene

    return SyntheticDataset(open_scene(argument))
