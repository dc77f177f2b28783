"""The pose over time: an error-state Kalman filter on SE(3) with real time steps.

The pose itself is kept as a rotation and a translation; the filter's state is a small deviation from it and the
velocities, (turn, shift, angular velocity, velocity), in camera axes about the object's origin. After each update the
deviation is moved into the pose (Sola, Quaternion kinematics for the error-state Kalman filter, 2017, chapter 6).

How wildly an object may move is not known beforehand: what lies on a table is still, what is in a hand is not. Several
levels of acceleration are weighed by how well each expects the measurements, and the process noise is their mean
(multiple models as in Bar-Shalom et al., Estimation with Applications to Tracking and Navigation, 2001, 11.6; merged
before each step, GPB1, where models differ in nothing but noise). So there is one Gaussian, which can be smoothed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from filterpy.kalman import KalmanFilter
from pydantic import BaseModel, ConfigDict, Field
from scipy.stats import chi2

from tracker.geometry import Floats, Pose, rotation_vector

START_SPEED_MPS, START_TURN_RADPS = 0.5, 2.0  # how fast an object may be when it is first seen
LEVELS = np.array([1.0, 0.2, 0.04, 0.01])  # shares of the greatest acceleration that may be all there is
UNKNOWN = 1e-6  # information below this share of a least sigma's is none
WHITE = 0.01  # share of the least variances that is taken for noise: no measurement is without


class FilterConfig(BaseModel):
    """acceleration_mps2, acceleration_radps2: standard deviation of the greatest unknown acceleration between object
    and camera; how much of it there is, down to a hundredth, the filter finds out. calm_s: mean time
    for which the motion stays as wild, or as calm, as it is. gate: probability that a true measurement lies within the
    gate. least_sigma_m, least_sigma_rad: what a measurement errs by beside its noise (calibration, the model): no
    number of frames makes a pose surer. longest_gap_s: after a longer silence the velocity is forgotten."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    acceleration_mps2: float = Field(default=5.0, gt=0)
    acceleration_radps2: float = Field(default=30.0, gt=0)
    calm_s: float = Field(default=0.1, gt=0)
    gate: float = Field(default=0.9999, gt=0, lt=1)
    least_sigma_m: float = Field(default=0.0003, gt=0)
    least_sigma_rad: float = Field(default=0.003, gt=0)
    longest_gap_s: float = Field(default=0.5, gt=0)


