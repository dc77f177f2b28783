"""Iteratively reweighted least squares over small motions of a pose."""

from __future__ import annotations

import numpy as np

from tracker.geometry import Floats, Pose

DAMPING = 1e-3  # of each parameter's own curvature: keeps still what the data leave free


def tukey(residuals: Floats, reach: float) -> Floats:
    """Tukey's biweight: 1 at a residual of 0, 0 from `reach` on. Same shape as the residuals."""
    return np.maximum(1 - (residuals / reach) ** 2, 0) ** 2


class MotionEquations:
    """Normal equations of a small motion of an object, and of an offset of the colour picture against the depth.

    Parameters: turn (3, radians, camera axes, about the object's origin), shift (3, metres), offset (2, pixels). The
    offset is what a colour and a depth camera that are not quite registered or synchronised do to every colour alike;
    it is estimated along and thrown away, so that it does not move the pose where depth holds it.
    """

    def __init__(self) -> None:
        self._matrix, self._vector = np.zeros((8, 8)), np.zeros(8)

    def add(self, arms: Floats, directions: Floats, residuals: Floats, weights: Floats) -> None:
        """Residuals (N,) that a motion d of the point (object origin + arm) lessens by direction . d. Rest: (N, 3)."""
        jacobian = _motion_jacobian(arms, directions)
        weighted = jacobian * weights[:, None]
        self._matrix[:6, :6] += weighted.T @ jacobian
        self._vector[:6] += weighted.T @ residuals

    def add_colour(
        self, arms: Floats, directions: Floats, gradients: Floats, residuals: Floats, weights: Floats
    ) -> None:
        """As `add`, and the residual also lessens by gradient (N, 2) . offset."""
        jacobian = np.concatenate((_motion_jacobian(arms, directions), gradients), axis=1)
        weighted = jacobian * weights[:, None]
        self._matrix += weighted.T @ jacobian
        self._vector += weighted.T @ residuals

    def without_offset(self, offset_information: float) -> tuple[Floats, Floats]:
        """(6, 6) matrix and (6,) vector of the motion alone. offset_information: how surely the offset is nothing, in
        inverse squared pixels. By the Schur complement."""
        offset = self._matrix[6:, 6:] + np.maximum(offset_information, 1e-6) * np.eye(2)
        gain = np.linalg.solve(offset, self._matrix[6:, :6]).T
        return self._matrix[:6, :6] - gain @ self._matrix[6:, :6], self._vector[:6] - gain @ self._vector[6:]


def moved(T_cam_obj: Pose, matrix: Floats, vector: Floats) -> Pose:
    """The pose after the damped least-squares motion that solves matrix x motion = vector."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-12))
    damped = matrix / np.outer(scale, scale) + DAMPING * np.eye(6)
    return T_cam_obj.nudged(np.linalg.solve(damped, vector / scale) / scale)


def _motion_jacobian(arms: Floats, directions: Floats) -> Floats:
    """(N, 6): arm x direction, direction. Written out, as numpy.cross takes four times as long."""
    jacobian = np.empty((len(arms), 6))
    jacobian[:, 3:] = directions
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        jacobian[:, k] = arms[:, i] * directions[:, j] - arms[:, j] * directions[:, i]
    return jacobian
