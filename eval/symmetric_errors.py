"""Errors that take the best over an object's symmetries: MSSD, MSPD and the rotation error.

MSSD and MSPD: Hodan et al. 2020, "BOP Challenge 2020 on 6D Object Localization", section 2.2. They are a minimum over
up to 630 motions of a maximum over thousands of vertices, and exact, but few of the pairs are looked at: the error at
some vertices is a lower bound of the maximum over all of them. The motion of the least bound is measured in full; the
vertex where it is worst raises the bounds of the others; when no bound is under the best maximum, that is the minimum.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from eval.metrics import rotation_error_deg, stack
from eval.symmetries import Motions, ObjectSymmetries
from tracker.geometry import Floats, Intrinsics, Pose

Ints = npt.NDArray[np.int64]

WIDTH_PX = 640  # to which BOP scales the images whose projections are compared
FIRST_BOUNDS = 12  # vertices, far from each other, whose errors are the first bounds


def mssd(points_m: Floats, motions: Motions, estimated: Sequence[Pose], truth: Sequence[Pose]) -> Floats:
    """Maximum symmetry-aware surface distance: min_S max_x |T_est x - T_gt S x|, (K,) in metres.

    points_m: (N, 3) model points in object coordinates. Only their convex hull is looked at: the length of a difference
    of two affine maps is a convex function of x, so it is largest at a vertex of the hull.
    """
    corners_m = points_m[_hull(points_m)]
    first = _far_apart(corners_m)
    moved_m = _moved(motions, corners_m[first])

    def one(turn: Floats, shift_m: Floats, true_turn: Floats, true_shift_m: Floats) -> float:
        estimated_m = corners_m @ turn.T + shift_m

        def at_vertex(vertex: int) -> Floats:
            return _squares(motions.of_point(corners_m[vertex]) @ true_turn.T + true_shift_m - estimated_m[vertex])

        def in_full(s: int) -> Floats:
            turned, shifted_m = true_turn @ motions.turns[s], true_turn @ motions.shifts_m[s] + true_shift_m
            return _squares(corners_m @ turned.T + shifted_m - estimated_m)

        if len(motions) == 1:
            return float(in_full(0).max())
        bounds = _squares(moved_m @ true_turn.T + true_shift_m - estimated_m[first]).max(axis=1)
        return _least_maximum(bounds, at_vertex, in_full)

    return np.sqrt([one(*each) for each in zip(*stack(estimated), *stack(truth), strict=True)]).reshape(-1)


def mspd(
    points_m: Floats,
    motions: Motions,
    estimated: Sequence[Pose],
    truth: Sequence[Pose],
    cameras: Sequence[Intrinsics],
) -> Floats:
    """Maximum symmetry-aware projection distance: min_S max_x |proj(T_est x) - proj(T_gt S x)|, (K,) in pixels of an
    image 640 pixels wide. Infinite where a point has no projection. points_m: (N, 3), all of which count."""
    first = _far_apart(points_m)
    moved_m = _moved(motions, points_m[first])

    def one(turn: Floats, shift_m: Floats, true_turn: Floats, true_shift_m: Floats, camera: Intrinsics) -> float:
        estimated_px = _projected(points_m @ turn.T + shift_m, camera)

        def at_vertex(vertex: int) -> Floats:
            moved = motions.of_point(points_m[vertex]) @ true_turn.T + true_shift_m
            return _squares(_projected(moved, camera) - estimated_px[vertex])

        def in_full(s: int) -> Floats:
            turned, shifted_m = true_turn @ motions.turns[s], true_turn @ motions.shifts_m[s] + true_shift_m
            return _squares(_projected(points_m @ turned.T + shifted_m, camera) - estimated_px)

        if len(motions) == 1:
            return float(in_full(0).max())
        bounds = _squares(_projected(moved_m @ true_turn.T + true_shift_m, camera) - estimated_px[first]).max(axis=1)
        return _least_maximum(bounds, at_vertex, in_full)

    pairs = zip(*stack(estimated), *stack(truth), cameras, strict=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        errors_px = np.sqrt([one(*each) for each in pairs]).reshape(-1)
    return errors_px * (WIDTH_PX / np.array([camera.width for camera in cameras], np.float64))


def symmetric_rotation_error_deg(
    symmetries: ObjectSymmetries, estimated: Sequence[Pose], truth: Sequence[Pose]
) -> Floats:
    """The least angle between R_est and R_gt S over all symmetries S, (K,) in degrees.

    Turns about an axis a are not stepped through: let (w, v) be the unit quaternion of D R_est^T R_gt with a discrete
    turn D. The best turn about a leaves the angle 2 atan2(|v x a|, hypot(w, v . a)): its twist about a is undone.
    """
    discrete = [Pose(turn, np.zeros(3)) for turn in symmetries.discrete.turns]
    if not len(symmetries.axes):
        angles = [rotation_error_deg(estimated, [pose @ turn for pose in truth]) for turn in discrete]
        return np.min(angles, axis=0)
    relative = stack(estimated)[0].transpose(0, 2, 1) @ stack(truth)[0]
    least = np.full(len(relative), np.inf)
    for turn in symmetries.discrete.turns if len(relative) else ():
        wxyz = Rotation.from_matrix(turn @ relative).as_quat(scalar_first=True)
        for axis in symmetries.axes:
            left = np.linalg.norm(np.cross(wxyz[:, 1:], axis), axis=1)
            least = np.minimum(least, 2 * np.arctan2(left, np.hypot(wxyz[:, 0], wxyz[:, 1:] @ axis)))
    return np.degrees(least)


def _least_maximum(bounds: Floats, at_vertex: Callable[[int], Floats], in_full: Callable[[int], Floats]) -> float:
    """Least over the motions of the largest error over the vertices.

    bounds: (S,) lower bounds of the maxima. at_vertex: the errors of all motions at one vertex, (S,). in_full: the
    errors of one motion at all vertices.
    """
    best = np.inf
    while (s := int(bounds.argmin())) >= 0 and bounds[s] < best:
        errors = in_full(s)
        worst = int(errors.argmax())
        best = min(best, float(errors[worst]))
        bounds = np.maximum(bounds, at_vertex(worst))
        bounds[s] = np.inf
    return best


def _hull(points_m: Floats) -> Ints:
    """Indices of the corners of the convex hull; of all points where they have none, as in a plane."""
    try:
        return np.asarray(ConvexHull(points_m).vertices, np.int64)
    except (QhullError, ValueError):  # flat, or fewer than four points
        return np.arange(len(points_m))


def _far_apart(points_m: Floats) -> Ints:
    """Indices of a few points by farthest-point sampling, first the one that is farthest from the middle."""
    chosen = [int(_squares(points_m - points_m.mean(axis=0)).argmax())]
    distances = _squares(points_m - points_m[chosen[0]])
    while len(chosen) < min(FIRST_BOUNDS, len(points_m)):
        chosen.append(int(distances.argmax()))
        distances = np.minimum(distances, _squares(points_m - points_m[chosen[-1]]))
    return np.array(chosen)


def _moved(motions: Motions, points_m: Floats) -> Floats:
    """(S, N, 3) points after every motion."""
    return points_m @ motions.turns.transpose(0, 2, 1) + motions.shifts_m[:, None]


def _projected(points_cam: Floats, camera: Intrinsics) -> Floats:
    """(..., 3) metres -> (..., 2) pixels from the principal point, which cancels in differences."""
    return points_cam[..., :2] / points_cam[..., 2:] * (camera.fx, camera.fy)


def _squares(vectors: Floats) -> Floats:
    """Squared lengths along the last axis; what is not a number is infinite."""
    squares = np.einsum("...i,...i->...", vectors, vectors)
    return np.where(np.isnan(squares), np.inf, squares)
