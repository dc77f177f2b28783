"""Errors of an estimated pose against the true one, for many instances of one object at once.

Definitions: BOP's (Hodan et al. 2016, "On Evaluation of 6D Object Pose Estimation"; `pose_error.py` of bop_toolkit).
Every function takes equally long sequences of estimated and of true `T_cam_obj` and gives one error an instance.
Nothing here knows of symmetries: `eval.symmetric_errors` holds the errors that minimise over them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import small_gicp
from scipy.spatial import KDTree

from tracker.geometry import Floats, Pose

NEAR = 0.2  # of the diagonal of the model's box: up to such a shift of the middle one tree is faster than another


def add(points_m: Floats, estimated: Sequence[Pose], truth: Sequence[Pose]) -> Floats:
    """ADD: mean over the model points x of |T_est x - T_gt x|, in metres.

    points_m: (N, 3) model points in object coordinates. Returns (K,) for K pairs of poses.
    """
    turns, shifts_m = stack(estimated)
    true_turns, true_shifts_m = stack(truth)
    turns, shifts_m = turns - true_turns, shifts_m - true_shifts_m
    return np.array([_mean_length(points_m @ turns[k].T + shifts_m[k]) for k in range(len(turns))])


def adds(points_m: Floats, estimated: Sequence[Pose], truth: Sequence[Pose], queries_m: Floats | None = None) -> Floats:
    """ADD-S (ADI): mean over the model points x of min over the model points y of |T_est y - T_gt x|, in metres.

    The direction is ground truth -> estimate; the other one gives another number. A rigid motion keeps distances, so
    they are measured in the object frame of the estimate, with the points moved by inv(T_est) @ T_gt: the KD-tree over
    the model is built once and serves every instance.

    points_m: (N, 3) model points in object coordinates. queries_m: (M, 3) points x over which the mean is taken, where
    a part of the model shall stand for all of it. Returns (K,) for K pairs of poses.
    """
    turns, shifts_m = stack(estimated)
    true_turns, true_shifts_m = stack(truth)
    # Solved, not transposed: a rotation read from a rounded file is a rotation to three digits only.
    turns, shifts_m = np.linalg.solve(turns, true_turns), np.linalg.solve(turns, (true_shifts_m - shifts_m)[..., None])
    points_m = points_m[KDTree(points_m).indices]  # neighbours beside each other in memory save a third of the time
    queries_m = points_m if queries_m is None else queries_m
    mean_distance = _MeanDistance(points_m)
    return np.array([mean_distance(queries_m @ turns[k].T + shifts_m[k, :, 0]) for k in range(len(turns))])


def rotation_error_deg(estimated: Sequence[Pose], truth: Sequence[Pose]) -> Floats:
    """Angle of R_est R_gt^T in degrees, (K,) in [0, 180].

    From sine and cosine together: the arc cosine of the trace alone loses half the digits near 0 and near 180.
    """
    relative = stack(estimated)[0] @ stack(truth)[0].transpose(0, 2, 1)
    skew = relative - relative.transpose(0, 2, 1)
    sine = np.linalg.norm(skew[:, [2, 0, 1], [1, 2, 0]], axis=1) / 2
    cosine = (np.trace(relative, axis1=1, axis2=2) - 1) / 2
    return np.degrees(np.arctan2(sine, cosine))


def translation_error_m(estimated: Sequence[Pose], truth: Sequence[Pose]) -> Floats:
    """Distance of the object origins in metres, (K,)."""
    return np.linalg.norm(stack(estimated)[1] - stack(truth)[1], axis=1)


def stack(poses: Sequence[Pose]) -> tuple[Floats, Floats]:
    """Rotations (K, 3, 3) and translations (K, 3) in metres; K may be 0."""
    rotations = np.array([pose.rotation for pose in poses], np.float64).reshape(-1, 3, 3)
    return rotations, np.array([pose.translation_m for pose in poses], np.float64).reshape(-1, 3)


def _mean_length(vectors: Floats) -> float:
    return float(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)).mean())


class _MeanDistance:
    """Mean distance of points to their nearest ones of a model, by whichever tree is faster; both are exact.

    On scans of 8,000 vertices small_gicp's takes half of the time of scipy's where poses are good, and ten times as
    long where they are far off. In one thread: on a busy machine those of OpenMP wait for each other.
    """

    def __init__(self, points_m: Floats) -> None:
        self._near = small_gicp.KdTree(np.ascontiguousarray(points_m, np.float64))
        self._far = KDTree(points_m, leafsize=32, balanced_tree=False, compact_nodes=False)
        self._middle_m = points_m.mean(axis=0)
        self._reach_m = NEAR * float(np.linalg.norm(np.ptp(points_m, axis=0)))

    def __call__(self, points_m: Floats) -> float:
        if np.linalg.norm(points_m.mean(axis=0) - self._middle_m) > self._reach_m:
            return float(np.mean(self._far.query(points_m, workers=-1)[0]))
        squares = self._near.batch_nearest_neighbor_search(points_m, num_threads=1)[1]
        return float(np.sqrt(squares).mean())
