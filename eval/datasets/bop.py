"""A dataset in BOP's layout.

    PATH/SPLIT/SSSSSS/...  models_eval/ or models/{obj_OOOOOO.ply, models_info.json}  test_targets_bop19.json

PATH may be the folder of a split; models and targets are then looked for beside it. Errors are measured on all vertices
of a model, as the BOP toolkit does, however many: a scan's 8,000 cost 5 ms an instance, and half of them would lower
the ADD-S AUC up to 2 cm of poses good to 2 mm by 0.8.
https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from eval.datasets import LEAST_VISIBLE_FRACTION, MaskKind, ObjectModel, Target, require
from eval.symmetries import ObjectSymmetries
from tracker.errors import SourceError
from tracker.geometry import Floats
from tracker.sources import Sighting
from tracker.sources.bop import BopScene, scene_ids
from tracker.sources.json_files import DAMAGE, read_json

log = logging.getLogger(__name__)

TARGETS_FILE = "test_targets_bop19.json"
MODEL_FOLDERS = ("models_eval", "models")  # in the order of preference: the first is resampled for errors


class BopDataset:
    """All scenes under a folder, of the split `test` where there is one. An object occurs once in an image.

    Raises SourceError where the folder holds no scene or its target file is damaged.
    """

    def __init__(self, path: str | Path) -> None:
        self.name = f"bop:{path}"
        self.model_frame = "the dataset's own (BOP models)"
        self._path = Path(path)
        self.scene_ids = tuple(scene_ids(self._path))
        if not self.scene_ids:
            raise SourceError(f"{self.name}: no scene (a folder SSSSSS with scene_camera.json) under {path}")
        self._scenes: dict[tuple[int, MaskKind], BopScene] = {}
        self._listed = _read_targets(self._targets_file())
        least = f"at least {LEAST_VISIBLE_FRACTION:.0%} visible, every frame (there is no {TARGETS_FILE})"
        self.target_rule = least if self._listed is None else TARGETS_FILE

    @property
    def object_ids(self) -> tuple[str, ...]:
        ids = {object_id for scene_id in self.scene_ids for object_id in self.scene(scene_id).object_ids}
        return tuple(sorted(ids, key=int))

    def scene(self, scene_id: int, masks: MaskKind = "visib") -> BopScene:
        require("scene", scene_id, self.scene_ids, self.name)
        if (scene_id, masks) not in self._scenes:
            self._scenes[scene_id, masks] = BopScene(self._path, scene_id, masks)
        return self._scenes[scene_id, masks]

    def image_ids(self, scene_id: int) -> Sequence[int]:
        return self.scene(scene_id).image_ids

    def targets(self, scene_id: int) -> list[Target]:
        scene = self.scene(scene_id)
        seen = {
            (scene.image_ids[sighting.index], int(object_id)): sighting
            for object_id in scene.object_ids
            for sighting in scene.sightings(object_id)
        }
        if self._listed is None:
            wanted = [key for key, sighting in seen.items() if sighting.visible_fraction >= LEAST_VISIBLE_FRACTION]
        else:
            wanted = self._listed.get(scene_id, [])
        return [_target(scene, image_id, number, seen) for image_id, number in sorted(wanted)]

    def model(self, object_id: str) -> ObjectModel:
        folder = self._beside(*MODEL_FOLDERS)
        if folder is None:
            raise SourceError(f"{self.name}: there is no folder {' or '.join(MODEL_FOLDERS)}, which scoring needs")
        info = read_json(folder / "models_info.json")
        numbers = sorted(int(file.stem[4:]) for file in folder.glob("obj_*.ply") if file.stem[4:].isdigit())
        require("model in " + str(folder), object_id, [str(number) for number in numbers], self.name)
        try:
            entry = info[object_id]
            diameter_m = float(entry["diameter"]) / 1000
            symmetries = ObjectSymmetries.from_models_info(entry)
            declared = any(key.startswith("symmetries_") for other in info.values() for key in other)
        except DAMAGE as error:
            raise SourceError(f"{folder}/models_info.json: object {object_id}: {error!r}") from error
        points_m, triangles = _read_mesh(folder / f"obj_{int(object_id):06d}.ply")
        _check_units(folder, object_id, points_m, diameter_m)
        return ObjectModel(points_m, diameter_m, not symmetries.trivial if declared else None, symmetries, triangles)

    def number(self, object_id: str) -> int:
        if not object_id.isdecimal():
            raise SourceError(f"{self.name}: objects are called by number, got {object_id!r}")
        return int(object_id)

    def object_with(self, number: int) -> str:
        return str(number)

    def _targets_file(self) -> Path | None:
        """The list is the test split's alone: a training split may have scenes of the same numbers."""
        is_test = (self._path / "test").is_dir() or self._path.resolve().name.startswith("test")
        return self._beside(TARGETS_FILE) if is_test else None

    def _beside(self, *names: str) -> Path | None:
        """The first of the names that the dataset has."""
        candidates = (folder / name for folder in (self._path, self._path.resolve().parent) for name in names)
        return next((path for path in candidates if path.exists()), None)


