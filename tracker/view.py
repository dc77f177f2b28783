"""The part of a frame that shows one object, brought to a resolution that suits the object.

Everything behind this door works on it: a pixel of the view is a block of the frame's pixels whose width is a fixed
share of the object's size. So scales mean the same for a marker and a cereal box, near or far, at any camera
resolution; noise is averaged; and the cost of a frame is bounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from tracker.frame import Frame, Mask
from tracker.geometry import Floats, Intrinsics

Float32s = npt.NDArray[np.float32]

MARGIN_PX = 4  # empty pixels around the view, so that smoothing and lookups need no special case at the border


class ViewConfig(BaseModel):
    """pixels_across: view pixels that span the object's diameter at its median depth (the paper's 64 voxels).
    least_pixels: of the object; where so much of it is hidden that there would be fewer, pixels are made smaller."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    pixels_across: int = Field(default=64, ge=8, le=512)
    least_pixels: int = Field(default=600, ge=0)


class Box(NamedTuple):
    """A rectangle of frame pixels: columns x0 <= x < x1, rows y0 <= y < y1."""

    x0: int
    y0: int
    x1: int
    y1: int


@dataclass(frozen=True, slots=True, eq=False)
class ObjectView:
    """An object's pixels of a frame, pooled block by block.

    rgb: (h, w, 3) float32 in [0, 255], mean over a block's masked pixels. depth_m: (h, w) float32, 0 where there is
    none. inside: (h, w) bool, at least half of the block is masked. camera: the pinhole camera of this grid.
    box: the frame's pixels that the grid covers, margin included (it may reach beyond the frame).
    extent_m: the object's diameter that the grid was made for. pixels_across: that diameter in view pixels.
    """

    frame: Frame
    mask: Mask
    rgb: Float32s
    depth_m: Float32s
    inside: Mask
    camera: Intrinsics
    box: Box
    extent_m: float
    pixels_across: float

    @property
    def has_depth(self) -> Mask:
        """(h, w) bool, the object's pixels that have a 3D point."""
        return self.inside & (self.depth_m > 0)

    def points(self) -> Floats:
        """(N, 3) points in camera coordinates, metres, of the pixels that have depth, row by row."""
        rows, columns = np.nonzero(self.has_depth)
        return self.camera.unproject(columns, rows, self.depth_m[rows, columns].astype(np.float64))


def bounding_box(mask: Mask) -> Box | None:
    """The least rectangle that holds the mask, None if it is empty."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return None
    return Box(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)


def view_object(frame: Frame, mask: Mask, extent_m: float, config: ViewConfig) -> ObjectView | None:
    """Pool the masked part of a frame for an object of diameter extent_m. None if no masked pixel has depth."""
    box = bounding_box(mask)
    if box is None:
        return None
    inside, depth_m = mask[box.y0 : box.y1, box.x0 : box.x1], frame.depth_m[box.y0 : box.y1, box.x0 : box.x1]
    measured = inside & (depth_m > 0)
    if not measured.any():
        return None
    distance_m = float(np.median(depth_m[measured]))
    block = max(1, round(extent_m / config.pixels_across * frame.intrinsics.fx / distance_m))
    block = min(block, max(1, int((np.count_nonzero(inside) / max(config.least_pixels, 1)) ** 0.5)))
    rgb, share = _pool_colour(frame.rgb[box.y0 : box.y1, box.x0 : box.x1], inside, block)
    pooled_m = _pool_depth(depth_m, measured, block, tolerance_m=extent_m / config.pixels_across)
    height, width = share.shape
    pad = ((MARGIN_PX, MARGIN_PX), (MARGIN_PX, MARGIN_PX))
    x0, y0 = box.x0 - MARGIN_PX * block, box.y0 - MARGIN_PX * block
    camera = Intrinsics(
        fx=frame.intrinsics.fx / block,
        fy=frame.intrinsics.fy / block,
        cx=(frame.intrinsics.cx - x0 - (block - 1) / 2) / block,
        cy=(frame.intrinsics.cy - y0 - (block - 1) / 2) / block,
        width=width + 2 * MARGIN_PX,
        height=height + 2 * MARGIN_PX,
    )
    return ObjectView(
        frame=frame,
        mask=mask,
        rgb=np.pad(rgb, (*pad, (0, 0))),
        depth_m=np.pad(pooled_m, pad),
        inside=np.pad(share >= 0.5, pad),
        camera=camera,
        box=Box(x0, y0, x0 + camera.width * block, y0 + camera.height * block),
        extent_m=extent_m,
        pixels_across=extent_m * camera.fx / distance_m,
    )


def _pool_colour(rgb: npt.NDArray[np.uint8], inside: Mask, block: int) -> tuple[Float32s, Float32s]:
    """Mean colour (h, w, 3) of the masked pixels of every block, and the share (h, w) of the block that is masked."""
    weights = inside.astype(np.float32)
    share = _block_mean(weights, block)
    total = _block_mean(rgb * weights[:, :, None], block)
    return np.asarray(total / np.maximum(share, 1e-6)[:, :, None], np.float32), share


def _pool_depth(depth_m: Float32s, measured: Mask, block: int, tolerance_m: float) -> Float32s:
    """Mean depth (h, w) of the pixels within tolerance of their block's median, 0 where under a quarter has depth.

    A plain mean would hang points in the air between a near and a far surface.
    """
    if block == 1:
        return np.where(measured, depth_m, np.float32(0))
    known, depth_m = _blocks(measured, block), _blocks(depth_m, block)
    count = np.count_nonzero(known, axis=2)
    mean = np.where(known, depth_m, np.float32(0)).sum(axis=2) / np.maximum(count, 1)
    nearest, farthest = (np.where(known, depth_m, np.float32(none)) for none in (np.inf, -np.inf))
    torn = farthest.max(axis=2) - nearest.min(axis=2) >= tolerance_m  # few are, and medians take long
    mean[torn] = _mean_about_median(nearest[torn], count[torn], tolerance_m)
    return np.where(count >= 0.25 * block * block, mean, 0).astype(np.float32)


def _mean_about_median(values: Float32s, count: npt.NDArray[np.intp], tolerance_m: float) -> Floats:
    """Of each row of values (N, K), infinite where there are none, the mean of those within tolerance of the median of
    as many as `count` (N,) says."""
    median = np.take_along_axis(np.sort(values, axis=1), (count[:, None] - 1) // 2, axis=1)
    near = np.abs(values - median) < tolerance_m
    return np.where(near, values, 0).sum(axis=1) / near.sum(axis=1)


def _blocks(array: npt.NDArray, block: int) -> npt.NDArray:
    """(H, W) -> (h, w, block * block), filled up with zeros at the lower and right border."""
    height, width = -(-array.shape[0] // block), -(-array.shape[1] // block)
    full = np.zeros((height * block, width * block), array.dtype)
    full[: array.shape[0], : array.shape[1]] = array
    return full.reshape(height, block, width, block).swapaxes(1, 2).reshape(height, width, block * block)


def _block_mean(array: Float32s, block: int) -> Float32s:
    """Mean of every block of (H, W) or (H, W, C), missing pixels counted as zero."""
    below, right = -array.shape[0] % block, -array.shape[1] % block
    full = cv2.copyMakeBorder(array, 0, below, 0, right, cv2.BORDER_CONSTANT)
    size = (full.shape[1] // block, full.shape[0] // block)
    return np.asarray(cv2.resize(full, size, interpolation=cv2.INTER_AREA), np.float32)
