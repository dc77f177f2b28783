"""BOP's result file: `scene_id,im_id,obj_id,score,R,t,time`, a row an estimate, R row-major, t in millimetres.

What is written is read back bit for bit, and written again it is the same file: numbers have the fewest digits that
identify the double, and metres become millimetres by moving the decimal point of the written number (0.843113 ->
843.113), not by a multiplication that rounds. R is taken as a file has it, as the BOP toolkit does, and not moved to
the nearest rotation.
https://github.com/thodan/bop_toolkit/blob/master/docs/bop_challenge_2019.md
"""

from __future__ import annotations

import csv
import logging
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np

from tracker.errors import OutputError, SourceError
from tracker.geometry import Floats, Pose

log = logging.getLogger(__name__)

COLUMNS = ("scene_id", "im_id", "obj_id", "score", "R", "t", "time")
NO_TIME_S = -1.0
ROTATION_TOLERANCE = 5e-3  # three digits after the point, as some files have, leave |R R^T - 1| at 1.7e-3


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """One pose that a method gave. time_s: seconds for all objects of the image together, -1 where nobody measured."""

    scene_id: int
    image_id: int
    object_id: int
    score: float
    T_cam_obj: Pose
    time_s: float = NO_TIME_S


def read_results(path: str | Path, check: Callable[[Estimate], None] = lambda estimate: None) -> list[Estimate]:  # noqa: ARG005
    """The estimates in the order of the file. Several of one object in an image are several instances, or hypotheses.

    check: raises SourceError where an estimate is of something that there is not. Raises OutputError that names the
    file and the line, also where a row is there twice, and where an image has two times.
    """
    path = Path(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            estimates = list(_rows(path, file, check))
    except OSError as error:
        raise OutputError(f"{path}: cannot be read ({error.strerror})") from error
    if estimates and np.median([np.linalg.norm(e.T_cam_obj.translation_m) for e in estimates]) < 0.01:
        log.warning("%s: half of the objects are within 10 mm of the camera: is t in metres? It is in mm.", path)
    return estimates


def write_results(path: str | Path, estimates: Iterable[Estimate]) -> None:
    """Writes all or nothing: a temporary file in the same folder takes the place of `path` when it is complete.

    Raises OutputError where the folder cannot be written, or an estimate is not what the format holds.
    """
    path = Path(path)
    estimates = list(estimates)
    _check_estimates(path, estimates)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with unfinished.open("w", encoding="utf-8", newline="\n") as file:
            file.write(",".join(COLUMNS) + "\n")
            file.writelines(_line(estimate) for estimate in estimates)
        os.replace(unfinished, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    finally:
        unfinished.unlink(missing_ok=True)


def _rows(path: Path, lines: Iterable[str], check: Callable[[Estimate], None]) -> Iterator[Estimate]:
    reader = csv.reader(lines, strict=True)
    seen = _RowsBefore()
    try:
        header = [name.strip() for name in next(reader, [])]
        missing = [name for name in COLUMNS if name not in header]
        if missing:
            raise ValueError(f"no column {', '.join(missing)}; the header is {','.join(COLUMNS)}")
        for cells in reader:
            if not cells:
                continue
            if len(cells) != len(header):
                raise ValueError(f"{len(cells)} values, the header has {len(header)}")
            estimate = _estimate(dict(zip(header, cells, strict=True)))
            seen.require_new(estimate, reader.line_num)
            check(estimate)
            yield estimate
    except (ValueError, csv.Error, SourceError) as error:  # text that is not UTF-8 is a ValueError too
        raise OutputError(f"{path}, line {max(reader.line_num, 1)}: {error}") from error


class _RowsBefore:
    """What the rows of a file agree in: every one is there once, and an image has one time."""

    def __init__(self) -> None:
        self._lines: dict[tuple[object, ...], int] = {}
        self._times_s: dict[tuple[int, int], tuple[float, int]] = {}

    def require_new(self, e: Estimate, line: int) -> None:
        """Raises ValueError with the line of the row that this one repeats or contradicts."""
        time_s, before = self._times_s.setdefault((e.scene_id, e.image_id), (e.time_s, line))
        if time_s != e.time_s:
            raise ValueError(
                f"time is {e.time_s:g} s, in line {before} {time_s:g} s; all rows of an image have the image's time"
            )
        numbers = np.concatenate((e.T_cam_obj.rotation.ravel(), e.T_cam_obj.translation_m, (e.score,)))
        before = self._lines.setdefault((e.scene_id, e.image_id, e.object_id, numbers.tobytes()), line)
        if before != line:
            raise ValueError(f"the same estimate as in line {before}")


def _estimate(row: dict[str, str]) -> Estimate:
    rotation = _numbers(row, "R", 9).reshape(3, 3)
    _check_rotation(rotation)
    _numbers(row, "t", 3)
    # The point is moved in the text: a division of doubles would round a second time.
    t_m = np.array([float(Decimal(text).scaleb(-3)) for text in row["t"].split()])
    score, time_s = _numbers(row, "score", 1)[0], _numbers(row, "time", 1)[0]
    scene_id, image_id, object_id = (_whole(row, name) for name in COLUMNS[:3])
    return Estimate(scene_id, image_id, object_id, float(score), Pose(rotation, t_m), float(time_s))


def _numbers(row: dict[str, str], name: str, count: int) -> Floats:
    texts = row[name].split()
    if len(texts) != count:
        hint = " (is it a quaternion?)" if name == "R" and len(texts) == 4 else ""
        raise ValueError(f"{name} has {len(texts)} numbers{hint}, expected {count}, separated by blanks")
    try:
        values = np.array([float(text) for text in texts])
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error
    if not np.isfinite(values).all():
        raise ValueError(f"{name} is {row[name]!r}, expected finite numbers")
    return values


def _whole(row: dict[str, str], name: str) -> int:
    text = row[name].strip()
    if not (text.isascii() and text.isdigit()):
        raise ValueError(f"{name} is {text!r}, expected a whole number from 0")
    return int(text)


def _check_rotation(rotation: Floats) -> None:
    """Raises ValueError unless R is a rotation up to the digits of a text file."""
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    determinant = float(np.linalg.det(rotation))
    if not off <= ROTATION_TOLERANCE or determinant < 0:
        raise ValueError(f"R is not a rotation: |R R^T - 1| = {off:.2g} (expected 0), det R = {determinant:+.3f} (+1)")


def _check_estimates(path: Path, estimates: Sequence[Estimate]) -> None:
    times_s: dict[tuple[int, int], float] = {}
    for e in estimates:
        where = f"{path}: estimate of object {e.object_id} in scene {e.scene_id}, image {e.image_id}"
        numbers = np.concatenate((e.T_cam_obj.rotation.ravel(), e.T_cam_obj.translation_m, (e.score, e.time_s)))
        if len(numbers) != 14 or not np.isfinite(numbers).all():
            raise OutputError(f"{where}: R, t, score and time are 14 finite numbers, got {numbers.tolist()}")
        try:
            _check_rotation(e.T_cam_obj.rotation)
        except ValueError as error:
            raise OutputError(f"{where}: {error}") from error
        if min(e.scene_id, e.image_id, e.object_id) < 0:
            raise OutputError(f"{where}: numbers of scene, image and object start at 0")
        # BOP's rule, by which its server refuses files: the time is the image's, not the object's.
        if times_s.setdefault((e.scene_id, e.image_id), e.time_s) != e.time_s:
            raise OutputError(f"{where}: time {e.time_s} s; another row of this image has another time")


def _line(e: Estimate) -> str:
    rotation = " ".join(repr(float(value)) for value in e.T_cam_obj.rotation.ravel())
    t_mm = " ".join(format(Decimal(repr(float(value))).scaleb(3), "f") for value in e.T_cam_obj.translation_m)
    return f"{e.scene_id},{e.image_id},{e.object_id},{float(e.score)!r},{rotation},{t_mm},{float(e.time_s)!r}\n"
