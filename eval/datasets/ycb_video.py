"""YCB-Video in its own layout, as PoseCNN's authors released it.

    PATH/data/SSSS/FFFFFF-{color.jpg or .png, depth.png, label.png, meta.mat}
         keyframe.txt or image_sets/keyframe.txt (lines SSSS/FFFFFF)  image_sets/classes.txt (a name a line)
         models/NAME/{points.xyz, textured.obj} (metres)

meta.mat: intrinsic_matrix (3, 3), factor_depth (units of the depth picture in a metre), cls_indexes (N), class numbers
from 1, and poses (3, 4, N), camera <- object in metres. A label is a class number. https://arxiv.org/abs/1711.00199
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from eval.datasets import MaskKind, ObjectModel, Target, name_of, number_of, require, require_visible_masks
from eval.datasets.labelled_scene import Annotation, ImageFiles, LabelledScene
from eval.datasets.mat_file import read_arrays
from eval.datasets.model_files import read_model
from eval.datasets.ycb_objects import YCB_VIDEO_CLASSES, YCB_VIDEO_FRAME, is_symmetric, shape_files
from tracker.errors import FrameError, SourceError
from tracker.geometry import Pose
from tracker.sources.raw_depth import metres_per_unit
from tracker.sources.text_files import read_lines, require_plain_name

META_FIELDS = ("intrinsic_matrix", "factor_depth", "cls_indexes", "poses")
KEYFRAME_FILES = ("keyframe.txt", "image_sets/keyframe.txt")


class YcbVideoDataset:
    """The sequences that have keyframes, all of them where there is no list of keyframes. Objects are called by their
    class names, their numbers are the class numbers.

    Raises SourceError where the folder holds no sequence or one of its lists is damaged.
    """

    def __init__(self, path: str | Path) -> None:
        self.name = f"ycb-video:{path}"
        self.model_frame = YCB_VIDEO_FRAME
        self._path = Path(path)
        self.object_ids = _read_classes(self._path / "image_sets" / "classes.txt")
        file = next((self._path / name for name in KEYFRAME_FILES if (self._path / name).exists()), None)
        self._keyframes = None if file is None else _read_keyframes(file)
        every = f"every frame and object with a labelled pixel (there is no {KEYFRAME_FILES[0]})"
        self.target_rule = every if file is None else f"{file.relative_to(self._path)}, every object in these frames"
        present = [int(p.name) for p in (self._path / "data").glob("*") if re.fullmatch(r"\d{4}", p.name)]
        self.scene_ids = tuple(sorted(s for s in present if self._keyframes is None or s in self._keyframes))
        if not self.scene_ids:
            listed = "" if self._keyframes is None else f" that {file} has keyframes of"
            raise SourceError(f"{self.name}: no sequence (a folder SSSS){listed} in {self._path}/data")
        self._scenes: dict[int, LabelledScene] = {}

    def scene(self, scene_id: int, masks: MaskKind = "visib") -> LabelledScene:
        require("scene", scene_id, self.scene_ids, self.name)
        require_visible_masks(masks, self.name)
        if scene_id not in self._scenes:
            images = _image_files(self._path / "data" / f"{scene_id:04d}")
            self._scenes[scene_id] = LabelledScene(
                f"{self.name}:{scene_id}", images, lambda i: _read_annotation(images[i].annotation, self.object_ids)
            )
        return self._scenes[scene_id]

    def image_ids(self, scene_id: int) -> Sequence[int]:
        return self.scene(scene_id).image_ids

    def targets(self, scene_id: int) -> list[Target]:
        scene = self.scene(scene_id)
        if self._keyframes is None:
            return scene.targets(range(len(scene)), least_px=1)
        positions = {image_id: index for index, image_id in enumerate(scene.image_ids)}
        missing = [image_id for image_id in self._keyframes[scene_id] if image_id not in positions]
        if missing:
            raise SourceError(f"{scene.name} lacks {len(missing)} keyframes, the first is image {missing[0]}")
        return scene.targets([positions[image_id] for image_id in self._keyframes[scene_id]], least_px=0)

    def model(self, object_id: str) -> ObjectModel:
        require("object", object_id, self.object_ids, self.name)
        return read_model(shape_files(self._path / "models", object_id), is_symmetric(object_id))

    def number(self, object_id: str) -> int:
        return number_of(object_id, self.object_ids, self.name)

    def object_with(self, number: int) -> str:
        return name_of(number, self.object_ids, self.name)


def _read_classes(path: Path) -> tuple[str, ...]:
    """The names by class number; those of the release where the file is missing."""
    names = tuple(read_lines(path)) if path.exists() else YCB_VIDEO_CLASSES
    if not names or len(set(names)) != len(names):
        raise SourceError(f"{path}: expected a name a line, each once, got {len(names)} lines")
    for name in names:
        require_plain_name(name, str(path))
    return names


def _read_keyframes(path: Path) -> dict[int, list[int]]:
    """Scene -> image ids in increasing order."""
    keyframes: dict[int, set[int]] = {}
    for line in read_lines(path):
        match = re.fullmatch(r"(\d{4})/(\d{6})", line)
        if match is None:
            raise SourceError(f"{path}: expected lines like 0048/000001, got {line[:40]!r}")
        keyframes.setdefault(int(match[1]), set()).add(int(match[2]))
    return {scene_id: sorted(image_ids) for scene_id, image_ids in keyframes.items()}


def _image_files(folder: Path) -> dict[int, ImageFiles]:
    """By image id, of every image that has a meta.mat."""
    images = {}
    for meta in sorted(folder.glob("*-meta.mat")):
        stem = meta.name.removesuffix("-meta.mat")
        if stem.isdecimal():
            color = [folder / f"{stem}-color{suffix}" for suffix in (".jpg", ".png")]
            rgb = next((path for path in color if path.exists()), color[0])
            images[int(stem)] = ImageFiles(rgb, folder / f"{stem}-depth.png", folder / f"{stem}-label.png", meta)
    if not images:
        raise SourceError(f"{folder}: no image (FFFFFF-meta.mat)")
    return images


def _read_annotation(path: Path, names: Sequence[str]) -> Annotation:
    meta = _read_meta(path)
    classes = meta["cls_indexes"].ravel()
    factor = meta["factor_depth"].ravel()
    poses = meta["poses"]
    if poses.ndim == 2:  # MATLAB has no third dimension of one
        poses = poses[:, :, None]
    _check(path, "intrinsic_matrix", meta["intrinsic_matrix"].shape == (3, 3), "3x3", meta)
    _check(path, "factor_depth", len(factor) == 1 and factor[0] > 0, "one positive number", meta)
    known = np.isin(classes, np.arange(1, len(names) + 1)).all() and len(set(classes.tolist())) == len(classes)
    _check(path, "cls_indexes", bool(known), f"class numbers from 1 to {len(names)}, each once", meta)
    _check(path, "poses", poses.shape == (3, 4, len(classes)), f"3x4x{len(classes)}, a matrix a class", meta)
    numbers = {names[int(number) - 1]: int(number) for number in classes}
    try:
        T_cam_obj = [Pose.from_matrix(poses[:, :, k]) for k in range(len(classes))]
    except FrameError as error:
        raise SourceError(f"{path}: field poses: {error}") from error
    return Annotation(
        K=meta["intrinsic_matrix"].astype(np.float64),
        metres_per_unit=metres_per_unit("ycb-video", str(path), float(factor[0])),
        labels=numbers,
        poses=dict(zip(numbers, T_cam_obj, strict=True)),
    )


def _read_meta(path: Path) -> dict[str, npt.NDArray]:
    """The fields that are used, each an array of numbers."""
    meta = read_arrays(path, META_FIELDS)
    for name in META_FIELDS:
        if name not in meta:
            raise SourceError(f"{path}: field {name} is missing; expected {', '.join(META_FIELDS)}")
        _check(path, name, bool(np.isfinite(meta[name]).all()), "finite numbers", meta)
    return meta


def _check(path: Path, name: str, right: bool, expected: str, meta: dict[str, npt.NDArray]) -> None:
    if not right:
        got = np.array2string(meta[name], threshold=12, separator=",").replace("\n", "")
        raise SourceError(f"{path}: field {name}: expected {expected}, got shape {meta[name].shape}: {got}")
