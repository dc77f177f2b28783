"""YCBInEOAT, and any folder of sequences of one object each in the layout of BundleTrack and FoundationPose.

    PATH/SEQUENCE/{rgb/, depth/, gt_mask/ or masks/, annotated_poses/, cam_K.txt}   as `tracker.sources.folder` reads it
                  mesh/*.obj (metres; optional)
         models/NAME/ or CADmodels/NAME/{points.xyz, textured*.obj} (metres): YCB-Video's models

PATH may be the folder of a single sequence. https://github.com/wenbowen123/iros20-6d-pose-tracking
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from eval.datasets import MaskKind, ObjectModel, Target, number_of, require, require_visible_masks
from eval.datasets.model_files import read_model
from eval.datasets.ycb_objects import YCB_VIDEO_CLASSES, YCB_VIDEO_FRAME, is_symmetric, shape_files
from tracker.errors import SourceError
from tracker.sources.folder import Folder

MODEL_FOLDERS = ("models", "CADmodels")
# The benchmark's nine sequences are called after what is moved in them ("cracker_box_yalehand0").
OBJECT_OF = {
    "bleach": "021_bleach_cleanser",
    "cracker_box": "003_cracker_box",
    "mustard": "006_mustard_bottle",
    "sugar_box": "004_sugar_box",
    "tomato_soup_can": "005_tomato_soup_can",
}


class YcbInEoatDataset:
    """Scenes are numbered from 1 in the order of the sequences' names, images by position.

    An object of YCB has its name and class number; that of another sequence is called as the sequence, and numbered
    after those. Raises SourceError where the folder holds no sequence.
    """

    def __init__(self, path: str | Path) -> None:
        self.name = f"ycbineoat:{path}"
        self.model_frame = f"{YCB_VIDEO_FRAME}; of a sequence with its own mesh, that mesh's"
        self._path = Path(path)
        self._sequences = sorted({file.parent for at in ("", "*/") for file in self._path.glob(f"{at}cam_K.txt")})
        if not self._sequences:
            raise SourceError(f"{self.name}: no sequence (a folder with cam_K.txt) in {path}")
        self.scene_ids = tuple(range(1, len(self._sequences) + 1))
        self._objects = [_object_in(sequence) for sequence in self._sequences]
        self.object_ids = tuple(sorted(set(self._objects)))
        listed = ", ".join(f"{i} {folder.resolve().name}" for i, folder in enumerate(self._sequences, start=1))
        self.target_rule = f"every frame with an annotated pose; scenes: {listed}"
        self._scenes: dict[int, Folder] = {}

    def scene(self, scene_id: int, masks: MaskKind = "visib") -> Folder:
        require("scene", scene_id, self.scene_ids, self.name)
        require_visible_masks(masks, self.name)
        if scene_id not in self._scenes:
            sequence = self._sequences[scene_id - 1]
            name = f"{self.name}:{sequence.resolve().name}"
            self._scenes[scene_id] = Folder(sequence, self._objects[scene_id - 1], name)
        return self._scenes[scene_id]

    def image_ids(self, scene_id: int) -> Sequence[int]:
        return range(len(self.scene(scene_id)))

    def targets(self, scene_id: int) -> list[Target]:
        """Of a frame without a mask nothing is known to be visible."""
        scene = self.scene(scene_id)
        if not scene.object_ids:
            raise SourceError(f"{scene.name}: no folder annotated_poses, which scoring needs")
        targets = []
        for index in range(len(scene)):
            T_cam_obj = scene.pose(index)
            if T_cam_obj is not None:
                px = scene.visible_px(index) or 0
                targets.append(Target(index, index, scene.object_id, T_cam_obj, px, 1.0 if px else 0.0))
        return targets

    def model(self, object_id: str) -> ObjectModel:
        """YCB's own shape where it is there, else the mesh of the object's first sequence that has one."""
        require("object", object_id, self.object_ids, self.name)
        candidates = [file for name in MODEL_FOLDERS for file in shape_files(self._path / name, object_id)]
        for sequence, name in zip(self._sequences, self._objects, strict=True):
            if name == object_id:
                candidates += sorted((sequence / "mesh").glob("*.obj")) or [sequence / "mesh" / "*.obj"]
        return read_model(candidates, is_symmetric(object_id))

    def number(self, object_id: str) -> int:
        require("object", object_id, self.object_ids, self.name)
        return number_of(object_id, self._numbered, self.name)

    def object_with(self, number: int) -> str:
        numbers = {self.number(object_id): object_id for object_id in self.object_ids}
        require("object number", number, sorted(numbers), self.name)
        return numbers[number]

    @property
    def _numbered(self) -> tuple[str, ...]:
        return (*YCB_VIDEO_CLASSES, *(name for name in self.object_ids if name not in YCB_VIDEO_CLASSES))


def _object_in(sequence: Path) -> str:
    name = sequence.resolve().name
    return next((ycb for start, ycb in OBJECT_OF.items() if name.startswith(start)), name)
