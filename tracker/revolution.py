"""The axis about which an object's shape is nearly the same after any turn: a mug's, but for its handle.

What such an object looks like after a turn is the pose that is most easily taken for its own.
"""

from __future__ import annotations

import numpy as np

from tracker.concept import ConceptModel
from tracker.geometry import Floats, Pose
from tracker.symmetry import about

# Of the diameter, how far the normals of a solid of revolution may miss its axis: less at every step, so that a handle
# neither counts in the end nor decides at the start.
FITTING_SIGMAS = np.geomspace(0.3, 0.01, 15)
TURNS = 16  # a round: a refinement finds what lies between two of them


def revolution_axis(model: ConceptModel) -> tuple[Floats, Floats]:
    """Unit axis (3,) and a point (3,) on it that the normals of the surface meet, as those of a solid of revolution do.

    The line through p along n meets the axis (a through o, moment m = o x a) where n . m + (p x n) . a = 0 (Pottmann
    and Randrup, Rotational and helical surface approximation for reverse engineering, Computing 60, 1998): least
    squares with |a| = 1 and m eliminated, reweighted so that a handle does not count (Geman-McClure).
    """
    centre_m = model.points.mean(axis=0)
    points, normals = (model.points - centre_m) / model.diameter_m, model.normals
    moments, weights = np.cross(points, normals), np.ones(len(model))
    axis, moment = np.array([0.0, 0.0, 1.0]), np.zeros(3)
    for sigma in FITTING_SIGMAS:
        of_axis, mixed = (weights[:, None] * moments).T @ moments, (weights[:, None] * normals).T @ moments
        to_moment = -np.linalg.pinv((weights[:, None] * normals).T @ normals, rcond=1e-4, hermitian=True) @ mixed
        axis = np.linalg.eigh(of_axis + mixed.T @ to_moment)[1][:, 0]
        moment = to_moment @ axis
        missed = normals @ moment + moments @ axis
        weights = 1 / (1 + (missed / sigma) ** 2) ** 2
    return axis, centre_m + np.cross(axis, moment) * model.diameter_m


class Turns:
    """Of one model about that axis."""

    def __init__(self, model: ConceptModel) -> None:
        axis, origin_m = revolution_axis(model)
        turns = [about(axis, 2 * np.pi * k / TURNS) for k in range(1, TURNS)]
        self._turns = [] if model.symmetry.axis is not None else [Pose(R, origin_m - R @ origin_m) for R in turns]

    def of(self, T_cam_obj: Pose) -> list[Pose]:
        """The other poses that the shape hardly tells from this one; none where nothing else could, either."""
        return [T_cam_obj @ turn for turn in self._turns]
