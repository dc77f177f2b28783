"""Overlap of the posed bounding boxes: intersection over union of two boxes that may stand at any angle, exact.

The box is the axis-aligned one of the model in object coordinates, carried by each of the two poses.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from eval.metrics import stack
from eval.symmetries import Motions
from tracker.geometry import Floats, Pose

NOCS_STEPS = 20  # a round, about the axis of a symmetric object: Wang et al. 2019, `compute_3d_iou_new`
SLACK = 1e-10  # of the box: what rounding may put a corner outside by that lies on the other box's face
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
EDGES = np.array([(a, b) for a in range(8) for b in range(a) if np.abs(CORNERS[a] - CORNERS[b]).sum() == 1])


def box_iou(points_m: Floats, motions: Motions, estimated: Sequence[Pose], truth: Sequence[Pose]) -> Floats:
    """Intersection over union in [0, 1] of the two posed boxes, the best over the motions S of the truth, (K,).

    points_m: (N, 3) model points in object coordinates. motions: symmetries; about an axis NOCS tries 20 turns. A model
    without a volume has no overlap: 0.
    """
    low_m, high_m = points_m.min(axis=0), points_m.max(axis=0)
    size_m = high_m - low_m
    if not size_m.min() > 0:
        return np.zeros(len(estimated))
    turns, shifts_m = _distinct(motions, low_m, size_m)
    (estimated_turns, estimated_shifts_m), (true_turns, true_shifts_m) = stack(estimated), stack(truth)
    # From the unit cube of the estimate's box to the frame of the true box: solved, as rotations may be rounded.
    relative = np.linalg.solve(true_turns, estimated_turns)
    offsets_m = np.linalg.solve(true_turns, (estimated_shifts_m - true_shifts_m)[..., None])[..., 0]
    best = np.zeros(len(relative))
    for turn, shift_m in zip(turns, shifts_m, strict=True):
        back = np.linalg.inv(turn)
        linear = back @ relative
        corner_m = linear @ low_m + (offsets_m - shift_m) @ back.T
        best = np.maximum(best, _iou(linear * size_m / size_m[:, None], (corner_m - low_m) / size_m))
    return best


def _distinct(motions: Motions, low_m: Floats, size_m: Floats) -> tuple[Floats, Floats]:
    """Of the motions, those that put the box differently: a box turned by half about its middle is where it was."""
    corners_m = (low_m + CORNERS * size_m) @ motions.turns.transpose(0, 2, 1) + motions.shifts_m[:, None]
    places = np.round(corners_m / (1e-9 * size_m.max())).astype(np.int64)
    kept: dict[bytes, int] = {}
    for s, place in enumerate(places):
        kept.setdefault(place[np.lexsort(place.T)].tobytes(), s)
    chosen = list(kept.values())
    return motions.turns[chosen], motions.shifts_m[chosen]


def _iou(linear: Floats, offsets: Floats) -> Floats:
    """(K,) of the unit cube and its images under the affine maps x -> linear @ x + offset, (K, 3, 3) and (K, 3)."""
    inverse = np.linalg.inv(linear)
    images = CORNERS @ linear.transpose(0, 2, 1) + offsets[:, None]
    preimages = (CORNERS - offsets[:, None]) @ inverse.transpose(0, 2, 1)
    cube = np.broadcast_to(CORNERS, images.shape)
    # Every corner of the intersection lies on an edge of one box, at one end of what the other box leaves of it.
    points = np.concatenate((_clipped(images, images), _clipped(preimages, cube)), axis=1)
    shared = np.array([_hull_volume(each[~np.isnan(each[:, 0])]) for each in points]).reshape(-1)
    return np.clip(shared / (1 + np.abs(np.linalg.det(linear)) - shared), 0, 1)


def _clipped(corners: Floats, shown: Floats) -> Floats:
    """(K, 24, 3) ends of what of the edges of boxes, whose corners are (K, 8, 3), is within the unit cube, as places on
    the edges of `shown` (K, 8, 3); NaN where nothing is. Slab method."""
    start, step = corners[:, EDGES[:, 0]], corners[:, EDGES[:, 1]] - corners[:, EDGES[:, 0]]
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (-SLACK - start) / step, (1 + SLACK - start) / step
    parallel, within = step == 0, (start >= -SLACK) & (start <= 1 + SLACK)
    enter = np.where(parallel, np.where(within, -np.inf, np.inf), np.minimum(one, other)).max(axis=-1).clip(min=0)
    leave = np.where(parallel, np.where(within, np.inf, -np.inf), np.maximum(one, other)).min(axis=-1).clip(max=1)
    enter, leave = (np.where(enter <= leave, ends, np.nan)[..., None] for ends in (enter, leave))
    base, along = shown[:, EDGES[:, 0]], shown[:, EDGES[:, 1]] - shown[:, EDGES[:, 0]]
    return np.concatenate((base + enter * along, base + leave * along), axis=1)


def _hull_volume(points: Floats) -> float:
    if len(points) < 4:
        return 0.0
    try:
        return float(ConvexHull(points).volume)
    except QhullError:  # the boxes touch in a face, an edge or a corner
        return 0.0
