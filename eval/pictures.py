"""What errors need of the pictures that poses were estimated in: the camera of each, and for VSD its depth."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from eval.datasets import CameraSource, Dataset, ObjectModel
from eval.visible_surface import SurfaceRenderer, vsd
from tracker.errors import SourceError
from tracker.geometry import Intrinsics, Pose

log = logging.getLogger(__name__)


class Cameras:
    """The camera of every image of a dataset, each asked for once."""

    def __init__(self, dataset: Dataset) -> None:
        self._dataset = dataset
        self._known: dict[tuple[int, int], Intrinsics] = {}

    def __call__(self, scene_id: int, index: int) -> Intrinsics:
        """index: position of the image in its scene. Raises SourceError where it cannot be told."""
        key = (scene_id, index)
        if key not in self._known:
            scene = self._dataset.scene(scene_id)
            self._known[key] = scene.camera(index) if isinstance(scene, CameraSource) else scene[index].intrinsics
        return self._known[key]


@dataclass(frozen=True, slots=True, eq=False)
class PosePair:
    """An estimate beside the truth. index: position of the image in its scene. row: where the answer belongs."""

    scene_id: int
    index: int
    object_id: str
    estimated: Pose
    truth: Pose
    row: int


def surface_errors(
    dataset: Dataset, pairs: Iterable[PosePair], models: Mapping[str, ObjectModel]
) -> dict[int, tuple[float, ...]]:
    """VSD by `row`, ten values each; every image is read once. Objects without triangles have none.

    Raises SourceError where a picture cannot be read.
    """
    renderers: dict[str, SurfaceRenderer] = {}
    errors: dict[int, tuple[float, ...]] = {}
    frame, place = None, None
    for pair in sorted(pairs, key=lambda pair: (pair.scene_id, pair.index)):
        model = models[pair.object_id]
        if model.triangles is None:
            continue
        if pair.object_id not in renderers:
            renderers[pair.object_id] = SurfaceRenderer(model.mesh_vertices_m, model.triangles)
        if frame is None or place != (pair.scene_id, pair.index):
            place = (pair.scene_id, pair.index)
            frame = dataset.scene(pair.scene_id)[pair.index]
        poses = pair.estimated, pair.truth
        values = vsd(renderers[pair.object_id], model.diameter_m, *poses, frame.depth_m, frame.intrinsics)
        errors[pair.row] = tuple(map(float, values))
    return errors


def why_no_cameras(cameras: Cameras, places: Iterable[tuple[int, int]]) -> str | None:
    """None where the camera of every image (scene, index) is known."""
    try:
        for place in places:
            cameras(*place)
    except SourceError as error:
        log.warning("MSPD is not measured, as an image's camera or size is not known: %s", error)
        return str(error)
    return None
