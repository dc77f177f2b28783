"""Rows of BOP's result file: `scene_id,im_id,obj_id,score,R,t,time`, one an estimate, R row-major, t in millimetres.

What is written is read back bit for bit, and written again it is the same file: numbers have the fewest digits that
identify the double, and metres become millimetres by moving the decimal point of the written number (0.843113 ->
843.113), not by a multiplication that rounds.
https://github.com/thodan/bop_toolkit/blob/master/docs/bop_challenge_2019.md
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np

from tracker.errors import OutputError
from tracker.geometry import Floats, Pose

COLUMNS = ("scene_id", "im_id", "obj_id", "score", "R", "t", "time")
HEADER = ",".join(COLUMNS) + "\n"
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


def write_results(path: str | Path, estimates: Iterable[Estimate]) -> None:
    """Writes all or nothing: a temporary file in the same folder takes the place of `path` when it is complete.

    Raises OutputError where the folder cannot be written, or an estimate is not what the format holds.
    """
    path = Path(path)
    estimates = list(estimates)
    check_estimates(path, estimates)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with unfinished.open("w", encoding="utf-8", newline="\n") as file:
            file.write(HEADER)
            file.writelines(as_row(estimate) for estimate in estimates)
        os.replace(unfinished, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    finally:
        unfinished.unlink(missing_ok=True)


def check_rotation(rotation: Floats) -> None:
    """Raises ValueError unless R is a rotation up to the digits of a text file."""
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    determinant = float(np.linalg.det(rotation))
    if not off <= ROTATION_TOLERANCE or determinant < 0:
        raise ValueError(f"R is not a rotation: |R R^T - 1| = {off:.2g} (expected 0), det R = {determinant:+.3f} (+1)")


def check_estimates(path: Path, estimates: Sequence[Estimate]) -> None:
    times_s: dict[tuple[int, int], float] = {}
    for e in estimates:
        where = f"{path}: estimate of object {e.object_id} in scene {e.scene_id}, image {e.image_id}"
        numbers = np.concatenate((e.T_cam_obj.rotation.ravel(), e.T_cam_obj.translation_m, (e.score, e.time_s)))
        if len(numbers) != 14 or not np.isfinite(numbers).all():
            raise OutputError(f"{where}: R, t, score and time are 14 finite numbers, got {numbers.tolist()}")
        try:
            check_rotation(e.T_cam_obj.rotation)
        except ValueError as error:
            raise OutputError(f"{where}: {error}") from error
        if min(e.scene_id, e.image_id, e.object_id) < 0:
            raise OutputError(f"{where}: numbers of scene, image and object start at 0")
        # BOP's rule, by which its server refuses files: the time is the image's, not the object's.
        if times_s.setdefault((e.scene_id, e.image_id), e.time_s) != e.time_s:
            raise OutputError(f"{where}: time {e.time_s} s; another row of this image has another time")


def as_row(e: Estimate) -> str:
    rotation = " ".join(repr(float(value)) for value in e.T_cam_obj.rotation.ravel())
    t_mm = " ".join(format(Decimal(repr(float(value))).scaleb(3), "f") for value in e.T_cam_obj.translation_m)
    return f"{e.scene_id},{e.image_id},{e.object_id},{float(e.score)!r},{rotation},{t_mm},{float(e.time_s)!r}\n"
