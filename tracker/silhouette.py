"""Where an object at a pose shows in a frame: its mask, when nobody gives one.

The model's points are drawn into a coarse picture whose cells are as large as the points are apart, and what the camera
measured is compared with it: what lies in front is something else, what lies behind is the background.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from tracker.concept import ConceptModel
from tracker.frame import Frame, Mask
from tracker.geometry import Pose
from tracker.projection import project

LEAST_PART = 0.1  # of the largest: smaller parts of a mask are specks
LARGEST_CELLS = 100_000  # of a picture: an object this near fills more than the camera sees


class SilhouetteConfig(BaseModel):
    """depth_slack: distance from the model's surface within which a pixel is the object's, as a share of the diameter,
    at least depth_slack_least_m. loose, around: by how many cells of 1/64 of the diameter a mask reaches beyond the
    model's outline, where the pose is a guess and where it is known, so that what goes on there is noticed;
    loose_depth: more slack where it is a guess."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    depth_slack: float = Field(default=0.06, gt=0)
    depth_slack_least_m: float = Field(default=0.005, gt=0)
    loose_depth: float = Field(default=0.06, ge=0)
    loose: int = Field(default=4, ge=0)
    around: int = Field(default=4, ge=0)


class Silhouette:
    """Draws one model."""

    def __init__(self, model: ConceptModel, config: SilhouetteConfig, pixels_across: int) -> None:
        self._config, self._across = config, pixels_across
        self._points, self._normals, self._diameter_m = model.points, model.normals, model.diameter_m

    def __call__(self, T_cam_obj: Pose, frame: Frame, *, known: bool) -> Mask | str:
        """(H, W) bool, the pixels of the frame that show the object at this pose, or the reason why none does.

        known: the pose is this frame's; otherwise it is a guess, and the mask is generous.
        """
        config, camera = self._config, frame.intrinsics
        at = project(self._points, self._normals, T_cam_obj, camera)
        shown = (at.facing > 0) & at.within(camera, 0)
        if not shown.any():
            return "out of view"
        depth_m = at.points_cam[shown, 2]
        block = max(1, round(self._diameter_m / self._across * camera.fx / float(np.median(depth_m))))
        reach = config.around if known else config.loose
        columns, rows = (np.rint(p[shown] / block).astype(np.intp) for p in (at.columns, at.rows))
        left, top = int(columns.min()) - reach - 1, int(rows.min()) - reach - 1
        width, height = int(columns.max()) - left + reach + 2, int(rows.max()) - top + reach + 2
        if width * height > LARGEST_CELLS:
            return "too near: it fills more than the picture"
        front_m = np.full((height, width), np.inf, np.float32)
        np.minimum.at(front_m, (rows - top, columns - left), depth_m.astype(np.float32))
        nearest_m, farthest_m = _around(front_m, reach + 1)  # a grazing surface has many depths within a few cells
        inner = np.isfinite(_around(front_m, 1)[0])
        seen_m = _sampled(frame.depth_m, left, top, width, height, block)
        slack_m = max(config.depth_slack * self._diameter_m, config.depth_slack_least_m)
        slack_m += 0.0 if known else config.loose_depth * self._diameter_m
        agrees = (seen_m > 0) & (seen_m > nearest_m - slack_m) & (seen_m < farthest_m + slack_m)
        if not agrees.any():
            return _why_not(seen_m[inner], nearest_m[inner])
        cells = _without_specks(agrees | (inner & (seen_m == 0)), agrees)
        return _enlarged(cells, left, top, block, frame.depth_m.shape)


def _why_not(seen_m: npt.NDArray, nearest_m: npt.NDArray) -> str:
    """What most cells show instead of the object. seen_m: (N,) of the cells within its outline."""
    measured = (seen_m > 0) & np.isfinite(seen_m)
    if not measured.any():
        return "no depth where it should be"
    in_front = np.count_nonzero(measured & (seen_m < nearest_m)) > np.count_nonzero(measured) / 2
    return "hidden: something is in front of it" if in_front else "gone: what is seen there lies behind it"


def _around(front_m: npt.NDArray, reach: int) -> tuple[npt.NDArray, npt.NDArray]:
    """The least and the greatest depth within so many cells of each; +infinity and -infinity where there is none."""
    window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    return cv2.erode(front_m, window), cv2.dilate(np.where(np.isfinite(front_m), front_m, -np.inf), window)


def _sampled(depth_m: npt.NDArray, left: int, top: int, width: int, height: int, block: int) -> npt.NDArray:
    """(height, width) depth at the middle of every cell, infinite outside the frame."""
    rows, columns = (np.arange(top, top + height) * block, np.arange(left, left + width) * block)
    inside = ((rows >= 0) & (rows < depth_m.shape[0]))[:, None] & ((columns >= 0) & (columns < depth_m.shape[1]))
    clipped = np.ix_(rows.clip(0, depth_m.shape[0] - 1), columns.clip(0, depth_m.shape[1] - 1))
    return np.where(inside, depth_m[clipped], np.inf)


def _without_specks(cells: Mask, measured: Mask) -> Mask:
    """Connected parts whose measured cells are not few beside the largest's."""
    count, labels = cv2.connectedComponents(cells.astype(np.uint8), connectivity=4)
    sizes = np.bincount(labels[measured], minlength=count)
    sizes[0] = 0
    return (sizes >= max(LEAST_PART * sizes.max(), 1))[labels]


def _enlarged(cells: Mask, left: int, top: int, block: int, shape: tuple[int, int]) -> Mask:
    """The cells as pixels of the frame: cell (c, r) is the block around pixel (c * block, r * block)."""
    pixels = np.repeat(np.repeat(cells, block, axis=0), block, axis=1)
    x0, y0 = left * block - block // 2, top * block - block // 2
    mask = np.zeros(shape, bool)
    target = mask[max(y0, 0) : max(y0 + pixels.shape[0], 0), max(x0, 0) : max(x0 + pixels.shape[1], 0)]
    target[:] = pixels[max(-y0, 0) :, max(-x0, 0) :][: target.shape[0], : target.shape[1]]
    return mask
