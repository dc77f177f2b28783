"""Iteratively reweighted least squares over small motions of a pose."""

from __future__ import annotations

import numpy as np

from tracker.geometry import Floats, Pose

FREE = 20.0  # a direction this many times less certain than the best known one is left free by the data
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
        weighted = jacobian * weights
        self._matrix += weighted @ jacobian.T
        self._vector += weighted @ residuals

    def add_picture(
        self, arms: Floats, along_columns: Floats, along_rows: Floats, structure: Floats, pull: Floats
    ) -> None:
        """Residuals of a picture's channels, which the offset lessens too (Lucas and Kanade, IJCAI 1981).

        along_columns, along_rows: (N, 3) pixels by which a metre of its motion moves a point in the picture. Summed
        over the channels with their weights: structure (3, N), the gradient's square along columns, its product along
        both, its square along rows; pull (2, N), the gradient along columns and along rows times the residual.
        """
        columns, rows = _motion_jacobian(arms, along_columns), _motion_jacobian(arms, along_rows)
        columns[6], rows[7] = 1, 1
        self._matrix += (structure[0] * columns + structure[1] * rows) @ columns.T
        self._matrix += (structure[1] * columns + structure[2] * rows) @ rows.T
        self._vector += columns @ pull[0] + rows @ pull[1]

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


def free_directions(information: Floats, radius_m: float) -> Floats:
    """(k, 6) motions (turn, radians; shift, metres) that information (6, 6) leaves free, the freest first: a can of one
    colour has its turn about the axis, a lone plane three. Each moves a point at the object's radius by about a metre.

    Turns and shifts are compared by how far they move such a point.
    """
    scale = np.array([1 / radius_m] * 3 + [1.0] * 3)
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    return (vectors.T * scale)[values < values[-1] / FREE**2]


def _motion_jacobian(arms: Floats, directions: Floats) -> Floats:
    """(8, N): arm x direction, direction, nothing for the offset. Written out, as numpy.cross takes much longer."""
    jacobian = np.zeros((8, len(arms)))
    (x, y, z), (u, v, w) = arms.T, directions.T
    jacobian[0], jacobian[1], jacobian[2] = y * w - z * v, z * u - x * w, x * v - y * u
    jacobian[3:6] = directions.T
    return jacobian
