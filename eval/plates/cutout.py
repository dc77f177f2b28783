"""A part of a frame, enlarged, with the camera that sees just that."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tracker.frame import Frame, Mask
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.overlay import Picture
from tracker.view import bounding_box

MARGIN = 1.25
LEAST_PX = 40  # of the frame, on the shorter side


@dataclass(frozen=True, slots=True, eq=False)
class Cutout:
    """rgb: (h, w, 3) uint8. camera: of these pixels. left, top: its corner in the frame. scale: its pixels in one
    of the frame."""

    rgb: Picture
    camera: Intrinsics
    left: float
    top: float
    scale: float

    def at(self, pixels: Floats) -> Floats:
        """(N, 2) of the frame -> of the cutout."""
        return (pixels - (self.left, self.top)) * self.scale


def cut_out(frame: Frame, around: Floats, width: int, height: int) -> Cutout:
    """around: (N, 2) pixels of the frame that it has to show, at least one."""
    low, high = around.min(axis=0), around.max(axis=0)
    size = np.maximum(MARGIN * (high - low), LEAST_PX)
    scale = float(min(width / size[0], height / size[1]))
    left, top = ((low + high) / 2 - np.array((width, height)) / scale / 2).tolist()
    shift = np.array([[scale, 0, -scale * left], [0, scale, -scale * top]])
    rgb = cv2.warpAffine(frame.rgb, shift, (width, height), flags=cv2.INTER_LINEAR, borderValue=(255, 255, 255))
    seen = frame.intrinsics
    camera = Intrinsics(
        seen.fx * scale, seen.fy * scale, scale * (seen.cx - left), scale * (seen.cy - top), width, height
    )
    return Cutout(np.asarray(rgb, np.uint8), camera, left, top, scale)


def corners_of(mask: Mask) -> Floats:
    """(2, 2) pixels: the upper left and the lower right one of the mask; none (0, 2) where it is empty."""
    box = bounding_box(mask)
    return np.zeros((0, 2)) if box is None else np.array([(box.x0, box.y0), (box.x1, box.y1)], float)


def pixels_of(T_cam_obj: Pose, points: Floats, camera: Intrinsics) -> Floats:
    """(N, 2) of the points before the camera."""
    points_cam = T_cam_obj @ points
    return camera.project(points_cam[points_cam[:, 2] > 0.01])
