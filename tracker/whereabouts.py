"""Where an object was, and where it may be now, while it is out of sight and when it has moved in an unexpected way."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.camera_motion import CameraMotion
from tracker.frame import Frame, Mask
from tracker.geometry import Floats, Pose


class Whereabouts:
    """Of one object, in the camera coordinates of the last frame; `carry` takes them along to the next one's."""

    def __init__(self) -> None:
        self._last: Pose | None = None  # where it was believed to be
        self._suspected: Pose | None = None  # where it has been seen again, which another frame has to confirm
        self.pointed_out_m: Floats | None = None  # (3,) where a mask said that it is, though it could not be told there

    @property
    def known(self) -> bool:
        return self._last is not None or self._suspected is not None

    def found(self, T_cam_obj: Pose) -> None:
        self._last, self._suspected, self.pointed_out_m = T_cam_obj, None, None

    def expected(self, camera: CameraMotion) -> Iterator[Pose]:
        """Where it is in this frame, if it stands still and the camera moved."""
        for pose in (self._suspected, self._last):
            if pose is not None:
                moved = camera.from_last()
                yield pose if moved is None else moved @ pose

    def carry(self, camera: CameraMotion, suspected: Pose | None = None) -> None:
        """The frame is over, and it was not found. suspected: T_cam_obj in this frame of what may be it."""
        self._suspected = suspected
        if self._last is None and self.pointed_out_m is None:
            return
        moved = camera.from_last()
        if moved is not None:
            self._last = None if self._last is None else moved @ self._last
            self.pointed_out_m = None if self.pointed_out_m is None else (moved @ self.pointed_out_m[None])[0]

    def point_out(self, mask: Mask, frame: Frame) -> None:
        """A mask (H, W) says that it is there."""
        rows, columns = np.nonzero(mask & (frame.depth_m > 0))
        if len(rows):
            points = frame.intrinsics.unproject(columns, rows, frame.depth_m[rows, columns].astype(np.float64))
            self.pointed_out_m = np.median(points, axis=0)
