"""NOCS REAL275, with ground truth as text.

    PATH/real_test/scene_N/FFFF_{color.png, depth.png (millimetres), mask.png, meta.txt}
         gts/real_test_text/scene_N/model_NAME/FFFF.txt
         obj_models/real_test/NAME.obj (metres), NAME.txt (its size along x, y, z in metres; optional)

A line of meta.txt is INSTANCE CLASS NAME; the mask holds instances, 255 is the background; class 0 is a bystander.
PATH may be the folder real_test itself; Real/test and real/test are found too.

NOCS's own ground truth (gts/real_test/*.pkl) is pickled, and a pickle runs what it holds: it is never read here. The
text form is that of BundleTrack's authors, https://github.com/wenbowen123/BundleTrack (the addon of its README): a 4x4
matrix, camera <- object, metres, OpenCV's axes. An entry of the pickles' `gt_RTs`, saved as text, serves as well: NOCS
multiplies the rotation by the size of the object, which is left out here, as the models have their size.
https://github.com/hughw19/NOCS_CVPR2019
"""

from __future__ import annotations

import logging
import re
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from eval.datasets import MaskKind, ObjectModel, Target, name_of, number_of, require, require_visible_masks
from eval.datasets.labelled_scene import Annotation, ImageFiles, LabelledScene
from eval.datasets.model_files import read_model
from tracker.errors import SourceError
from tracker.sources.text_files import is_whole, read_lines, read_numbers, read_pose, require_plain_name

log = logging.getLogger(__name__)

K = np.array([[591.0125, 0.0, 322.525], [0.0, 590.16775, 244.11084], [0.0, 0.0, 1.0]])  # of REAL275, not of CAMERA
METRES_PER_UNIT = 0.001
SPLIT_FOLDERS = ("real_test", "Real/test", "real/test", ".")
TEXT_POSES = "gts/real_test_text"
BACKGROUND = 255
CLASSES = ("bystander", "bottle", "bowl", "camera", "can", "laptop", "mug")
SYMMETRIC_CLASSES = ("bottle", "bowl", "can")  # about their axis, in NOCS's evaluation; a mug only without its handle


class NocsDataset:
    """Its scenes by number. Objects are called by the names of their models; an object's number is its place, from 1,
    in the sorted names of all that are in the scenes.

    Raises SourceError where the folder holds no scene.
    """

    def __init__(self, path: str | Path) -> None:
        self.name = f"nocs:{path}"
        self.model_frame = "the dataset's own (NOCS's axes, centred on the bounding box), in true size"
        self.target_rule = "every frame and instance with a masked pixel and a pose"
        self._path = Path(path)
        folders = [folder for folder in (self._path / name for name in SPLIT_FOLDERS) if any(folder.glob("scene_*"))]
        self._scene_folders = {
            int(match[1]): file
            for file in (folders[0].iterdir() if folders else ())
            if (match := re.fullmatch(r"scene_(\d+)", file.name))
        }
        if not self._scene_folders:
            raise SourceError(f"{self.name}: no scene (a folder scene_N) in {path}/{', '.join(SPLIT_FOLDERS)}")
        self.scene_ids = tuple(sorted(self._scene_folders))
        self._scenes: dict[int, LabelledScene] = {}

    @property
    def object_ids(self) -> tuple[str, ...]:
        return tuple(sorted(self._classes))

    def scene(self, scene_id: int, masks: MaskKind = "visib") -> LabelledScene:
        require("scene", scene_id, self.scene_ids, self.name)
        require_visible_masks(masks, self.name)
        if scene_id not in self._scenes:
            images = _image_files(self._scene_folders[scene_id])
            poses = self._beside(TEXT_POSES) / f"scene_{scene_id}"
            self._scenes[scene_id] = LabelledScene(
                f"{self.name}:{scene_id}",
                images,
                lambda image_id: _read_annotation(images[image_id].annotation, poses, image_id),
                packed_depth=True,
            )
        return self._scenes[scene_id]

    def image_ids(self, scene_id: int) -> Sequence[int]:
        return self.scene(scene_id).image_ids

    def targets(self, scene_id: int) -> list[Target]:
        scene = self.scene(scene_id)
        lacking = sum(len(a.labels) - len(a.poses) for a in map(scene.annotation, range(len(scene))))
        if lacking:
            log.warning("%s: %d instances have no file of their pose and are no targets", scene.name, lacking)
        return scene.targets(range(len(scene)), least_px=1)

    def category(self, object_id: str) -> str:
        """The class that meta.txt gives the object, whatever it is called."""
        require("object", object_id, self.object_ids, self.name)
        return CLASSES[self._classes[object_id]]

    def model(self, object_id: str) -> ObjectModel:
        symmetric = self.category(object_id) in SYMMETRIC_CLASSES
        file = self._beside("obj_models/real_test") / f"{object_id}.obj"
        model = read_model([file], symmetric)
        if file.with_suffix(".txt").exists():
            size_m, found_m = read_numbers(file.with_suffix(".txt"), 3), np.ptp(model.points_m, axis=0)
            if not np.allclose(size_m, found_m, rtol=0.1, atol=0.005):
                raise SourceError(
                    f"{file}: its vertices span {np.round(found_m, 3)}, the text beside it says {np.round(size_m, 3)}; "
                    "both are in metres"
                )
        return model

    def number(self, object_id: str) -> int:
        return number_of(object_id, self.object_ids, self.name)

    def object_with(self, number: int) -> str:
        return name_of(number, self.object_ids, self.name)

    @cached_property
    def _classes(self) -> dict[str, int]:
        """Object -> its class, of all scenes."""
        classes: dict[str, int] = {}
        for scene_id in self.scene_ids:
            for files in _image_files(self._scene_folders[scene_id]).values():
                classes |= {name: class_id for name, (_, class_id) in _read_meta(files.annotation).items()}
        return classes

    def _beside(self, name: str) -> Path:
        """In the folder of the dataset, also where PATH is the folder of its scenes."""
        folders = (self._path, self._path.resolve().parent)
        return next((folder / name for folder in folders if (folder / name).exists()), self._path / name)


