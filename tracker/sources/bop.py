"""A scene of a dataset in BOP's layout.

    PATH/SPLIT/SSSSSS/rgb/IIIIII.{png,jpg}  depth/IIIIII.png  mask_visib/IIIIII_GGGGGG.png
                      mask/IIIIII_GGGGGG.png (optional: whole silhouettes, also where something hides them)
                      scene_camera.json  scene_gt.json  scene_gt_info.json

GGGGGG is the position in the image's list of scene_gt.json, not an object id. Camera matrix and depth scale are an
image's own. Millimetres end here. https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tracker.errors import FrameError, SourceError
from tracker.frame import Frame, Mask, Provenance
from tracker.geometry import Intrinsics, Pose
from tracker.sources import Sighting, require_object
from tracker.sources.image_files import read_depth_m, read_mask, read_rgb
from tracker.sources.json_files import DAMAGE, read_json
from tracker.sources.raw_depth import metres_per_unit
from tracker.sources.text_files import is_whole

NOMINAL_RATE_HZ = 30.0  # the layout has no stamps
MASK_FOLDERS = {"visib": "mask_visib", "full": "mask"}


class BopScene:
    """Frames, masks and poses of one scene. Where an object occurs twice in an image, its first entry counts.

    path: the dataset, or the folder of a split. masks: which of the layout's mask folders a frame's masks are from.
    Raises SourceError where a file is missing or damaged, and where full masks are asked for and there are none.
    """

    def __init__(self, path: str | Path, scene_id: int, masks: Literal["visib", "full", "none"] = "visib") -> None:
        self.name = f"bop:{path}:{scene_id}"
        self.scene_id = scene_id
        self._folder = find_scene(Path(path), scene_id)
        self._mask_folder = {**MASK_FOLDERS, "none": None}[masks]
        if masks == "full":
            self._require_full_masks()
        self._cameras = _by_image(self._folder / "scene_camera.json")
        truth = self._folder / "scene_gt.json"
        self._truth = _objects_by_image(truth) if truth.exists() else {}
        info = self._folder / "scene_gt_info.json"
        self._info = _by_image(info) if info.exists() else {}
        self.image_ids = sorted(self._cameras)
        if not self.image_ids:
            raise SourceError(f"{self._folder / 'scene_camera.json'} lists no image")

    def __len__(self) -> int:
        return len(self.image_ids)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        image_id = self.image_ids[index]
        try:
            scale = float(self._cameras[image_id]["depth_scale"])
        except DAMAGE as error:
            raise SourceError(f"{self._folder}/scene_camera.json: image {image_id}: {error!r}") from error
        unit_m = metres_per_unit("bop", f"{self._folder}/scene_camera.json: image {image_id}", scale)
        rgb = read_rgb(self._image_file("rgb", image_id))
        return Frame(
            rgb=rgb,
            depth_m=read_depth_m(self._image_file("depth", image_id), unit_m),
            intrinsics=self._intrinsics(image_id, rgb.shape[1], rgb.shape[0]),
            stamp_ns=round(image_id * 1e9 / NOMINAL_RATE_HZ),
            masks=self._masks(image_id),
            index=index,
            provenance=self._provenance(image_id, unit_m),
        )

    def _provenance(self, image_id: int, unit_m: float) -> Provenance:
        where, place = f"{self.name} image {image_id}", (self.scene_id, image_id)
        return Provenance(where, "nominal", 0, unit_m, f"{image_id:06d}", place)

    def camera(self, index: int) -> Intrinsics:
        """Of a frame, whose pictures are not read: they have the size of the scene's first one, as in all of BOP's."""
        width, height = self._picture_size
        return self._intrinsics(self.image_ids[index], width, height)

    @cached_property
    def _picture_size(self) -> tuple[int, int]:
        height, width = read_rgb(self._image_file("rgb", self.image_ids[0])).shape[:2]
        return width, height

    def _intrinsics(self, image_id: int, width: int, height: int) -> Intrinsics:
        where = f"{self._folder}/scene_camera.json: image {image_id}"
        try:
            return Intrinsics.from_matrix(np.reshape(self._cameras[image_id]["cam_K"], (3, 3)), width, height)
        except DAMAGE as error:
            raise SourceError(f"{where}: {error!r}") from error
        except FrameError as error:
            raise FrameError(f"{where}: {error}") from error

    @property
    def object_ids(self) -> tuple[str, ...]:
        ids = {int(entry["obj_id"]) for entries in self._truth.values() for entry in entries}
        return tuple(str(i) for i in sorted(ids))

    def sightings(self, object_id: str) -> Sequence[Sighting]:
        """Where the object is, in every image that lists it, also where no pixel of it can be seen."""
        require_object(self, object_id)
        return [s for index, image_id in enumerate(self.image_ids) if (s := self._sighting(index, image_id, object_id))]

    def _sighting(self, index: int, image_id: int, object_id: str) -> Sighting | None:
        place = self._place(image_id, object_id)
        if place is None:
            return None
        where = f"image {image_id}, object {object_id}"
        try:
            entry = self._truth[image_id][place]
            matrix = np.eye(4)
            matrix[:3, :3] = np.reshape(entry["cam_R_m2c"], (3, 3))
            matrix[:3, 3] = np.asarray(entry["cam_t_m2c"], float) / 1000
            T_cam_obj = Pose.from_matrix(matrix)
        except (*DAMAGE, FrameError) as error:
            raise SourceError(f"{self._folder}/scene_gt.json: {where}: {error!r}") from error
        if not self._info:
            visible_px = int(self._read_mask("mask_visib", image_id, place).sum())
            return Sighting(index, T_cam_obj, visible_px, 1.0 if visible_px else 0.0)
        try:
            info = self._info[image_id][place]
            visible_px, visible_fraction = int(info["px_count_visib"]), float(info["visib_fract"])
            if visible_px < 0 or not 0 <= visible_fraction < np.inf:
                raise ValueError(f"{visible_px} visible pixels, {visible_fraction} of the object")
            return Sighting(index, T_cam_obj, visible_px, visible_fraction)
        except DAMAGE as error:
            raise SourceError(f"{self._folder}/scene_gt_info.json: {where}: {error!r}") from error

    def _require_full_masks(self) -> None:
        """Frames without masks are no error, as a tracker may find the object itself; but whoever asks for these would
        take frames without them for frames in which nothing is to be seen."""
        if not (self._folder / MASK_FOLDERS["full"]).is_dir():
            present = [f"{kind} ({name}/)" for kind, name in MASK_FOLDERS.items() if (self._folder / name).is_dir()]
            raise SourceError(
                f"{self.name} has no full masks (a folder {MASK_FOLDERS['full']}/ in {self._folder}); "
                f"it has {', '.join(present) or 'none'}"
            )

    def _place(self, image_id: int, object_id: str) -> int | None:
        """Position of the object in the image's list."""
        entries = self._truth.get(image_id, [])
        return next((i for i, entry in enumerate(entries) if str(entry["obj_id"]) == object_id), None)

    def _masks(self, image_id: int) -> dict[str, Mask]:
        if self._mask_folder is None or not (self._folder / self._mask_folder).is_dir():
            return {}
        masks: dict[str, Mask] = {}
        for place, entry in enumerate(self._truth.get(image_id, [])):
            object_id = str(entry["obj_id"])
            if object_id not in masks:
                masks[object_id] = self._read_mask(self._mask_folder, image_id, place)
        return masks

    def _read_mask(self, folder: str, image_id: int, place: int) -> Mask:
        return read_mask(self._folder / folder / f"{image_id:06d}_{place:06d}.png")

    def _image_file(self, folder: str, image_id: int) -> Path:
        candidates = [self._folder / folder / f"{image_id:06d}{suffix}" for suffix in (".png", ".jpg")]
        return next((path for path in candidates if path.exists()), candidates[0])


