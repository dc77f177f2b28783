"""BOP's result file as it is read; its rows and how they are written are in `tracker.bop_rows`.

R is taken as a file has it, as the BOP toolkit does, and not moved to the nearest rotation.
https://github.com/thodan/bop_toolkit/blob/master/docs/bop_challenge_2019.md
"""

from __future__ import annotations

import csv
import logging
from collections.abc import Callable, Iterable, Iterator
from decimal import Decimal
from pathlib import Path

import numpy as np

from tracker.bop_rows import COLUMNS, Estimate, check_rotation, write_results
from tracker.errors import OutputError, SourceError
from tracker.geometry import Floats, Pose
from tracker.sources.text_files import is_whole

__all__ = ["Estimate", "read_results", "write_results"]

log = logging.getLogger(__name__)


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
    check_rotation(rotation)
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
    if not is_whole(text):
        raise ValueError(f"{name} is {text!r}, expected a whole number from 0")
    return int(text)
