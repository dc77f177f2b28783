"""Lines, numbers and poses in text files."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import numpy as np

from tracker.errors import FrameError, SourceError
from tracker.geometry import Floats, Pose

LONGEST_NUMBER = 18  # digits of a scene, an image or an object: none is larger than 64 bits hold
LONGEST_NAME = 200  # bytes; a file's has at most 255, with what comes after it


def read_lines(path: Path) -> list[str]:
    """The lines that are not blank, without the blanks around them."""
    try:
        return [line.strip() for line in path.read_text().splitlines() if line.strip()]
    except OSError as error:
        raise SourceError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise SourceError(f"{path}: not text ({error})") from error


def read_numbers(path: Path, count: int) -> Floats:
    """(count,) whatever separates the numbers: blanks or line ends. Raises SourceError unless there are so many."""
    numbers = _read(path, f"{count} numbers")
    if len(numbers) != count:
        raise SourceError(f"{path}: expected {count} numbers, got {len(numbers)}")
    return numbers


def read_points(path: Path) -> Floats:
    """(N, 3) in the file's unit. Raises SourceError unless it holds finite points and nothing else."""
    numbers = _read(path, "three numbers a point")
    if not len(numbers) or len(numbers) % 3 or not np.isfinite(numbers).all():
        raise SourceError(f"{path}: expected three finite numbers a point, got {len(numbers)} numbers")
    return numbers.reshape(-1, 3)


def read_pose(path: Path, *, scaled: bool = False) -> Pose:
    """A 4x4 matrix, row by row. scaled: its rotation may be times a positive number, which is left out.

    Raises SourceError that names the file where it is no rigid motion.
    """
    matrix = read_numbers(path, 16).reshape(4, 4)
    if scaled and np.isfinite(matrix).all():
        cubed = float(np.linalg.det(matrix[:3, :3]))
        if not cubed > 0:
            raise SourceError(f"{path}: not a scaled rotation: its determinant is {cubed:g}, expected more than 0")
        matrix[:3, :3] /= np.cbrt(cubed)
    try:
        return Pose.from_matrix(matrix)
    except FrameError as error:
        raise SourceError(f"{path}: {error}") from error


def is_whole(text: str) -> bool:
    """Whether it is a whole number from 0, in digits that everybody writes, of a size that a number of a file has."""
    return text.isascii() and text.isdecimal() and len(text) <= LONGEST_NUMBER


def require_plain_name(name: str, where: str) -> None:
    """Of a thing that a file lists and folders are called after. Raises SourceError, which begins with `where`, for one
    that leads to another folder, and for one that no folder can have."""
    if name in (".", "..") or "/" in name or not name.isprintable() or not 0 < len(name.encode()) <= LONGEST_NAME:
        raise SourceError(f"{where}: {name[:60]!r} cannot be the name of a folder")


def path_within(folder: Path, name: str, where: str) -> Path:
    """The file of a recording that a list in it names. Raises SourceError, which begins with `where`, where it is not
    in the folder: a recording that was made by somebody else decides which of its own files are read, and no others.
    """
    parts = PurePosixPath(name)
    if parts.is_absolute() or ".." in parts.parts or not name.isprintable():
        raise SourceError(f"{where}: {name[:200]!r} is not in {folder}; pictures are named from there, without '..'")
    return folder / parts


def _read(path: Path, expected: str) -> Floats:
    try:
        return np.array([word for line in read_lines(path) for word in line.split()], float)
    except ValueError as error:
        raise SourceError(f"{path}: expected {expected} ({error})") from error
