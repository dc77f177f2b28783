"""What a camera or a recording hands over -> a frame: the one door for all of them."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
import numpy.typing as npt

from tracker.errors import SourceError
from tracker.frame import Frame, Mask, Provenance
from tracker.sources.lens import Lens
from tracker.sources.raw_depth import raw_to_metres

# order of the channels -> how many there are (0: no axis for them), and OpenCV's code for RGB
COLOUR_ORDERS: Mapping[str, tuple[int, int | None]] = {
    "rgb": (3, None),
    "bgr": (3, cv2.COLOR_BGR2RGB),
    "rgba": (4, cv2.COLOR_RGBA2RGB),
    "bgra": (4, cv2.COLOR_BGRA2RGB),
    "gray": (0, cv2.COLOR_GRAY2RGB),
    "yuyv": (2, cv2.COLOR_YUV2RGB_YUYV),
    "uyvy": (2, cv2.COLOR_YUV2RGB_UYVY),
}


def to_rgb(colour: npt.NDArray, order: str, where: str) -> npt.NDArray[np.uint8]:
    """(H, W, 3) uint8 RGB, always a copy: cameras use buffers again. order: one of COLOUR_ORDERS.

    Raises SourceError, which begins with `where`, for a picture that does not have such channels of 8 bits.
    """
    if order not in COLOUR_ORDERS:
        raise SourceError(f"{where}: colours {order!r} are not known; expected one of {', '.join(COLOUR_ORDERS)}")
    channels, code = COLOUR_ORDERS[order]
    if order == "gray" and colour.ndim == 3 and colour.shape[2] == 1:
        colour = colour[:, :, 0]
    shape = colour.shape[2:]
    if colour.dtype != np.uint8 or colour.ndim < 2 or shape != ((channels,) if channels else ()):
        expected = f"(H, W, {channels})" if channels else "(H, W)"
        raise SourceError(f"{where}: a {order} picture is uint8 {expected}, got {colour.dtype} {colour.shape}")
    return np.array(colour) if code is None else np.asarray(cv2.cvtColor(colour, code), np.uint8)


def raw_to_frame(
    colour: npt.NDArray,
    order: str,
    raw_depth: npt.NDArray,
    lens: Lens,
    stamp_ns: int,
    index: int,
    provenance: Provenance,
    masks: Mapping[str, Mask] | None = None,
) -> Frame:
    """A frame that shares no memory with what it was made of, undistorted.

    colour: (H, W[, C]) uint8, its channels in the order of COLOUR_ORDERS. raw_depth: (H, W) uint8, uint16 or float32,
    registered to the colour, in units of provenance.raw_depth_unit_m metres. masks: of the undistorted picture.
    provenance.source is what a message begins with.
    Raises SourceError where a picture is of another kind or the unit not positive, FrameError as Frame does.
    """
    rgb = to_rgb(colour, order, provenance.source)
    depth_m = raw_to_metres(raw_depth, provenance.raw_depth_unit_m, provenance.source)
    rgb, depth_m = lens.undistort(rgb, depth_m)
    return Frame(
        rgb=rgb,
        depth_m=depth_m,
        intrinsics=lens.intrinsics,
        stamp_ns=stamp_ns,
        masks=masks or {},
        index=index,
        provenance=provenance,
    )