@dataclass(frozen=True, slots=True, eq=False)
class FilterStep:
    """All that the filter knew after a measurement, for smoothing: see `tracker.smoothing`.

    velocity: (6,) rad/s and m/s. covariance: (12, 12) of deviation and velocity. lasting: (6, 6) covariance of what
    stays wrong with the pose however often it is measured. run: number of the start since which the filter has gone on
    without another. before: the prediction from the step before, None at a start.
    """

    T_cam_obj: Pose
    velocity: Floats
    covariance: Floats
    lasting: Floats
    run: int
    before: Prediction | None


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Where a step was expected to lead. transition: (12, 12) of the deviations. velocity, covariance: as after."""

    T_cam_obj: Pose
    velocity: Floats
    covariance: Floats
    transition: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """covariance: (6, 6) of (turn, radians; shift, metres), in camera axes about the object's origin. squared_distance:
    of the measurement to the prediction, in standard deviations (Mahalanobis), of as many numbers as the measurement
    knows. within_gate: whether it was used. step: None where it was not."""

    T_cam_obj: Pose
    covariance: Floats
    squared_distance: float
    within_gate: bool
    step: FilterStep | None


@dataclass(frozen=True, slots=True, eq=False)
class _Measurement:
    """rows: (k, 12), what of the deviation is known; noise, error: (k, k) covariances, of what changes from frame to
    frame and of all."""

    rows: Floats
    noise: Floats
    error: Floats


class PoseFilter:
    """One object's pose. Empty until `start`."""

    def __init__(self, config: FilterConfig) -> None:
        self._config = config
        self._least = np.array([config.least_sigma_rad] * 3 + [config.least_sigma_m] * 3)
        self._lasting = np.diag((1 - WHITE) * self._least**2)
        self._pose: Pose | None = None
        self._stamp_ns, self._run = 0, 0
        self._kalman = KalmanFilter(dim_x=12, dim_z=6)
        self._weights = np.full(len(LEVELS), 1 / len(LEVELS))
        self._gates = [np.inf, *(float(chi2.ppf(config.gate, known)) for known in range(1, 7))]

    def start(self, T_cam_obj: Pose, information: Floats, stamp_ns: int) -> Filtered:
        """Begin, or begin again, at a measured pose with unknown velocity."""
        self._pose, self._stamp_ns, self._run = T_cam_obj, stamp_ns, self._run + 1
        self._weights = np.full(len(LEVELS), 1 / len(LEVELS))
        values, vectors = self._known(information)
        self._kalman.x = np.zeros((12, 1))
        self._kalman.P = np.zeros((12, 12))
        self._kalman.P[:6, :6] = (vectors * (WHITE + 1 / np.maximum(values, UNKNOWN))) @ vectors.T
        self._kalman.P[:6, :6] *= np.outer(self._least, self._least)
        self._kalman.P[6:, 6:] = np.diag([START_TURN_RADPS**2] * 3 + [START_SPEED_MPS**2] * 3)
        return self._filtered(T_cam_obj, 0.0, None)

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

        A measurement outside the gate leaves the filter as it was. Of a direction in which there is no information
        nothing is taken, whatever the measured pose is there.
        """
        predicted, step_s = self.predict(stamp_ns), self._step_s(stamp_ns)
        if predicted is None or step_s is None:
            return self.start(T_cam_obj, information, stamp_ns)
        measured = self._measurement(information)
        innovation = measured.rows[:, :6] @ deviation(T_cam_obj, predicted)
        transition, noise = np.eye(12) + np.eye(12, k=6) * step_s, self._process_noise(step_s)
        moved = transition @ self._kalman.P @ transition.T
        widest = measured.rows @ (moved + noise) @ measured.rows.T + measured.error
        if (squared := _squared(innovation, widest)) > self._gates[len(innovation)]:
            return Filtered(predicted, self._kalman.P[:6, :6] + self._lasting, squared, False, None)
        self._weigh(innovation, measured, moved, noise, step_s)
        self._kalman.predict(F=transition, Q=noise * float(self._weights @ LEVELS**2))
        self._kalman.x[:6] = 0  # the deviation from `predicted`, which has moved by the velocity already
        before = Prediction(predicted, self._kalman.x[6:, 0].copy(), self._kalman.P.copy(), transition)
        if len(innovation):
            squared = _squared(innovation, measured.rows @ before.covariance @ measured.rows.T + measured.noise)
            self._kalman.update(innovation[:, None], R=measured.noise, H=measured.rows)
        self._pose, self._stamp_ns = predicted.nudged(self._kalman.x[:6, 0]), stamp_ns
        self._kalman.x[:6] = 0
        return self._filtered(self._pose, squared, before)

    def _filtered(self, T_cam_obj: Pose, squared: float, before: Prediction | None) -> Filtered:
        velocity, P = self._kalman.x[6:, 0].copy(), (self._kalman.P + self._kalman.P.T) / 2
        step = FilterStep(T_cam_obj, velocity, P, self._lasting, self._run, before)
        return Filtered(T_cam_obj, P[:6, :6] + self._lasting, squared, True, step)

    def _step_s(self, stamp_ns: int) -> float | None:
        """Seconds since the last measurement that was used, None where they are too many."""
        step_s = (stamp_ns - self._stamp_ns) / 1e9
        return step_s if step_s <= self._config.longest_gap_s else None

    def _known(self, information: Floats) -> tuple[Floats, Floats]:
        """Eigenvalues and vectors of the information in least sigmas: 1 is as certain as these."""
        scaled = information * np.outer(self._least, self._least)
        return np.linalg.eigh((scaled + scaled.T) / 2)

    def _measurement(self, information: Floats) -> _Measurement:
        """Of the directions alone in which there is information: one that is free takes no part."""
        values, vectors = self._known(information)
        known = values > UNKNOWN
        rows = np.zeros((int(known.sum()), 12))
        rows[:, :6] = vectors[:, known].T / self._least
        noise = np.diag(WHITE + 1 / values[known])
        return _Measurement(rows, noise, noise + (1 - WHITE) * np.eye(len(noise)))

    def _weigh(self, innovation: Floats, measured: _Measurement, moved: Floats, noise: Floats, step_s: float) -> None:
        """Probabilities of the levels after the innovation: Bayes' rule, on what they have become since the last."""
        same = np.exp(-step_s / self._config.calm_s)
        logs = np.log(same * self._weights + (1 - same) / len(LEVELS))
        for k, level in enumerate(LEVELS):
            expected = measured.rows @ (moved + level**2 * noise) @ measured.rows.T + measured.noise
            logs[k] -= (_squared(innovation, expected) + np.linalg.slogdet(expected)[1]) / 2
        weights = np.exp(logs - logs.max())
        self._weights = weights / weights.sum()

    def _process_noise(self, step_s: float) -> Floats:
        """Discrete white acceleration over a step (Bar-Shalom et al., Estimation with Applications, 2001, 6.3.2)."""
        config = self._config
        variance = np.diag([config.acceleration_radps2**2] * 3 + [config.acceleration_mps2**2] * 3)
        gain = np.array([[step_s**4 / 4, step_s**3 / 2], [step_s**3 / 2, step_s**2]])
        return np.asarray(np.kron(gain, variance), np.float64)


def deviation(T_cam_obj: Pose, origin: Pose) -> Floats:
    """(6,) turn and shift from one pose to another in camera axes: `origin.nudged` of it is the pose."""
    turn = rotation_vector(T_cam_obj.rotation @ origin.rotation.T)
    return np.concatenate((turn, T_cam_obj.translation_m - origin.translation_m))


def _squared(innovation: Floats, covariance: Floats) -> float:
    return float(innovation @ np.linalg.solve(covariance, innovation)) if len(innovation) else 0.0
