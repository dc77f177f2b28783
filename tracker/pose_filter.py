"""The pose over time: an error-state Kalman filter on SE(3) with real time steps.

The pose itself is kept as a rotation and a translation; the filter's state is a small deviation from it and the
velocities, (turn, shift, angular velocity, velocity), in camera axes about the object's origin. After each update the
deviation is moved into the pose (Sola, Quaternion kinematics for the error-state Kalman filter, 2017, chapter 6).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from filterpy.kalman import KalmanFilter
from pydantic import BaseModel, ConfigDict, Field
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from tracker.geometry import Floats, Pose

START_SPEED_MPS, START_TURN_RADPS = 0.5, 2.0  # how fast an object may be when it is first seen


class FilterConfig(BaseModel):
    """acceleration_mps2, acceleration_radps2: standard deviation of the unknown acceleration between object and
    camera. gate: probability that a true measurement lies within the gate. least_sigma_m, least_sigma_rad: no
    measurement is trusted more than this, whatever its information says (calibration, unseen bias). longest_gap_s:
    after a longer silence the velocity is forgotten."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    acceleration_mps2: float = Field(default=5.0, gt=0)
    acceleration_radps2: float = Field(default=30.0, gt=0)
    gate: float = Field(default=0.9999, gt=0, lt=1)
    least_sigma_m: float = Field(default=0.0003, gt=0)
    least_sigma_rad: float = Field(default=0.003, gt=0)
    longest_gap_s: float = Field(default=0.5, gt=0)


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """covariance: (6, 6) of (turn, radians; shift, metres), in camera axes about the object's origin. squared_distance:
    of the measurement to the prediction, in standard deviations (Mahalanobis). within_gate: whether it was used."""

    T_cam_obj: Pose
    covariance: Floats
    squared_distance: float
    within_gate: bool


class PoseFilter:
    """One object's pose. Empty until `start`."""

    def __init__(self, config: FilterConfig) -> None:
        self._config = config
        self._pose: Pose | None = None
        self._stamp_ns = 0
        self._kalman = KalmanFilter(dim_x=12, dim_z=6)
        self._kalman.H = np.eye(6, 12)
        self._gate = float(chi2.ppf(config.gate, 6))

    def start(self, T_cam_obj: Pose, information: Floats, stamp_ns: int) -> Filtered:
        """Begin, or begin again, at a measured pose with unknown velocity."""
        self._pose, self._stamp_ns = T_cam_obj, stamp_ns
        self._kalman.x = np.zeros((12, 1))
        self._kalman.P = np.zeros((12, 12))
        self._kalman.P[:6, :6] = self._measurement_covariance(information)
        self._kalman.P[6:, 6:] = np.diag([START_TURN_RADPS**2] * 3 + [START_SPEED_MPS**2] * 3)
        return Filtered(T_cam_obj, self._kalman.P[:6, :6].copy(), 0.0, True)

    def clear(self) -> None:
        self._pose = None

    def predict(self, stamp_ns: int) -> Pose | None:
        """The pose expected at a time, None before the start. After a long gap: where it was. Changes nothing."""
        step_s = self._step_s(stamp_ns)
        if self._pose is None or step_s is None:
            return self._pose
        return self._pose.nudged(self._kalman.x[6:, 0] * step_s)

    def update(self, T_cam_obj: Pose, information: Floats, stamp_ns: int) -> Filtered:
        """Take in a measurement and its (6, 6) information; the first, and one after a long gap, starts the filter.

        A measurement outside the gate leaves the filter as it was.
        """
        predicted, step_s = self.predict(stamp_ns), self._step_s(stamp_ns)
        if predicted is None or step_s is None:
            return self.start(T_cam_obj, information, stamp_ns)
        x, P = self._kalman.x.copy(), self._kalman.P.copy()
        self._kalman.predict(F=np.eye(12) + np.eye(12, k=6) * step_s, Q=self._process_noise(step_s))
        self._kalman.x[:6] = 0  # the deviation from `predicted`, which has moved by the velocity already
        innovation = np.concatenate(
            (
                Rotation.from_matrix(T_cam_obj.rotation @ predicted.rotation.T).as_rotvec(),
                T_cam_obj.translation_m - predicted.translation_m,
            )
        )
        noise = self._measurement_covariance(information)
        squared = float(innovation @ np.linalg.solve(self._kalman.P[:6, :6] + noise, innovation))
        if squared > self._gate:
            self._kalman.x, self._kalman.P = x, P
            return Filtered(predicted, P[:6, :6].copy(), squared, False)
        self._kalman.update(innovation, R=noise)
        self._pose, self._stamp_ns = predicted.nudged(self._kalman.x[:6, 0]), stamp_ns
        self._kalman.x[:6] = 0
        return Filtered(self._pose, self._kalman.P[:6, :6].copy(), squared, True)

    def _step_s(self, stamp_ns: int) -> float | None:
        """Seconds since the last measurement that was used, None where they are too many."""
        step_s = (stamp_ns - self._stamp_ns) / 1e9
        return step_s if step_s <= self._config.longest_gap_s else None

    def _measurement_covariance(self, information: Floats) -> Floats:
        """Inverse of the information, no direction more certain than the least sigmas nor less than a free one."""
        least = np.array([self._config.least_sigma_rad] * 3 + [self._config.least_sigma_m] * 3)
        scaled = information * np.outer(least, least)  # 1 = as certain as the least sigma
        values, vectors = np.linalg.eigh((scaled + scaled.T) / 2)
        variances = 1 + 1 / np.maximum(values, 1e-6)
        return np.asarray((vectors * variances) @ vectors.T * np.outer(least, least), np.float64)

    def _process_noise(self, step_s: float) -> Floats:
        """Discrete white acceleration over a step (Bar-Shalom et al., Estimation with Applications, 2001, 6.3.2)."""
        config = self._config
        variance = np.diag([config.acceleration_radps2**2] * 3 + [config.acceleration_mps2**2] * 3)
        gain = np.array([[step_s**4 / 4, step_s**3 / 2], [step_s**3 / 2, step_s**2]])
        return np.asarray(np.kron(gain, variance), np.float64)