def _target(scene: BopScene, image_id: int, number: int, seen: dict[tuple[int, int], Sighting]) -> Target:
    sighting = seen.get((image_id, number))
    if sighting is None:
        raise SourceError(f"{TARGETS_FILE}: {scene.name} has no pose of object {number} in image {image_id}")
    visible = sighting.visible_px, sighting.visible_fraction
    return Target(sighting.index, image_id, str(number), sighting.T_cam_obj, *visible)


def _read_targets(path: Path | None) -> dict[int, list[tuple[int, int]]] | None:
    """Scene -> (image, object) to be estimated; None without a file."""
    if path is None:
        return None
    targets: dict[int, set[tuple[int, int]]] = {}
    several = 0
    try:
        for entry in read_json(path):
            targets.setdefault(int(entry["scene_id"]), set()).add((int(entry["im_id"]), int(entry["obj_id"])))
            several += int(entry.get("inst_count", 1)) > 1
    except DAMAGE as error:
        raise SourceError(f"{path}: not a list of scene_id, im_id, obj_id and inst_count ({error!r})") from error
    if several:
        log.warning("%s: %d targets have several instances of the object; only the first is scored", path, several)
    return {scene_id: list(pairs) for scene_id, pairs in targets.items()}


def _read_mesh(path: Path) -> tuple[Floats, npt.NDArray[np.integer] | None]:
    """(N, 3) metres: the vertices as the file has them, none merged and none split at texture seams; and (M, 3) indices
    of its triangles, None where it has none."""
    import trimesh

    try:
        mesh = trimesh.load(path, process=False, fix_texture=False, skip_materials=True)
        points_m = np.asarray(getattr(mesh, "vertices", ()), np.float64) / 1000
        triangles = np.asarray(getattr(mesh, "faces", ()), np.int64).reshape(-1, 3)
    except Exception as error:  # the parser raises what it stumbles over
        raise SourceError(f"{path}: not a PLY file that can be read ({error!r})") from error
    if points_m.shape[1:] != (3,) or not len(points_m) or not np.isfinite(points_m).all():
        raise SourceError(f"{path}: expected finite vertices, got shape {points_m.shape}")
    return points_m, triangles if len(triangles) else None


def _check_units(folder: Path, object_id: str, points_m: Floats, diameter_m: float) -> None:
    """Raises SourceError where the model and its entry cannot both be in millimetres."""
    diagonal_m = float(np.linalg.norm(np.ptp(points_m, axis=0)))
    # The diagonal of the box is 1 to sqrt(3) diameters; resampled models lose a little.
    if not 0.9 * diameter_m < diagonal_m < 1.9 * diameter_m or diameter_m < 1e-3:
        raise SourceError(
            f"{folder}: object {object_id}: diameter {diameter_m * 1000:g} mm in models_info.json, bounding box "
            f"{diagonal_m * 1000:g} mm across in the PLY file; both are in millimetres"
        )
