"""One RGB-D picture, checked at the door so that nothing behind it has to ask again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from tracker.errors import FrameError
from tracker.geometry import Intrinsics, Pose

Mask = npt.NDArray[np.bool_]

FARTHEST_PLAUSIBLE_M = 20.0  # no depth camera sees the median pixel beyond this; millimetres always do


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a frame came from, for reports and for reading its stamp right.

    clock: whose time `stamp_ns` is ("nominal": the recording has none and a frame rate was assumed).
    colour_depth_skew_ns: stamp of the colour picture minus that of the depth picture.
    raw_depth_unit_m: metres that one unit of the stored depth stood for (0 where it was never stored).
    name: what the recording calls the picture, without suffix; empty where its pictures have no names.
    bop_image: scene and image by which a dataset in BOP's layout numbers the picture.
    """

    source: str = "memory"
    clock: str = "unknown"
    colour_depth_skew_ns: int = 0
    raw_depth_unit_m: float = 0.0
    name: str = ""
    bop_image: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A colour picture, the depth registered to it, and the camera they share.

    rgb: (H, W, 3) uint8, RGB. depth_m: (H, W) float32, metres along the optical axis, 0 where there is none.
    stamp_ns: time of the picture, whole nanoseconds, increasing within a source.
    masks: object id -> (H, W) bool, the pixels of that object where somebody says so; an object that is known not to
    be seen has an empty mask, one of which nothing is known has none.
    index: number of the frame in its source.

    Raises FrameError where a part is missing, damaged, of another size, or in other units.
    """

    rgb: npt.NDArray[np.uint8]
    depth_m: npt.NDArray[np.float32]
    intrinsics: Intrinsics
    stamp_ns: int
    masks: Mapping[str, Mask] = field(default_factory=dict)
    index: int = 0
    provenance: Provenance = Provenance()

    def __post_init__(self) -> None:
        size = (self.intrinsics.height, self.intrinsics.width)
        where = f"frame {self.index} of {self.provenance.source}"
        _check_array(where, "rgb", self.rgb, np.uint8, (*size, 3))
        _check_array(where, "depth_m", self.depth_m, np.float32, size)
        for object_id, mask in self.masks.items():
            _check_array(where, f"mask of object {object_id!r}", mask, np.bool_, size)
        self.intrinsics.check()
        if not isinstance(self.stamp_ns, int) or self.stamp_ns < 0:
            raise FrameError(f"{where}: stamp_ns is a whole number of nanoseconds from 0, got {self.stamp_ns!r}")
        _check_depth(where, self.depth_m)


@dataclass(frozen=True, slots=True, eq=False)
class PosedFrame:
    """A frame in which the pose of an object is known: for onboarding and for evaluation, never for tracking.

    T_cam_obj: object coordinates -> camera coordinates. mask: (H, W) bool, the object's visible pixels.
    """

    frame: Frame
    object_id: str
    T_cam_obj: Pose
    mask: Mask

    def __post_init__(self) -> None:
        where = f"frame {self.frame.index} of {self.frame.provenance.source}"
        _check_array(where, f"mask of object {self.object_id!r}", self.mask, np.bool_, self.frame.depth_m.shape)


def _check_array(where: str, name: str, array: object, dtype: type[np.generic], shape: tuple[int, ...]) -> None:
    if not isinstance(array, np.ndarray):
        raise FrameError(f"{where}: {name} is missing (got {type(array).__name__}, expected an array {shape})")
    if array.shape != shape:
        raise FrameError(f"{where}: {name} has shape {array.shape}, expected {shape} (the size of the camera's images)")
    if array.dtype != dtype:
        raise FrameError(f"{where}: {name} has dtype {array.dtype}, expected {np.dtype(dtype)}")


def _check_depth(where: str, depth_m: npt.NDArray[np.float32]) -> None:
    lowest, highest = float(depth_m.min()), float(depth_m.max())  # a NaN anywhere makes both NaN
    if not np.isfinite((lowest, highest)).all():
        bad = int(np.count_nonzero(~np.isfinite(depth_m)))
        raise FrameError(f"{where}: depth_m has {bad} values that are not finite; pixels without depth are 0")
    if lowest < 0:
        raise FrameError(f"{where}: depth_m has negative values (least {lowest:g}); pixels without depth are 0")
    if highest > FARTHEST_PLAUSIBLE_M:
        median = float(np.median(depth_m[depth_m > 0]))
        if median > FARTHEST_PLAUSIBLE_M:
            raise FrameError(
                f"{where}: the median depth is {median:.0f}: this looks like millimetres, depth_m is in metres "
                "(divide by 1000, or check the depth scale of the source)"
            )
