"""How the camera moved since an earlier frame, by what stands still in both.

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
LEAST_SHARE = 0.15  # of them that move alike: chance does not bring so many together
ROOM_M = 0.5  # the edges of a sample are at least a share of this long
MOST_MATCHES = 200  # the most alike
SAMPLING = RegistrationConfig(
    threshold_m=0.02, samples=5000, solved=300, confidence=0.9999, candidates=1, seeding_below=0
)


class CameraMotion:
    """From earlier frames to this one; worked out when it is asked for, once for all objects."""

    def __init__(self) -> None:
        self._now: Landmarks | None = None
        self._last: Landmarks | None = None
        self._known: dict[Landmarks, Pose | None] = {}  # by identity

    @property
    def now(self) -> Landmarks | None:
        """This frame's, to ask for the motion since then in later ones."""
        return self._now

    def advance(self, frame: Frame) -> None:
        """The next frame is here."""
        self._last, self._now, self._known = self._now, Landmarks(frame), {}

    def from_last(self) -> Pose | None:
        """T_now_last, as `since` the frame before this one."""
        return self.since(self._last)

    def since(self, then: Landmarks | None) -> Pose | None:
        """T_now_then, camera coordinates of an earlier frame -> of this one, by what most of the picture did; None
        where that cannot be said: too little to go by, or too little of it agrees."""
        if then is None or self._now is None:
            return None
        if then not in self._known:
            self._known[then] = Pose.identity() if then is self._now else _motion(then, self._now)
        return self._known[then]


class Landmarks:
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


def _motion(then: Landmarks, now: Landmarks) -> Pose | None:
    (points_then, was), (points_now, is_now) = then.found, now.found
    if min(len(was), len(is_now)) < LEAST_FEATURES:
        return None
    matches = cv2.BFMatcher(cv2.NORM_HAMMING).match(was, is_now)  # one way: sampling sorts out what is not mutual
    if len(matches) < LEAST_FEATURES:
        return None
    matches = sorted(matches, key=lambda match: match.distance)[:MOST_MATCHES]
    before = torch.from_numpy(points_then[[m.queryIdx for m in matches]]).float()
    after = torch.from_numpy(points_now[[m.trainIdx for m in matches]]).float()
    none = torch.zeros_like(before)
    found = register_pairs(Pairs(after, none, before, none), ROOM_M, SAMPLING, torch.Generator().manual_seed(0))
    return found[0].T_cam_obj if found and found[0].inlier_share >= LEAST_SHARE else None
