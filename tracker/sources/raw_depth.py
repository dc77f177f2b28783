"""Stored depth -> metres: one table of what the scale of a camera, a recording or a dataset means."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracker.errors import SourceError


@dataclass(frozen=True, slots=True)
class Convention:
    """What a scale means. formula: raw -> metres, for people. to_metres: scale -> metres per unit. usual: the scale
    that holds where the source states none, None where it has to state one."""

    formula: str
    to_metres: Callable[[float], float]
    usual: float | None = None


def _times(scale: float) -> float:
    return scale


def _times_mm(scale: float) -> float:
    return scale / 1000


def _divided(scale: float) -> float:
    return 1 / scale


CONVENTIONS: Mapping[str, Convention] = {
    "realsense": Convention("raw * scale", _times),  # get_depth_scale(): 0.001 for most cameras, not for D405 and L515
    "open3d": Convention("raw / scale", _divided),  # RGBDVideoMetadata.depth_scale
    "orbbec": Convention("raw * scale / 1000", _times_mm),  # get_depth_scale() is of millimetres
    "bop": Convention("raw * scale / 1000", _times_mm),  # depth_scale of scene_camera.json, of every image
    "ycb-video": Convention("raw / scale", _divided, 10_000),  # factor_depth of *-meta.mat
    "tum": Convention("raw / scale", _divided, 5_000),
    "16UC1": Convention("raw * scale", _times, 0.001),  # ROS REP 118: the encoding is the unit
    "mono16": Convention("raw * scale", _times, 0.001),  # of drivers that don't know 16UC1
    "32FC1": Convention("raw * scale", _times, 1.0),
    "millimetres": Convention("raw / scale", _divided, 1_000),  # FoundationPose's folders, Azure Kinect
}


def metres_per_unit(convention: str, where: str, scale: float | None = None, *, override: float | None = None) -> float:
    """Metres that one unit of a stored depth stands for, by the source's convention.

    scale: as the source states it, None for the usual one. override: metres per unit as a user says it, which counts
    whatever the source states (drivers exist that break their convention).
    Raises SourceError, which begins with `where`, for a convention that is not known, and where the number that
    counts is not positive: some recordings read back a scale of 0.
    """
    if convention not in CONVENTIONS:
        raise SourceError(f"{where}: no depth convention is called {convention!r}; there is {', '.join(CONVENTIONS)}")
    if override is not None:
        return require_unit(override, where)
    meaning = CONVENTIONS[convention]
    scale = meaning.usual if scale is None else scale
    if scale is None:
        raise SourceError(f"{where}: the depth scale is missing; depth is {meaning.formula} ({convention})")
    if not (math.isfinite(scale) and scale > 0):
        raise SourceError(
            f"{where}: the depth scale must be positive, got {scale:g}; depth is {meaning.formula} ({convention})"
        )
    return require_unit(meaning.to_metres(scale), where)


def require_unit(metres_per_unit: float, where: str) -> float:
    """The unit as it came. Raises SourceError, which begins with `where`, where it is not positive."""
    if not (math.isfinite(metres_per_unit) and metres_per_unit > 0):
        raise SourceError(f"{where}: the depth scale must be positive, got {metres_per_unit:g} metres per unit")
    return metres_per_unit


def raw_to_metres(raw: npt.NDArray, metres_per_unit: float, where: str) -> npt.NDArray[np.float32]:
    """(H, W) stored depth -> (H, W) float32 metres, 0 where there is none. Always a copy: cameras use buffers again.

    raw: uint8, uint16 or float32; of the last, what is NaN, infinite or negative is no depth.
    Raises SourceError, which begins with `where`, for any other picture and where the unit is not positive.
    """
    require_unit(metres_per_unit, where)
    if raw.ndim != 2 or raw.dtype not in (np.uint8, np.uint16, np.float32):
        raise SourceError(
            f"{where}: a depth picture has one channel of 8 or 16 bits or of float32, got {raw.dtype} {raw.shape}"
        )
    if raw.dtype != np.float32:
        return raw.astype(np.float32) * np.float32(metres_per_unit)
    there = np.isfinite(raw) & (raw > 0)
    return np.where(there, raw, np.float32(0)) * np.float32(metres_per_unit)
