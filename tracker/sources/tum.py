"""A recording in the layout of TUM's RGB-D benchmark (also ETH3D's SLAM benchmark and ICL-NUIM).

    PATH/rgb.txt, depth.txt        `stamp file` a line, seconds; or
         associations.txt          `stamp file stamp file` a line, of pictures that belong together, in either order
         rgb/STAMP.png  depth/STAMP.png (5000 units a metre, registered to the colour)

    tum:PATH?K=fx,fy,cx,cy&distortion=k1,k2,p1,p2,k3&depth_factor=5000&slop=0.02

The layout has no camera: it is that of ?K, of a file camera.txt, calibration.txt (ETH3D) or cam_K.txt, or, where the
folder is called after one of the benchmark's cameras (freiburg1, 2, 3), the calibration of that one, with distortion.
https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import cv2

from tracker.errors import SourceError
from tracker.frame import Frame, Provenance
from tracker.sources.approximate_time import pair_stamps
from tracker.sources.camera_files import Calibration, find_calibration, read_distortion, read_K
from tracker.sources.image_files import read_image, read_rgb
from tracker.sources.lens import Lens
from tracker.sources.query import number, read_query
from tracker.sources.raw_depth import metres_per_unit
from tracker.sources.raw_frame import raw_to_frame
from tracker.sources.text_files import path_within, read_lines

logger = logging.getLogger(__name__)

ASSOCIATIONS = ("associations.txt", "associated.txt", "association.txt", "associate.txt")
CAMERA_FILES = ("camera.txt", "calibration.txt", "cam_K.txt")
# Of the colour cameras, from the page's "Calibration of the color camera".
FREIBURG = {
    "freiburg1": Calibration(517.3, 516.5, 318.6, 255.3, (0.2624, -0.9531, -0.0054, 0.0026, 1.1633), "freiburg1"),
    "freiburg2": Calibration(520.9, 521.0, 325.1, 249.7, (0.2312, -0.7849, -0.0033, -0.0001, 0.9172), "freiburg2"),
    "freiburg3": Calibration(535.4, 539.2, 320.1, 247.6, (), "freiburg3"),
}
LAST_STAMP_NS = 2**63
SLOP_S = 0.02  # that of the benchmark's own associate.py
NOMINAL_RATE_HZ = 30.0
OPTIONS = {
    "K": read_K,
    "distortion": read_distortion,
    "depth_factor": number(1, 1e6, "units a metre"),
    "slop": number(0, 10, "seconds"),
}


@dataclass(frozen=True, slots=True)
class _Pictures:
    colour_ns: int
    colour: Path
    depth_ns: int
    depth: Path


class TumFolder:
    """Frames in the order of the colour pictures' stamps. argument: PATH with options.

    Raises SourceError where a list is missing or damaged, nothing belongs together, or nobody tells the camera.
    """

    def __init__(self, argument: str) -> None:
        self.name = f"tum:{argument}"
        path, _, query = argument.partition("?")
        given = read_query(self.name, query, OPTIONS)
        self._path = Path(path)
        self._unit_m = metres_per_unit("tum", self.name, given.get("depth_factor"))
        self._clock = "recording"
        self._pictures = self._in_order(round(given.get("slop", SLOP_S) * 1e9))
        self._calibration = self._camera(given.get("K"), given.get("distortion", ()))
        self._lens: Lens | None = None

    def __len__(self) -> int:
        return len(self._pictures)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        of = self._pictures[index]
        rgb, stored = read_rgb(of.colour), read_image(of.depth, cv2.IMREAD_UNCHANGED)
        height, width = rgb.shape[:2]
        if self._lens is None:
            self._lens = self._calibration.lens(width, height)
        source, skew_ns = f"{self.name} {of.colour.name}", of.colour_ns - of.depth_ns
        provenance = Provenance(source, self._clock, skew_ns, self._unit_m, of.colour.stem)
        return raw_to_frame(rgb, "rgb", stored, self._lens, of.colour_ns, index, provenance)

    def _in_order(self, slop_ns: int) -> list[_Pictures]:
        found = next((self._path / name for name in ASSOCIATIONS if (self._path / name).is_file()), None)
        if found is not None:
            rows = _rows(found, 4)
            pictures = [self._associated(found, row) for row in rows]
            where, counted = str(found), all(row[0].isdecimal() and len(row[0]) < 10 for row in rows)
        else:
            lists = (self._path / "rgb.txt", self._path / "depth.txt")
            colours, depths = (
                [(_nanoseconds(file, row[0]), path_within(self._path, row[1], str(file))) for row in _rows(file, 2)]
                for file in lists
            )
            colour_ns, depth_ns = ([stamp_ns for stamp_ns, _ in each] for each in (colours, depths))
            paired = pair_stamps(colour_ns, depth_ns, slop_ns)
            pictures = [_Pictures(*colours[a], *depths[b]) for a, b in paired]
            where, counted = f"{self._path}/rgb.txt and depth.txt ({len(colours)} and {len(depths)} pictures)", False
        if not pictures:
            raise SourceError(f"{where}: no pictures belong together (within {slop_ns / 1e9:g} s); say ?slop=SECONDS")
        pictures.sort(key=lambda of: of.colour_ns)
        if counted:  # ICL-NUIM numbers its pictures
            self._clock, scale = "nominal", 1 / NOMINAL_RATE_HZ
            return [_Pictures(round(of.colour_ns * scale), of.colour, round(of.depth_ns * scale), of.depth)
                    for of in pictures]  # fmt: skip
        return pictures

    def _associated(self, file: Path, row: list[str]) -> _Pictures:
        if "depth" in row[1] and "depth" not in row[3]:
            row = [*row[2:], *row[:2]]
        stamps_ns = [_nanoseconds(file, row[k]) for k in (0, 2)]
        colour, depth = (path_within(self._path, row[k], str(file)) for k in (1, 3))
        return _Pictures(stamps_ns[0], colour, stamps_ns[1], depth)

    def _camera(self, K: tuple[float, ...] | Path | None, distortion: tuple[float, ...]) -> Calibration:
        found = find_calibration(K, distortion, [self._path / name for name in CAMERA_FILES])
        if found is not None:
            return found
        named = re.search("freiburg[123]", str(self._path.resolve()))
        if named is None or distortion:
            raise SourceError(
                f"{self.name}: the layout does not tell the camera; say ?K=fx,fy,cx,cy, or write these four numbers to "
                f"{self._path}/camera.txt (a folder called rgbd_dataset_freiburg1_.., 2 or 3 has the benchmark's own)"
            )
        logger.warning("%s: camera of %s by its name; say ?K=fx,fy,cx,cy for another", self.name, named[0])
        return FREIBURG[named[0]]


def _rows(path: Path, words: int) -> list[list[str]]:
    rows = [(k, line.split()) for k, line in enumerate(read_lines(path), start=1) if not line.startswith("#")]
    for k, row in rows:
        if len(row) != words:
            raise SourceError(f"{path}, row {k}: expected {words} words, stamps and files, got {' '.join(row)!r}")
    return [row for _, row in rows]


def _nanoseconds(path: Path, seconds: str) -> int:
    try:
        stamp_ns = Decimal(seconds).scaleb(9)  # more digits than a float holds
        if not 0 <= stamp_ns < LAST_STAMP_NS:
            raise SourceError(f"{path}: a stamp is not before 0, nor after the year 2262, got {seconds[:60]!r}")
        return int(stamp_ns.to_integral_value())
    except ArithmeticError as error:  # what is no number is one of them
        raise SourceError(f"{path}: a stamp is a number of seconds, got {seconds[:60]!r}") from error
