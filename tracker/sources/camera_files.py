"""The camera of a recording whose pictures don't say it: given by the user, or in a file beside them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from tracker.errors import FrameError, SourceError
from tracker.geometry import Intrinsics
from tracker.sources.lens import Lens
from tracker.sources.query import numbers
from tracker.sources.text_files import read_lines

EXPECTED = "4 numbers (fx fy cx cy) or 9 (the matrix, row by row)"


@dataclass(frozen=True, slots=True)
class Calibration:
    """In pixels. distortion: k1 k2 p1 p2 k3 .. as of OpenCV, empty for none. told_by: who says so, for people."""

    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    told_by: str = "the user"

    def lens(self, width: int, height: int) -> Lens:
        """For pictures of this size. Raises SourceError where it cannot belong to them."""
        camera = Intrinsics(self.fx, self.fy, self.cx, self.cy, width, height)
        try:
            camera.check()
        except FrameError as error:
            raise SourceError(f"{self.told_by}: {error}") from error
        return Lens(camera, "brown_conrady" if self.distortion else "none", self.distortion, self.told_by)


def read_K(text: str) -> tuple[float, ...] | Path:  # noqa: N802 - the name of the matrix
    """Of an option: fx,fy,cx,cy, or a file that `read_calibration` reads."""
    try:
        return numbers("fx", "fy", "cx", "cy")(text)
    except ValueError as error:
        if "," in text or not text:
            raise ValueError(f"{error}, or a file with {EXPECTED}") from error
        return Path(text)


def read_distortion(text: str) -> tuple[float, ...]:
    """Of an option: k1,k2,p1,p2 and as many more as the lens has."""
    count = text.count(",") + 1
    if count not in (4, 5, 8):
        raise ValueError("4, 5 or 8 numbers k1,k2,p1,p2,k3,k4,k5,k6")
    return numbers(*("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")[:count])(text)


def find_calibration(
    K: tuple[float, ...] | Path | None, distortion: tuple[float, ...], files: Iterable[Path]
) -> Calibration | None:
    """As the user says, else of the first of the files that is there, else None. distortion: as the user says."""
    if isinstance(K, tuple):
        fx, fy, cx, cy = K
        return Calibration(fx, fy, cx, cy, distortion, f"K={','.join(f'{value:g}' for value in K)}")
    path = K or next((file for file in files if file.is_file()), None)
    return None if path is None else read_calibration(path, distortion)


def read_calibration(path: Path, distortion: tuple[float, ...] = ()) -> Calibration:
    """Of a text file with 4 or 9 numbers; what follows # is left out. Raises SourceError that names the file."""
    words = [word for line in read_lines(path) for word in line.partition("#")[0].split()]
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise SourceError(f"{path}: expected {EXPECTED} ({error})") from error
    if len(values) == 9:
        values = [values[0], values[4], values[2], values[5]]
    if len(values) != 4:
        raise SourceError(f"{path}: expected {EXPECTED}, got {len(values)}")
    return Calibration(*values, distortion=distortion, told_by=str(path))
