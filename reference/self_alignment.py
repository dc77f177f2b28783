"""A model laid upon itself after a turn: where both are known, do surface and paint agree?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from reference.cross_check import cross_check
from tracker.concept import ConceptModel
from tracker.geometry import Floats, Pose
from tracker.saliency.attributes import lab_of
from tracker.symmetry import about

# Lengths are shares of the diameter; models have a point or two at every hundredth of it.
NEAR = 0.03  # along the surface: a neighbour is within it wherever the surface is known
SAME_SURFACE = 0.01  # across the surface: what noise, fusion and a well placed axis leave
SEEN_THROUGH = 0.03  # in depth: farther in front of what a reference view sees is empty space
FINE, WIDE = 0.02, 0.08  # smoothing: against noise and shifted edges; and what light makes rather than paint
SAME_SIDE, SAME_SLOPE = 0.5, 0.87  # cosines: the same side of a wall, and a slope that is the same to 30 degrees
NEIGHBOURS, FINE_NEIGHBOURS, WIDE_NEIGHBOURS = 8, 60, 64
SAMPLE, WIDE_SAMPLE = 1500, 1000
ALIGNING_STEPS = 6
QUANTILE, SPOT_QUANTILE = 90, 98  # a tenth may be edges and highlights of the light, a fiftieth may be anything

# CIE Lab units. Measured between places of the same paint in uneven light: up to 10 in hue, 12 in pattern, 18 in spots;
# where prints meet: 15 and more in hue or in pattern, mostly in both, on cartons of few colours too.
MOST_HUE, MOST_PATTERN, MOST_SPOT = 11.0, 12.5, 20.0
MOST_DENIED = 0.02
LEAST_AGREEMENT = 0.9
LEAST_HOLD = 0.01  # a whole box has ten times that, planes that slide in themselves a third of it (noisy normals)


@dataclass(frozen=True, slots=True)
class TurnEvidence:
    """What speaks for a turn, as shares of the model's points in [0, 1] and in CIE Lab units.

    overlap: meet the model's surface after the turn. agreement: of those that have known surface beside them, meet it.
    denied: lie where a reference view sees that there is nothing. hue: difference in (a, b), pattern: difference in
    (L, a, b) after the mean of the surroundings is taken off, which differs where the light does; not exceeded by nine
    tenths of those that meet. spot: as pattern, not exceeded by all but a fiftieth. hold: how firmly what meets holds
    the body, in the direction in which it does so least, and in the next one.
    """

    overlap: float
    agreement: float
    denied: float
    hue: float
    pattern: float
    spot: float
    hold: tuple[float, float]

    def shape_fits(self, least_overlap: float) -> bool:
        return self.overlap >= least_overlap and self.agreement >= LEAST_AGREEMENT and self.denied <= MOST_DENIED

    def fits(self, least_overlap: float) -> bool:
        paint_fits = self.hue <= MOST_HUE and self.pattern <= MOST_PATTERN and self.spot <= MOST_SPOT
        return paint_fits and self.shape_fits(least_overlap)

    def proves(self, least_overlap: float, free: bool = False) -> bool:
        """Whether it is more than a plane that slides in itself. free: the body may be turned about an axis anyway, so
        that one direction need not be held."""
        return self.fits(least_overlap) and self.hold[1 if free else 0] >= LEAST_HOLD


class SelfAlignment:
    """Holds a model's surface, and its paint smoothed over that."""

    def __init__(self, model: ConceptModel) -> None:
        self._model, self._tree = model, KDTree(model.points)
        self._sample = np.random.default_rng(0).permutation(len(model))[:SAMPLE]
        lab = lab_of(model.colours[None])[0].astype(np.float64)
        everywhere = np.arange(len(model))
        fine = self._smooth(lab, everywhere, FINE, FINE_NEIGHBOURS)
        wide = self._smooth(fine, self._sample[:WIDE_SAMPLE], WIDE, WIDE_NEIGHBOURS)
        self._hue, self._pattern = fine[:, 1:], fine - wide

    def evidence(self, turn: Floats, origin_m: Floats) -> TurnEvidence:
        """Of a rotation (3, 3) about a point (3,), in object coordinates."""
        points = self._turned(turn, origin_m)
        known, index, meets = self._met(points, turn)
        if not meets.any():
            return TurnEvidence(0.0, 0.0, 0.0, np.inf, np.inf, np.inf, (0.0, 0.0))
        a, b = index[meets], self._sample[meets]
        votes = cross_check(points, self._model.references, SEEN_THROUGH * self._model.diameter_m)
        hue, pattern = (np.linalg.norm(lab[a] - lab[b], axis=1) for lab in (self._hue, self._pattern))
        overlap = float(meets.mean())
        return TurnEvidence(
            overlap=overlap,
            agreement=float(meets.sum() / known.sum()),
            denied=float((~votes.kept).mean()),
            hue=float(np.percentile(hue, QUANTILE)),
            pattern=float(np.percentile(pattern, QUANTILE)),
            spot=float(np.percentile(pattern, SPOT_QUANTILE)),
            hold=_hold(points[meets] - origin_m, self._model.normals[a], overlap),
        )

    def aligned(self, axis: Floats, origin_m: Floats, angle_rad: float) -> tuple[Floats, Floats]:
        """A unit axis (3,) and a point on it (3,), moved to where a turn by the angle lays the model best on itself.

        Gauss-Newton on point-to-plane distances of the turned model to the model; the motion found is the turn about
        the better axis, its rotation's axis and its fixed point.
        """
        for _ in range(ALIGNING_STEPS):
            turn = about(axis, angle_rad)
            points = self._turned(turn, origin_m)
            _, index, meets = self._met(points, turn, reach=2)
            if meets.sum() < 6:
                break
            p, q = points[meets] - origin_m, self._model.points[index[meets]] - origin_m
            n = self._model.normals[index[meets]]
            jacobian = np.concatenate((np.cross(p, n), n * self._model.diameter_m), axis=1)
            damped = jacobian.T @ jacobian + 1e-6 * self._model.diameter_m**2 * len(p) * np.eye(6)
            motion = -np.linalg.solve(damped, jacobian.T @ ((p - q) * n).sum(axis=1))
            better = Rotation.from_rotvec(motion[:3]).as_matrix() @ turn
            shift_m = motion[3:] * self._model.diameter_m
            axis = _axis_of(better, axis)
            # (1 - R) o = t, least squares: nothing is said along the axis
            origin_m = origin_m + np.linalg.lstsq(np.eye(3) - about(axis, angle_rad), shift_m, rcond=1e-3)[0]
        return axis, origin_m

    def _turned(self, turn: Floats, origin_m: Floats) -> Floats:
        return Pose(turn, origin_m - turn @ origin_m) @ self._model.points[self._sample]

    def _met(
        self, points: Floats, turn: Floats, reach: float = 1
    ) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
        """Of every turned point (n,): whether known surface of its side is beside it, the nearest point of that, and
        whether it lies on it. reach: times the usual distance across the surface."""
        model, normals = self._model, self._model.normals[self._sample] @ turn.T
        distance_m, index = self._tree.query(points, k=min(NEIGHBOURS, len(model)))
        cosine = np.einsum("nkc,nc->nk", model.normals[index], normals)
        nearest = np.where(cosine > SAME_SIDE, distance_m, np.inf).argmin(axis=1)[:, None]
        index, cosine = (np.take_along_axis(a, nearest, axis=1)[:, 0] for a in (index, cosine))
        distance_m = np.take_along_axis(distance_m, nearest, axis=1)[:, 0]
        across_m = np.abs(((points - model.points[index]) * model.normals[index]).sum(axis=1))
        known = (cosine > SAME_SIDE) & (distance_m < NEAR * model.diameter_m)
        return known, index, known & (cosine > SAME_SLOPE) & (across_m < reach * SAME_SURFACE * model.diameter_m)

    def _smooth(self, values: Floats, sources: npt.NDArray[np.intp], sigma: float, neighbours: int) -> Floats:
        """(N, C) values -> (N, C) means of those at the sources, weighted by a Gaussian of the distance."""
        model = self._model
        distance_m, nearest = KDTree(model.points[sources]).query(model.points, k=min(neighbours, len(sources)))
        index = sources[nearest]
        weights = np.exp(-((distance_m / (sigma * model.diameter_m)) ** 2) / 2)
        weights *= np.einsum("nkc,nc->nk", model.normals[index], model.normals) > 0  # not through thin walls
        total = np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)
        return np.einsum("nk,nkc->nc", weights, values[index]) / total


def _axis_of(turn: Floats, near: Floats) -> Floats:
    """Unit axis (3,) of a rotation, of its two directions the one nearer to another."""
    rotvec = Rotation.from_matrix(turn).as_rotvec()
    axis = rotvec / max(float(np.linalg.norm(rotvec)), 1e-12)
    return axis if axis @ near > 0 else -axis


def _hold(points: Floats, normals: Floats, share: float) -> tuple[float, float]:
    """How firmly surface at points (n, 3), about the origin of a turn, with normals (n, 3) keeps a body in place: the
    two least eigenvalues of its slippage (Gelfand and Guibas, Shape segmentation using local slippage analysis, 2004),
    times that surface's share. A plane, which slides in itself, has none."""
    radius_m = max(float(np.sqrt((points**2).sum(axis=1).mean())), 1e-12)
    jacobian = np.concatenate((np.cross(points / radius_m, normals), normals), axis=1)
    least, next_one = np.linalg.eigvalsh(jacobian.T @ jacobian / len(points))[:2] * share
    return float(least), float(next_one)