def _image_files(folder: Path) -> dict[int, ImageFiles]:
    """By image id, of every image with a color.png."""
    images = {}
    for rgb in sorted(folder.glob("*_color.png")):
        stem = rgb.name.removesuffix("_color.png")
        if stem.isdecimal():
            depth, labels, meta = (folder / f"{stem}_{what}" for what in ("depth.png", "mask.png", "meta.txt"))
            images[int(stem)] = ImageFiles(rgb, depth, labels, meta)
    if not images:
        raise SourceError(f"{folder}: no image (FFFF_color.png)")
    return images


def _read_annotation(meta: Path, poses: Path, image_id: int) -> Annotation:
    instances = _read_meta(meta)
    for name in instances:
        if not (poses / f"model_{name}").is_dir():
            raise SourceError(
                f"{poses}: no folder model_{name}; expected {TEXT_POSES}/scene_N/model_NAME/FFFF.txt, each a 4x4 "
                "matrix, camera <- object in metres (the text form of BundleTrack); the pickles of NOCS are not read"
            )
    files = {name: poses / f"model_{name}" / f"{image_id:04d}.txt" for name in instances}
    return Annotation(
        K=K,
        metres_per_unit=METRES_PER_UNIT,
        labels={name: instance for name, (instance, _) in instances.items()},
        poses={name: read_pose(file, scaled=True) for name, file in files.items() if file.exists()},
    )


def _read_meta(path: Path) -> dict[str, tuple[int, int]]:
    """Object -> (instance, class), without bystanders; of an object that occurs twice the first."""
    instances: dict[str, tuple[int, int]] = {}
    for words in map(str.split, read_lines(path)):
        if len(words) != 3 or not is_whole(words[0]) or not is_whole(words[1]):
            raise SourceError(f"{path}: expected lines INSTANCE CLASS NAME, got {' '.join(words)[:60]!r}")
        instance, class_id = int(words[0]), int(words[1])
        if instance >= BACKGROUND or class_id >= len(CLASSES):
            raise SourceError(f"{path}: instances are below {BACKGROUND}, classes below {len(CLASSES)}, got {words}")
        require_plain_name(words[2], str(path))
        if class_id:
            instances.setdefault(words[2], (instance, class_id))
    return instances
