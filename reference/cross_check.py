"""Reference frames check each other's points: what one takes for the object, another may see to be the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from tracker.frame import PosedFrame
from tracker.geometry import Floats

MASK_SLACK_PX = 6  # masks are ragged: only what lies farther outside than this counts as outside


@dataclass(frozen=True, slots=True, eq=False)
class Votes:
    """confirmed, denied: (N,) how many other frames see a point on the object, or see that it is not of it."""

    confirmed: npt.NDArray[np.intp]
    denied: npt.NDArray[np.intp]

    @property
    def kept(self) -> npt.NDArray[np.bool_]:
        """(N,) bool, not denied by more frames than confirm it."""
        return self.denied <= self.confirmed


def cross_check(points_obj: Floats, others: Sequence[PosedFrame], slack_m: float) -> Votes:
    """What the other reference frames say of points (N, 3) of one of them, in object coordinates.

    A frame confirms a point whose surface it sees, to slack_m in depth, within its mask. It denies one whose surface
    it sees clearly outside its mask, or through which it sees. Where the point is hidden, or depth is missing, it says
    nothing.
    """
    confirmed, denied = np.zeros(len(points_obj), np.intp), np.zeros(len(points_obj), np.intp)
    for other in others:
        camera, depth_m = other.frame.intrinsics, other.frame.depth_m
        points_cam = other.T_cam_obj @ points_obj
        in_front = points_cam[:, 2] > 0
        pixels = np.zeros((len(points_obj), 2), np.intp)
        pixels[in_front] = np.rint(camera.project(points_cam[in_front]))
        x, y = np.clip(pixels[:, 0], 0, camera.width - 1), np.clip(pixels[:, 1], 0, camera.height - 1)
        seen = in_front & (pixels[:, 0] == x) & (pixels[:, 1] == y) & (depth_m[y, x] > 0)
        behind_m = depth_m[y, x] - points_cam[:, 2]
        # At an outline rounding may pick the background: only where all pixels around lie behind is it seen through.
        all_behind_m = cv2.erode(depth_m, np.ones((3, 3), np.uint8))[y, x] - points_cam[:, 2]
        on_surface = seen & (np.abs(behind_m) <= slack_m)
        near_mask = cv2.dilate(other.mask.astype(np.uint8), np.ones((2 * MASK_SLACK_PX + 1,) * 2, np.uint8)) > 0
        confirmed += on_surface & other.mask[y, x]
        denied += (seen & (all_behind_m > slack_m)) | (on_surface & ~near_mask[y, x])
    return Votes(confirmed, denied)


def others_than(frames: Sequence[PosedFrame], k: int) -> list[PosedFrame]:
    return [frame for j, frame in enumerate(frames) if j != k]
