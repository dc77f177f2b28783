"""A folder of pictures as FoundationPose reads it.

    PATH/rgb/NAME.{png,jpg}  depth/NAME.png (millimetres)  cam_K.txt
         gt_mask/ or masks/NAME.png  annotated_poses/NAME.txt (camera <- object, metres; both optional, for one object)

Masks and poses that are called otherwise than the pictures belong to them by order, if there are as many.

Stamps are read from file names that are Unix times (19 digits: nanoseconds, 16: microseconds); others are counted at a
nominal rate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from tracker.errors import FrameError, SourceError
from tracker.frame import Frame, Mask, Provenance
from tracker.geometry import Intrinsics, Pose
from tracker.sources import Sighting, require_object
from tracker.sources.image_files import in_order, read_depth_m, read_mask, read_rgb
from tracker.sources.text_files import read_numbers, read_pose

METRES_PER_UNIT = 0.001
NOMINAL_RATE_HZ = 30.0
OBJECT_ID = "object"
MASK_FOLDERS = ("gt_mask", "masks")  # in the order of preference: the first is annotated, not computed
POSE_FOLDER = "annotated_poses"
CLOCK_UNITS_NS = {19: 1, 16: 1_000}  # digits of a Unix time -> its unit


class Folder:
    """Frames of the folder in the order of their names, numbers by value, and its one object.

    name: what the source is called. Raises SourceError where a file that the layout needs is missing or damaged.
    """

    def __init__(self, path: str | Path, object_id: str = OBJECT_ID, name: str | None = None) -> None:
        self._path = Path(path)
        self.object_id = object_id
        self.name = name or f"folder:{path}"
        self._files = in_order(
            p for p in (self._path / "rgb").glob("*") if p.suffix.lower() in (".png", ".jpg", ".jpeg")
        )
        if not self._files:
            raise SourceError(f"{self._path}/rgb has no png or jpg pictures")
        self._K = read_numbers(self._path / "cam_K.txt", 9).reshape(3, 3)
        stems = [p.stem for p in self._files]
        self._stamps_ns = _stamps_ns(stems)
        masks = next((self._path / name for name in MASK_FOLDERS if (self._path / name).is_dir()), self._path / "masks")
        poses = self._path / POSE_FOLDER
        self._mask_files = [masks / f"{stem}.png" for stem in _beside(masks, ".png", stems)]
        self._pose_files = [poses / f"{stem}.txt" for stem in _beside(poses, ".txt", stems)]

    def __len__(self) -> int:
        return len(self._files)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        stem = self._files[index].stem
        rgb = read_rgb(self._files[index])
        mask = self._mask(index)
        stamp_ns, clock = self._stamps_ns[index]
        try:
            intrinsics = Intrinsics.from_matrix(self._K, rgb.shape[1], rgb.shape[0])
        except FrameError as error:
            raise FrameError(f"{self._path}/cam_K.txt: {error}") from error
        return Frame(
            rgb=rgb,
            depth_m=read_depth_m(self._path / "depth" / f"{stem}.png", METRES_PER_UNIT),
            intrinsics=intrinsics,
            stamp_ns=stamp_ns,
            masks={} if mask is None else {self.object_id: mask},
            index=index,
            provenance=Provenance(f"{self.name} {stem}", clock, 0, METRES_PER_UNIT, stem),
        )

    @property
    def object_ids(self) -> tuple[str, ...]:
        return (self.object_id,) if (self._path / POSE_FOLDER).is_dir() else ()

    def pose(self, index: int) -> Pose | None:
        """T_cam_obj in a frame; None where there is no file of it."""
        return read_pose(self._pose_files[index]) if self._pose_files[index].exists() else None

    def visible_px(self, index: int) -> int | None:
        """Pixels of the object in a frame; None where it has no mask."""
        mask = self._mask(index)
        return None if mask is None else int(mask.sum())

    def sightings(self, object_id: str) -> Sequence[Sighting]:
        """The frames that have both a pose and a mask."""
        require_object(self, object_id)
        found = []
        for index in range(len(self)):
            T_cam_obj, visible_px = self.pose(index), self.visible_px(index)
            if T_cam_obj is not None and visible_px is not None:
                found.append(Sighting(index, T_cam_obj, visible_px, 1.0 if visible_px else 0.0))
        return found

    def _mask(self, index: int) -> Mask | None:
        return read_mask(self._mask_files[index]) if self._mask_files[index].exists() else None


def _beside(folder: Path, suffix: str, stems: list[str]) -> list[str]:
    """Names, without suffix, of the files in the folder that belong to the pictures `stems`.

    Where no file is called like a picture and there are as many, they belong together by order: poses of YCBInEOAT are
    counted, its pictures have times. Raises SourceError where neither holds.
    """
    found = [path.stem for path in in_order(folder.glob(f"*{suffix}"))]
    if not found or set(found) & set(stems):
        return stems
    if len(found) != len(stems):
        raise SourceError(
            f"{folder} has {len(found)} files {found[0]}{suffix} .. {found[-1]}{suffix}, expected the names of the "
            f"{len(stems)} pictures ({stems[0]} .. {stems[-1]}) or as many files"
        )
    return found


def _stamps_ns(stems: list[str]) -> list[tuple[int, str]]:
    """Stamp and its clock for every file: the names where all are times of one unit, else the position."""
    unit_ns = CLOCK_UNITS_NS.get(len(stems[0]))
    if unit_ns and all(stem.isdecimal() and len(stem) == len(stems[0]) for stem in stems):
        return [(int(stem) * unit_ns, "recording") for stem in stems]
    return [(round(i * 1e9 / NOMINAL_RATE_HZ), "nominal") for i in range(len(stems))]
