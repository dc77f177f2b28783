"""Models like YCB-V's, made from a seed, and estimates of them that are a centimetre and five degrees off."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from eval.datasets import ObjectModel
from eval.symmetries import ASYMMETRIC, ObjectSymmetries
from tracker.geometry import Floats, Intrinsics, Pose

OBJECTS = 21
CAMERA = Intrinsics(1066.8, 1067.5, 313.0, 241.3, 640, 480)
OFF_DEG, OFF_M = 5.0, 0.01
AXIS = {"axes": [[0, 0, 1]], "offsets_m": [[0, 0, 0]]}
HALF_TURNS = [np.diag(signs) for signs in ((1, -1, -1, 1), (-1, 1, -1, 1), (-1, -1, 1, 1))]
# Of 21 objects eight are symmetric, as in YCB-V: motions to try, 315, 630 and 4.
SYMMETRIES = {
    **dict.fromkeys((1, 14, 18), ObjectSymmetries.listed(**AXIS)),
    **dict.fromkeys((2, 13), ObjectSymmetries.listed(HALF_TURNS[:1], **AXIS)),
    **dict.fromkeys((16, 19, 20), ObjectSymmetries.listed(HALF_TURNS)),
}


def model(number: int, vertices: int) -> ObjectModel:
    """A can, a box or a lump, as the symmetries of the object with that number need it, its vertices spread over its
    surface; nearly all of a can's side are corners of its convex hull, few of a box's are."""
    rng = np.random.default_rng([number, 3])
    symmetries = SYMMETRIES.get(number, ASYMMETRIC)
    half_m = rng.uniform(0.02, 0.1, 3)
    if len(symmetries.axes):
        angles, heights = rng.uniform(0, 2 * np.pi, vertices), rng.uniform(-1.3, 1.3, vertices)
        lid = np.abs(heights) > 1
        radii_m = half_m[0] * np.where(lid, np.sqrt(rng.random(vertices)), 1)
        points_m = np.column_stack(
            (radii_m * np.cos(angles), radii_m * np.sin(angles), half_m[2] * heights.clip(-1, 1))
        )
    elif symmetries.trivial:
        directions = rng.normal(size=(vertices, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        waves = np.sin(directions @ rng.uniform(-9, 9, (3, 6))).sum(axis=1, keepdims=True)
        points_m = directions * half_m * (1 + 0.08 * waves)
    else:
        points_m = rng.uniform(-1, 1, (vertices, 3))
        points_m /= np.abs(points_m).max(axis=1, keepdims=True)
        points_m *= half_m
    diameter_m = 2 * float(np.linalg.norm(points_m, axis=1).max())
    return ObjectModel(points_m, diameter_m, not symmetries.trivial, symmetries)


def poses(number: int, symmetries: ObjectSymmetries, count: int) -> tuple[list[Pose], list[Pose]]:
    """Estimates and truths. An estimate is near to one of the poses that look like the true one."""
    rng = np.random.default_rng([number, count, 7])
    motions = symmetries.motions()
    truths = [Pose(Rotation.random(rng=rng).as_matrix(), _somewhere(rng)) for _ in range(count)]
    estimates = []
    for truth in truths:
        s = int(rng.integers(len(motions)))
        alike = truth @ Pose(motions.turns[s], motions.shifts_m[s])
        off = np.concatenate((_of_length(rng, np.radians(OFF_DEG)), _of_length(rng, OFF_M)))
        estimates.append(alike.nudged(off * rng.exponential()))
    return estimates, truths


def _somewhere(rng: np.random.Generator) -> Floats:
    return np.array([*rng.uniform(-0.15, 0.15, 2), rng.uniform(0.6, 1.1)])


def _of_length(rng: np.random.Generator, length: float) -> Floats:
    direction = rng.normal(size=3)
    return direction * (length / np.linalg.norm(direction))
