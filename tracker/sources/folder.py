"""A folder of pictures as FoundationPose reads it.

    PATH/rgb/NAME.{png,jpg}  depth/NAME.png (millimetres)  cam_K.txt
         masks/NAME.png  annotated_poses/NAME.txt (camera <- object, metres; both optional, for one object)

Stamps are read from file names that are Unix times (19 digits: nanoseconds, 16: microseconds); others are counted at a
nominal rate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from tracker.errors import FrameError, SourceError
from tracker.frame import Frame, Provenance
from tracker.geometry import Intrinsics, Pose
from tracker.sources import Sighting, require_object
from tracker.sources.image_files import read_depth_m, read_mask, read_rgb

METRES_PER_UNIT = 0.001
NOMINAL_RATE_HZ = 30.0
OBJECT_ID = "object"
CLOCK_UNITS_NS = {19: 1, 16: 1_000}  # digits of a Unix time -> its unit


class Folder:
    """Frames of the folder in the order of their names, numbers by value. Its one object is called "object".

    Raises SourceError where a file that the layout needs is missing or damaged.
    """

    object_id = OBJECT_ID

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        self.name = f"folder:{path}"
        files = [p for p in (self._path / "rgb").glob("*") if p.suffix.lower() in (".png", ".jpg", ".jpeg")]
        numbered = all(p.stem.isdecimal() for p in files)
        self._files = sorted(files, key=lambda p: (int(p.stem) if numbered else 0, p.name))
        if not self._files:
            raise SourceError(f"{self._path}/rgb has no png or jpg pictures")
        self._K = _read_numbers(self._path / "cam_K.txt", 9).reshape(3, 3)
        self._stamps_ns = _stamps_ns([p.stem for p in self._files])

    def __len__(self) -> int:
        return len(self._files)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        stem = self._files[index].stem
        rgb = read_rgb(self._files[index])
        mask_file = self._path / "masks" / f"{stem}.png"
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
            masks={OBJECT_ID: read_mask(mask_file)} if mask_file.exists() else {},
            index=index,
            provenance=Provenance(f"{self.name} {stem}", clock, 0, METRES_PER_UNIT),
        )

    @property
    def object_ids(self) -> tuple[str, ...]:
        return (OBJECT_ID,) if (self._path / "annotated_poses").is_dir() else ()

    def sightings(self, object_id: str) -> Sequence[Sighting]:
        """The frames that have both a pose and a mask."""
        require_object(self, object_id)
        found = []
        for index, file in enumerate(self._files):
            pose_file = self._path / "annotated_poses" / f"{file.stem}.txt"
            mask_file = self._path / "masks" / f"{file.stem}.png"
            if pose_file.exists() and mask_file.exists():
                visible_px = int(read_mask(mask_file).sum())
                T_cam_obj = _read_pose(pose_file)
                found.append(Sighting(index, T_cam_obj, visible_px, 1.0 if visible_px else 0.0))
        return found


def _read_numbers(path: Path, count: int) -> np.ndarray:
    try:
        numbers = np.array(path.read_text().split(), float)
    except OSError as error:
        raise SourceError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise SourceError(f"{path}: expected {count} numbers ({error})") from error
    if len(numbers) != count:
        raise SourceError(f"{path}: expected {count} numbers, got {len(numbers)}")
    return numbers


def _read_pose(path: Path) -> Pose:
    try:
        return Pose.from_matrix(_read_numbers(path, 16).reshape(4, 4))
    except FrameError as error:
        raise SourceError(f"{path}: {error}") from error


def _stamps_ns(stems: list[str]) -> list[tuple[int, str]]:
    """Stamp and its clock for every file: the names where all are times of one unit, else the position."""
    unit_ns = CLOCK_UNITS_NS.get(len(stems[0]))
    if unit_ns and all(stem.isdecimal() and len(stem) == len(stems[0]) for stem in stems):
        return [(int(stem) * unit_ns, "recording") for stem in stems]
    return [(round(i * 1e9 / NOMINAL_RATE_HZ), "nominal") for i in range(len(stems))]
