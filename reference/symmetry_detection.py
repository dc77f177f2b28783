"""Is an object the same after a turn? What the model's self-alignment says where it has seen both sides of the turn.

Conservative: what was not seen is not known, and a symmetry that is not known is not declared.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from reference.self_alignment import SelfAlignment
from tracker.concept import ConceptModel
from tracker.errors import ConfigError
from tracker.geometry import Floats
from tracker.revolution import revolution_axis
from tracker.symmetry import NO_SYMMETRY, Symmetry, about

CONTINUUM = 24  # turns that stand for all
ALIGNING_RAD = np.radians(105)  # far enough to tell a tilt, short enough to overlap; no turn of a common polygon
TURNS_A_ROUND = (6, 5, 4, 3, 2)
# Of the points. A single turn that lays a face on itself says nothing of the others: half of what is known has to
# speak. Of the turns about a free axis every one has, so a third at the least will do for each.
LEAST_OVERLAP, LEAST_OVERLAP_OF_EACH = 0.5, 1 / 3
SQUARE_COSINE = np.sin(np.radians(10))  # faces nearer to square than this are taken for square
FACE_COSINE = np.cos(np.radians(10))
FACES = 4
OUTLIERS = 0.5  # percent at each end that do not count for where the middle is


def detect_symmetry(model: ConceptModel) -> Symmetry:
    """The turns after which shape and paint of the model are the same, about an axis that its shape suggests.

    A free axis before single turns; of those the most that hold together. Paint breaks what shape allows: a can with a
    label has no symmetry. NO_SYMMETRY where nothing was found, or too little was seen to know.
    """
    alignment = SelfAlignment(model)
    axis, origin_m = alignment.aligned(*revolution_axis(model), ALIGNING_RAD)
    origin_m = origin_m + axis * (_middle(model.points @ axis) - axis @ origin_m)
    turns = [about(axis, 2 * np.pi * k / CONTINUUM) for k in range(1, CONTINUUM)]
    round_about = [alignment.evidence(turn, origin_m) for turn in turns]
    if all(evidence.fits(LEAST_OVERLAP_OF_EACH) for evidence in round_about):
        swap = about(_square_to(axis), np.pi)
        swaps = [swap] if alignment.evidence(swap, origin_m).proves(LEAST_OVERLAP, free=True) else []
        return Symmetry.generated(swaps, origin_m, axis)
    # The shape fits after any turn, so it says nothing for one of them, and paint that fits by chance is easily found.
    of_revolution = sum(evidence.shape_fits(LEAST_OVERLAP_OF_EACH) for evidence in round_about) > CONTINUUM / 2
    return NO_SYMMETRY if of_revolution else _turns(model, alignment)


def _turns(model: ConceptModel, alignment: SelfAlignment) -> Symmetry:
    """Of all groups that one or more of the candidate axes generate, the largest whose every turn fits."""
    best = NO_SYMMETRY
    for frame in _frames(model):
        origin_m = frame.T @ [_middle(model.points @ axis) for axis in frame]
        rounds = [_most_turns(alignment, axis, origin_m) for axis in frame]
        for k in np.argsort(rounds)[::-1]:
            if rounds[k] > 1:  # what fits is laid on itself as well as it can be
                axis, origin_m = alignment.aligned(frame[k], origin_m, 2 * np.pi / rounds[k])
                frame = frame @ Rotation.align_vectors(axis, frame[k])[0].as_matrix().T
        steps = [about(axis, 2 * np.pi / n) for axis, n in zip(frame, rounds, strict=True) if n > 1]
        for some in (steps, *combinations(steps, 2), *combinations(steps, 1)):
            with suppress(ConfigError):  # turns by 120 and by 90 degrees about square axes belong to no object
                group = Symmetry.generated(some, origin_m)
                if len(group.turns) > len(best.turns) and _fits(alignment, group):
                    best = group
    return best


def _most_turns(alignment: SelfAlignment, axis: Floats, origin_m: Floats) -> int:
    """How many turns a round look the same, 1 where only the whole one does."""
    rounds = (n for n in TURNS_A_ROUND if _fits(alignment, Symmetry.generated([about(axis, 2 * np.pi / n)], origin_m)))
    return next(rounds, 1)


def _fits(alignment: SelfAlignment, group: Symmetry) -> bool:
    return all(alignment.evidence(turn, group.origin_m).proves(LEAST_OVERLAP) for turn in group.turns[1:])


def _frames(model: ConceptModel) -> Iterator[Floats]:
    """Right-angled axes (3, 3), a row each, that the object's symmetry may have: of its points and of its faces."""
    yield np.linalg.eigh(np.cov(model.points.T))[1].T
    yield np.linalg.eigh(model.normals.T @ model.normals)[1].T
    faces = _faces(model.normals)
    for a, b in combinations(faces, 2):
        if abs(a @ b) < SQUARE_COSINE:
            b = b - a * (a @ b)
            b = b / np.linalg.norm(b)
            yield np.stack((a, b, np.cross(a, b)))


def _faces(normals: Floats) -> list[Floats]:
    """The directions (up to sign) that most of the surface faces."""
    faces: list[Floats] = []
    left = normals
    while len(left) and len(faces) < FACES:
        some = left[:: max(1, len(left) // 500)]
        face = some[(np.abs(some @ left.T) > FACE_COSINE).sum(axis=1).argmax()]
        for _ in range(3):
            along = left @ face
            face = (left * np.where(np.abs(along) > FACE_COSINE, np.sign(along), 0)[:, None]).sum(axis=0)
            face = face / np.linalg.norm(face)
        faces.append(face)
        left = left[np.abs(left @ face) <= FACE_COSINE]
    return faces


def _middle(along_m: Floats) -> float:
    return float(np.percentile(along_m, [OUTLIERS, 100 - OUTLIERS]).mean())


def _square_to(axis: Floats) -> Floats:
    """(3,) a unit vector at a right angle to another."""
    return np.asarray(np.linalg.svd(axis[None])[2][1], np.float64)
