"""Symmetries that somebody declares: on a command line, or in a BOP dataset's models_info.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from tracker.errors import ConfigError, FrameError
from tracker.geometry import Floats, Pose
from tracker.symmetry import MOST_TURNS, NO_SYMMETRY, SAME_ELEMENT, Symmetry, about, angles_rad

GRAMMAR = (
    "none, or AXIS:ANGLE, several joined by commas; AXIS is x, y, z or a vector like 0.1/0.2/0.97 in object "
    "coordinates, ANGLE is inf or degrees that divide 360, 180 at most: z:inf or x:180,y:180"
)
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
FIXED_POINT_SLACK_M = 0.002  # what a dataset's turns may miss a common fixed point by; they are measured, not exact


def parse_symmetry(text: str, origin_m: Floats | None = None) -> Symmetry:
    """The group that declared turns generate: `z:inf`, `x:180,y:180`, `none`.

    origin_m: (3,) the point that stays, in object coordinates; None is their origin. Raises ConfigError with the
    grammar where the text does not follow it, and where the turns do not make a group of 360 or fewer.
    """
    if text.strip().casefold() == "none":
        return NO_SYMMETRY
    origin_m = np.zeros(3) if origin_m is None else origin_m
    turns, free = [], []
    for part in text.split(","):
        name, _, angle = part.strip().casefold().partition(":")
        axis = _axis(name, text)
        if angle.strip() == "inf":
            free.append(axis)
        else:
            turns.append(about(axis, 2 * np.pi / _turns_a_round(angle, text)))
    _require_one_axis(free, f"symmetry {text!r}")
    return Symmetry.generated(turns, origin_m, free[0] if free else None)


def from_models_info(entry: Mapping[str, Any]) -> Symmetry:
    """Of one object's entry in models_info.json (bop_toolkit, docs/bop_datasets_format.md): `symmetries_discrete`,
    4x4 matrices row by row, and `symmetries_continuous`, axis and a point on it (offset), both in millimetres.

    The list of turns is taken as whole, as BOP defines it. Raises ConfigError where it is no list of rigid motions, or
    where they have no point in common that stays.
    """
    try:
        listed = [_in_metres(matrix) for matrix in entry.get("symmetries_discrete", ())]
        free = [(_unit(c["axis"]), _metres(c["offset"])) for c in entry.get("symmetries_continuous", ())]
        conditions = [(np.eye(3) - pose.rotation, pose.translation_m) for pose in listed]
        conditions += [(_across(axis), _across(axis) @ offset_m) for axis, offset_m in free]
    except (KeyError, TypeError, ValueError, AttributeError, FrameError) as error:
        raise ConfigError(f"models_info.json: a symmetry cannot be read: {error!r}") from error
    if not conditions:
        return NO_SYMMETRY
    matrix, vector = (np.concatenate(parts) for parts in zip(*conditions, strict=True))
    origin_m = np.linalg.lstsq(matrix, vector, rcond=1e-6)[0]
    off_m = float(np.abs(matrix @ origin_m - vector).max())
    if not off_m < FIXED_POINT_SLACK_M:
        raise ConfigError(
            f"models_info.json: no point stays where it is under all of an object's symmetries, the best moves by "
            f"{1000 * off_m:.1f} mm (up to {1000 * FIXED_POINT_SLACK_M:.0f} mm is taken for rounding)"
        )
    turns: list[Floats] = [np.eye(3)]
    for pose in listed:
        if angles_rad(np.stack(turns), pose.rotation).min() > SAME_ELEMENT:
            turns.append(pose.rotation)
    if not free:
        return Symmetry(np.stack(turns), origin_m)
    _require_one_axis([axis for axis, _ in free], "models_info.json")
    return Symmetry.generated(turns, origin_m, free[0][0])


def _axis(name: str, text: str) -> Floats:
    try:
        return _unit(AXES[name] if name in AXES else [float(part) for part in name.split("/")])
    except ValueError as error:
        raise ConfigError(f"symmetry {text!r}: {name!r} is no axis; expected {GRAMMAR}") from error


def _turns_a_round(angle: str, text: str) -> int:
    try:
        turns = 360 / float(angle)
        whole = round(turns)
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        raise ConfigError(f"symmetry {text!r}: {angle!r} is no angle; expected {GRAMMAR}") from error
    if not 2 <= whole <= MOST_TURNS or abs(turns - whole) > 1e-6:
        raise ConfigError(f"symmetry {text!r}: {angle!r} degrees do not divide 360; expected {GRAMMAR}")
    return whole


def _unit(vector: npt.ArrayLike) -> Floats:
    """Raises ValueError where it is no direction."""
    v = np.array(vector, np.float64)
    if v.shape != (3,) or not np.isfinite(v).all() or not np.linalg.norm(v) > 0:
        raise ValueError(f"a direction is three finite numbers, not all 0, got {v.tolist()}")
    return v / np.linalg.norm(v)


def _across(axis: Floats) -> Floats:
    """(3, 3) what a vector is without its part along a unit axis."""
    return np.eye(3) - np.outer(axis, axis)


def _metres(point_mm: npt.ArrayLike) -> Floats:
    """Raises ValueError where it is no point."""
    point_m = np.array(point_mm, np.float64) / 1000
    if point_m.shape != (3,) or not np.isfinite(point_m).all():
        raise ValueError(f"a point is three finite numbers, got {point_m.tolist()}")
    return point_m


def _in_metres(matrix_mm: npt.ArrayLike) -> Pose:
    matrix = np.array(matrix_mm, np.float64).reshape(4, 4)
    matrix[:3, 3] /= 1000
    return Pose.from_matrix(matrix)


def _require_one_axis(axes: Sequence[Floats], where: str) -> None:
    if any(np.linalg.norm(np.cross(axes[0], axis)) > SAME_ELEMENT for axis in axes[1:]):
        raise ConfigError(f"{where}: two axes of any angle, as only a ball has; expected one at most")
