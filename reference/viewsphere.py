"""Choosing directions that are spread over the viewing sphere. Pure geometry."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import trimesh

from tracker.geometry import Floats, Pose

SAME_RAD = 1e-6  # directions nearer than this are copies
ALIKE_RAD = 0.05  # sets that differ by less than this are equally wide: directions are snapped to a sphere before


def view_direction(T_cam_obj: Pose) -> Floats:
    """(3,) unit vector in object coordinates, from the object's origin towards the camera."""
    towards = T_cam_obj.inverse().translation_m
    return towards / max(float(np.linalg.norm(towards)), 1e-12)


def icosphere_directions(subdivisions: int) -> Floats:
    """(10 * 4^subdivisions + 2, 3) unit vectors, nearly evenly spread."""
    return np.asarray(trimesh.creation.icosphere(subdivisions=subdivisions, radius=1.0).vertices, np.float64)


def nearest_direction(directions: Floats, sphere: Floats) -> npt.NDArray[np.intp]:
    """(N,) index of the sphere's direction (M, 3) nearest to each of the directions (N, 3), the first among equals."""
    return np.argmax(np.round(directions @ sphere.T, 12), axis=1)


def farthest_point_sampling(directions: Floats, count: int, seed: int, worth: Floats | None = None) -> list[int]:
    """Indices of up to count of the unit directions (N, 3), each the farthest by angle from those before it, where an
    angle counts as much as its direction is worth (N,), all alike unless given.

    Starts at seed; among equally far ones the first is taken; stops early when only copies of chosen ones remain.
    """
    worth = np.ones(len(directions)) if worth is None else worth
    chosen = [seed]
    distance_rad = _angles_rad(directions, directions[seed])
    while len(chosen) < min(count, len(directions)):
        farthest = int(np.argmax(np.round(np.where(distance_rad < SAME_RAD, 0, distance_rad * worth), 9)))
        if distance_rad[farthest] < SAME_RAD:
            break
        chosen.append(farthest)
        distance_rad = np.minimum(distance_rad, _angles_rad(directions, directions[farthest]))
    return chosen


def widest_sampling(directions: Floats, count: int, worth: Floats) -> list[int]:
    """Of the farthest-point samplings from every start, in the order of the directions, the first whose least angle
    between two, times the mean worth of all, is the greatest to within ALIKE_RAD. Where one is wanted: the first."""
    starts = range(len(directions)) if count > 1 else range(1)
    samplings = [farthest_point_sampling(directions, count, start, worth) for start in starts]
    return max(samplings, key=lambda c: round(_least_angle_rad(directions[c]) * worth[c].mean() / ALIKE_RAD))


def _least_angle_rad(directions: Floats) -> float:
    """Between two of the directions; nothing where there is one alone."""
    angles = [_angles_rad(directions[k + 1 :], directions[k]).min() for k in range(len(directions) - 1)]
    return float(min(angles, default=0.0))


def _angles_rad(directions: Floats, to: Floats) -> Floats:
    # atan2 keeps its precision at small angles, where arccos of the cosine has none
    return np.arctan2(np.linalg.norm(np.cross(directions, to), axis=1), directions @ to)
