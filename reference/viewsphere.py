"""Choosing directions that are spread over the viewing sphere. Pure geometry."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import trimesh

from tracker.geometry import Floats


def icosphere_directions(subdivisions: int) -> Floats:
    """(10 * 4^subdivisions + 2, 3) unit vectors, nearly evenly spread."""
    return np.asarray(trimesh.creation.icosphere(subdivisions=subdivisions, radius=1.0).vertices, np.float64)


def nearest_direction(directions: Floats, sphere: Floats) -> npt.NDArray[np.intp]:
    """(N,) index of the sphere's direction (M, 3) nearest to each of the directions (N, 3), the first among equals."""
    return np.argmax(np.round(directions @ sphere.T, 12), axis=1)


def farthest_point_sampling(directions: Floats, count: int, seed: int) -> list[int]:
    """Indices of up to count of the unit directions (N, 3), each the farthest by angle from those before it.

    Starts at seed; among equally far ones the first is taken; stops early when only copies of chosen ones remain.
    """
    chosen = [seed]
    distance_rad = _angles_rad(directions, directions[seed])
    while len(chosen) < min(count, len(directions)):
        farthest = int(np.argmax(np.round(distance_rad, 9)))
        if distance_rad[farthest] < 1e-6:
            break
        chosen.append(farthest)
        distance_rad = np.minimum(distance_rad, _angles_rad(directions, directions[farthest]))
    return chosen


def _angles_rad(directions: Floats, to: Floats) -> Floats:
    # atan2 keeps its precision at small angles, where arccos of the cosine has none
    return np.arctan2(np.linalg.norm(np.cross(directions, to), axis=1), directions @ to)
