"""Where an object was, and where it may be now, while it is out of sight and when it has moved in an unexpected way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tracker.camera_motion import CameraMotion, Landmarks
from tracker.frame import Frame, Mask
from tracker.geometry import Floats, Pose


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """A pose in the camera coordinates of a frame, then, and what it comes to in those of the last one, if it stands
    still."""

    then: Landmarks | None
    T_then_obj: Pose
    T_last_obj: Pose

    @classmethod
    def at(cls, T_cam_obj: Pose, camera: CameraMotion) -> _Place:
        return cls(camera.now, T_cam_obj, T_cam_obj)

    def now(self, camera: CameraMotion) -> Pose:
        """T_cam_obj in this frame. Straight from then, where both see the same things: whatever passed in between does
        no harm. Else on from the last frame."""
        straight = camera.since(self.then)
        if straight is not None:
            return straight @ self.T_then_obj
        moved = camera.from_last()
        return self.T_last_obj if moved is None else moved @ self.T_last_obj

    def carried(self, camera: CameraMotion) -> _Place:
        return _Place(self.then, self.T_then_obj, self.now(camera))


class Whereabouts:
    """Of one object."""

    def __init__(self) -> None:
        self._last: _Place | None = None  # where it was believed to be
        self._suspected: _Place | None = None  # where it has been seen again, which another frame has to confirm
        self._pointed_out: _Place | None = None  # where a mask said that it is, though it could not be told there

    @property
    def known(self) -> bool:
        return self._last is not None or self._suspected is not None

    def found(self, T_cam_obj: Pose, camera: CameraMotion) -> None:
        """In this frame."""
        self._last, self._suspected, self._pointed_out = _Place.at(T_cam_obj, camera), None, None

    def told(self, T_cam_obj: Pose) -> None:
        """Somebody says that it was there, in the last frame or since."""
        self._last = _Place(None, T_cam_obj, T_cam_obj)

    def expected(self, camera: CameraMotion) -> Iterator[Pose]:
        """Where it is in this frame, if it stands still: T_cam_obj."""
        for place in (self._suspected, self._last):
            if place is not None:
                yield place.now(camera)

    def suspect(self, camera: CameraMotion) -> Pose | None:
        """T_cam_obj in this frame of what has been seen and another frame has to confirm."""
        return None if self._suspected is None else self._suspected.now(camera)

    def suspected(self, T_then_obj: Pose, then: Landmarks | None, camera: CameraMotion) -> None:
        """It has been seen in this frame or an earlier one, by whom nobody waited for."""
        self._suspected = _Place(then, T_then_obj, T_then_obj).carried(camera)

    def pointed_out_m(self, camera: CameraMotion) -> Floats | None:
        """(3,) the place in this frame, in camera coordinates, that a mask pointed out."""
        return None if self._pointed_out is None else self._pointed_out.now(camera).translation_m

    def carry(self, camera: CameraMotion, suspected: Pose | None = None) -> None:
        """The frame is over, and it was not found. suspected: T_cam_obj in this frame of what may be it."""
        self._suspected = None if suspected is None else _Place.at(suspected, camera)
        self._last = None if self._last is None else self._last.carried(camera)
        self._pointed_out = None if self._pointed_out is None else self._pointed_out.carried(camera)

    def point_out(self, mask: Mask, frame: Frame, camera: CameraMotion) -> None:
        """A mask (H, W) of this frame says that it is there."""
        rows, columns = np.nonzero(mask & (frame.depth_m > 0))
        if len(rows):
            points = frame.intrinsics.unproject(columns, rows, frame.depth_m[rows, columns].astype(np.float64))
            self._pointed_out = _Place.at(Pose(np.eye(3), np.median(points, axis=0)), camera)
