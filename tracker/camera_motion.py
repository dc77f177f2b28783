"""How the camera moved between two frames, by what stands still in both.

A jerk of the camera moves all objects that lie still alike, whatever each of them did before: where the expectation of
an object's own motion fails, this one often holds.
"""

from __future__ import annotations

from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt
import torch

from tracker.frame import Frame
from tracker.geometry import Floats, Pose
from tracker.hypotheses import Pairs
from tracker.registration import RegistrationConfig, register_pairs

FEATURES, CORNER_CONTRAST = 800, 8
LEAST_FEATURES = 20  # that match: fewer say nothing about a room
LEAST_SHARE = 0.3  # of them that move alike: the room, not a hand in front of it
ROOM_M = 0.5  # the edges of a sample are at least a share of this long
SAMPLING = RegistrationConfig(threshold_m=0.02, samples=20_000, candidates=1, seeding_below=0)


class CameraMotion:
    """Between the last frame and this one; worked out when it is asked for, once for all objects."""

    def __init__(self) -> None:
        self._last: _Landmarks | None = None
        self._now: _Landmarks | None = None
        self._motion: Pose | None = None
        self._asked = False

    def advance(self, frame: Frame) -> None:
        """The next frame is here."""
        self._last, self._now, self._asked = self._now, _Landmarks(frame), False

    def from_last(self) -> Pose | None:
        """T_now_last, camera coordinates of the last frame -> of this one, by what most of the picture did; None where
        that cannot be said: too little to go by, or too little of it agrees."""
        if not self._asked:
            self._asked = True
            self._motion = _motion(self._last, self._now) if self._last and self._now else None
        return self._motion


class _Landmarks:
    """Corners of a frame that have depth. ORB, Rublee et al., ICCV 2011."""

    def __init__(self, frame: Frame) -> None:
        self._frame = frame

    @cached_property
    def found(self) -> tuple[Floats, npt.NDArray[np.uint8]]:
        """(N, 3) in camera coordinates, metres, and their (N, 32) descriptors."""
        orb = cv2.ORB.create(FEATURES, fastThreshold=CORNER_CONTRAST)
        corners, descriptors = orb.detectAndCompute(cv2.cvtColor(self._frame.rgb, cv2.COLOR_RGB2GRAY), None)  # pyright: ignore[reportCallIssue, reportArgumentType]
        if not corners:
            return np.zeros((0, 3)), np.zeros((0, 32), np.uint8)
        columns, rows = np.array([corner.pt for corner in corners]).T
        depth_m = self._frame.depth_m[np.rint(rows).astype(int), np.rint(columns).astype(int)].astype(np.float64)
        measured = depth_m > 0
        points = self._frame.intrinsics.unproject(columns[measured], rows[measured], depth_m[measured])
        return points, np.asarray(descriptors, np.uint8)[measured]


def _motion(last: _Landmarks, now: _Landmarks) -> Pose | None:
    (points_last, was), (points_now, is_now) = last.found, now.found
    if min(len(was), len(is_now)) < LEAST_FEATURES:
        return None
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(was, is_now)
    if len(matches) < LEAST_FEATURES:
        return None
    before = torch.from_numpy(points_last[[m.queryIdx for m in matches]]).float()
    after = torch.from_numpy(points_now[[m.trainIdx for m in matches]]).float()
    none = torch.zeros_like(before)
    found = register_pairs(Pairs(after, none, before, none), ROOM_M, SAMPLING, torch.Generator().manual_seed(0))
    return found[0].T_cam_obj if found and found[0].inlier_share >= LEAST_SHARE else None
