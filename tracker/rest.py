"""Where an object is if it stands still: where it was surest of late, as the camera's motion makes it.

What the picture leaves unsure, as most of the object is hidden or its colours hardly tell a turn, the room tells: its
landmarks give the camera's motion to a degree or so. It is worked out when it is asked for, as it takes a while.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from tracker.camera_motion import CameraMotion, Landmarks
from tracker.geometry import Floats, Pose
from tracker.pose_filter import deviation
from tracker.refinement import Refined
from tracker.symmetry import Symmetry

KEPT = 10  # frames
# A right pose errs by three to five times what noise alone makes of it (YCB-V replay `hard`, a recording), and by more
# than nothing where that is next to nothing; the camera's motion comes on top.
BIAS = 4.0
LEAST = np.diag([0.01**2] * 3 + [0.001**2] * 3)  # covariances of (turn, radians; shift, metres)
CAMERA = np.diag([0.015**2] * 3 + [0.0015**2] * 3)
SAME, STILL = (float(chi2.ppf(probability, 6)) for probability in (0.9999, 0.95))  # what moves slowly is not still
LEAST_INFORMATION = 1e-6  # of a direction that the data leave free


@dataclass(frozen=True, slots=True, eq=False)
class Resting:
    """A pose, and its (6, 6) covariance of (turn, radians; shift, metres) in camera axes about the object's origin."""

    T_cam_obj: Pose
    covariance: Floats

    def agrees(self, other: Resting, gate: float) -> bool:
        """Whether chance alone may set the two so far apart. gate: squared, in standard deviations."""
        apart = deviation(other.T_cam_obj, self.T_cam_obj)
        return float(apart @ np.linalg.solve(self.covariance + other.covariance, apart)) < gate

    def carried(self, T_to_from: Pose) -> Resting:
        """In the coordinates of another camera, whose motion is known about as well as landmarks tell it."""
        turn = np.kron(np.eye(2), T_to_from.rotation)
        return Resting(T_to_from @ self.T_cam_obj, turn @ self.covariance @ turn.T + CAMERA)

    def held(self, refined: Refined | None, symmetry: Symmetry) -> Refined:
        """What the picture says of the pose and that it stands still, together, by how sure each is; the latter alone
        where the picture says nothing, or something else."""
        seen = None if refined is None else refined.nearest(self.T_cam_obj, symmetry)
        if seen is None or not self.agrees(_measured(seen), SAME):
            return Refined(self.T_cam_obj, _information(self.covariance), np.zeros((0, 6)), 0.0, 0)
        measured = _measured(seen)
        gain = self.covariance @ np.linalg.inv(self.covariance + measured.covariance)
        pose = self.T_cam_obj.nudged(gain @ deviation(measured.T_cam_obj, self.T_cam_obj))
        return replace(seen, T_cam_obj=pose, information=_information(self.covariance - gain @ self.covariance))


class Rest:
    """Of one object."""

    def __init__(self) -> None:
        self._kept: deque[tuple[Landmarks | None, Resting]] = deque(maxlen=KEPT)

    def found(self, refined: Refined, camera: CameraMotion) -> None:
        """In this frame, by what the picture shows."""
        self._kept.append((camera.now, _measured(refined)))

    def now(self, camera: CameraMotion, seen: Refined | None, symmetry: Symmetry) -> Resting | None:
        """In this frame; None where it is not known, or has moved of late. seen: what the picture says of it. It is not
        asked of another frame, which takes a while, whether an object moves that is seen where it was."""
        if len(self._kept) < 2:
            return None
        surest = min(self._kept, key=lambda kept: np.linalg.slogdet(kept[1].covariance)[1])
        resting = _carried(*surest, camera)
        if resting is None or (seen and resting.agrees(_measured(seen.nearest(resting.T_cam_obj, symmetry)), STILL)):
            return resting
        again = _carried(*(self._kept[-1] if self._kept[-1] is not surest else self._kept[-2]), camera)
        return resting if again and resting.agrees(again, STILL) else None


def _carried(then: Landmarks | None, resting: Resting, camera: CameraMotion) -> Resting | None:
    motion = camera.since(then)
    return None if motion is None else resting.carried(motion)


def _measured(refined: Refined) -> Resting:
    covariance = np.linalg.inv(refined.information + LEAST_INFORMATION * np.eye(6))
    return Resting(refined.T_cam_obj, BIAS**2 * covariance + LEAST)


def _information(covariance: Floats) -> Floats:
    """As if there were no biases: refinement knows of none."""
    return BIAS**2 * np.linalg.inv(covariance)
