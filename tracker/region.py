"""Where on an object a concept is: a region of its surface that a robot can reach for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from tracker.geometry import Floats, Pose

LEAST_SALIENCY = 0.1  # a concept that is nowhere clearer than this is not on the object
CLEAR, FAINT = 0.5, 0.2  # of the clearest: a region has points of the first kind, and grows over the second
CLEAREST = 0.99  # quantile that stands for the clearest, so that one odd point does not decide
ENDS = (0.02, 0.98)  # quantiles between which a region extends
GAP = 0.15  # of the diameter: parts farther apart than this are two regions; less may be a stretch that nobody saw


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """A connected part of an object's surface where a concept is.

    label: the concept. points: (M, 3) metres, in the coordinates that the caller asked for. weights: (M,) in [0, 1],
    how clearly it is there. axes: (3, 3), its columns the principal axes, the longest first. extent_m: (3,) length
    along each, without the outermost points. centre_m: (3,) middle of the box that they span, which does not depend on
    how densely its parts were seen. share: of all the points of the concept, by weight, those in this region: 1 where
    the object has it in one place only.
    """

    label: str
    points: Floats
    weights: Floats
    centre_m: Floats
    axes: Floats
    extent_m: Floats
    share: float

    def moved(self, T_to_from: Pose) -> Region:
        """The same region in other coordinates."""
        return replace(
            self,
            points=T_to_from @ self.points,
            centre_m=(T_to_from @ self.centre_m[None])[0],
            axes=T_to_from.rotation @ self.axes,
        )


@dataclass(frozen=True, slots=True, eq=False)
class SeenRegion:
    """A region of an object in a frame. obj: in object coordinates. cam: in camera coordinates. visible: share of its
    points, by weight, that the camera sees, in [0, 1]; 0 where it is turned away, hidden or outside the picture."""

    obj: Region
    cam: Region
    visible: float


def region_of(label: str, points: Floats, saliency: Floats, diameter_m: float) -> Region | None:
    """The heaviest connected part of the points (N, 3) where the saliency (N,) is clear and around, None where it is
    clear nowhere.

    diameter_m: of the object.
    """
    clearest = float(np.quantile(saliency, CLEAREST)) if len(saliency) else 0.0
    if clearest < LEAST_SALIENCY:
        return None
    faint = np.flatnonzero(saliency >= FAINT * clearest)
    weights = np.minimum(saliency[faint] / clearest, 1.0)
    part = _parts(points[faint], GAP * diameter_m)
    heavy = np.bincount(part, weights) * (np.bincount(part, weights >= CLEAR) > 0)
    chosen = part == heavy.argmax()
    points, weights = points[faint][chosen], weights[chosen]
    mean_m = np.average(points, axis=0, weights=weights)
    spread = (points - mean_m).T @ ((points - mean_m) * weights[:, None])
    axes = np.linalg.eigh(spread)[1][:, ::-1]
    axes[:, 2] *= np.linalg.det(axes)  # right-handed
    low, high = np.quantile((points - mean_m) @ axes, ENDS, axis=0)
    centre_m = mean_m + axes @ (low + high) / 2
    return Region(label, points, weights, centre_m, axes, high - low, float(heavy.max() / heavy.sum()))


def _parts(points: Floats, reach_m: float) -> np.ndarray:
    """(N,) number of the connected part of each point."""
    pairs = KDTree(points).query_pairs(reach_m, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    return np.asarray(connected_components(links, directed=False)[1])