def find_scene(path: Path, scene_id: int) -> Path:
    """The folder of a scene, in the split `test` where several splits have it. Raises SourceError if none has."""
    name = f"{scene_id:06d}"
    if not path.is_dir():
        raise SourceError(f"{path} is not a folder")
    candidates = (path / "test" / name, path / name, *sorted(path.glob(f"*/{name}")))
    found = [folder for folder in candidates if folder.is_dir()]
    if not found:
        raise SourceError(f"{path} has no scene {scene_id}; it has {', '.join(map(str, scene_ids(path))) or 'none'}")
    return found[0]


def scene_ids(path: Path) -> list[int]:
    """Numbers of the scenes under a dataset or split, of the split `test` where there is one."""
    root = path / "test" if (path / "test").is_dir() else path
    return sorted({int(file.parent.name) for file in root.rglob("scene_camera.json") if file.parent.name.isdigit()})


def _by_image(path: Path) -> dict[int, Any]:
    """A JSON object keyed by image id. Raises SourceError that names the file and the place of the damage."""
    content = read_json(path)
    if not isinstance(content, dict) or not all(is_whole(key) for key in content):
        raise SourceError(f"{path}: not the JSON that BOP's layout has there, whose keys are the numbers of images")
    return {int(key): value for key, value in content.items()}


def _objects_by_image(path: Path) -> dict[int, list[dict[str, Any]]]:
    """The lists of scene_gt.json, every entry of which has the number of an object."""
    content = _by_image(path)
    for image_id, entries in content.items():
        try:
            [int(entry["obj_id"]) for entry in entries]
        except DAMAGE as error:
            raise SourceError(f"{path}: image {image_id} has no list of objects with an obj_id ({error!r})") from error
    return content
