"""How well a pose explains the picture, whatever correspondences or prediction it came from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from tracker.appearance import ViewAppearance, model_appearance
from tracker.concept import ConceptModel
from tracker.geometry import Floats, Pose
from tracker.lighting import colours_apart
from tracker.projection import CELL_PX as SELF_HIDDEN_PX
from tracker.projection import nearest_pixels, not_self_hidden, project
from tracker.surroundings import goes_on
from tracker.view import ObjectView


class VerificationConfig(BaseModel):
    """model_points: how many are looked at. depth_sigma: distance at which a surface still agrees, as a share of the
    diameter, at least depth_sigma_least_m. lab_sigma: colour difference at which it still agrees. colour_share: how
    much colour decides of the score, its exponent: at 0 geometry decides alone, at 1 another colour is worth as little
    as another place."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    model_points: int = Field(default=1000, ge=50)
    depth_sigma: float = Field(default=0.03, gt=0)
    depth_sigma_least_m: float = Field(default=0.003, gt=0)
    lab_sigma: float = Field(default=12.0, gt=0)
    colour_share: float = Field(default=0.7, ge=0, le=1)

    def sigma_m(self, diameter_m: float) -> float:
        """Distance at which a surface still agrees."""
        return max(self.depth_sigma * diameter_m, self.depth_sigma_least_m)


@dataclass(frozen=True, slots=True)
class Evidence:
    """score: in [0, 1], share of the model's surface that should be seen and is, in place and in colour, times what
    `explained` makes it worth: a model need not know all that is seen, but where it knows next to nothing it has proved
    nothing.
    surface: the same in place alone. colour: agreement of the colours where the place agrees. contradicted: share of
    the surface in place that has clearly another colour, or where the light would have to be most unusual.
    seen_through: share where the picture shows something behind the model. outside: share that should be seen and lies
    outside the mask. hidden: share of the camera-facing model that something in front hides. explained: share of the
    object's measured pixels on which a part of the model lies in place. proved: how much of the model's surface is in
    place, as a share of the most that it can show at once. goes_on: share of a ring around what is in place where what
    is seen goes on, see `tracker.surroundings`; 0 where it was not asked for."""

    score: float
    surface: float
    colour: float
    contradicted: float
    seen_through: float
    outside: float
    hidden: float
    explained: float
    proved: float
    goes_on: float = 0.0

    @property
    def of_itself(self) -> float:
        """In [0, 1], what speaks for a pose where nobody knows which pixels are the object's: how much of the model is
        in place and in colour, and how little of what should be is not."""
        return self.score / max(float(worth(self.explained)), 1e-9) * float(np.sqrt(self.proved))


NOTHING_SEEN = Evidence(0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
UNKNOWN, LEAST_EXPLAINED = 0.5, 0.3
FACING_LEAST = 0.2  # cosine of incidence: more grazing surfaces are not judged
REACH = 2.5  # standard deviations of depth within which a surface is in place
CONTRADICTS = float(np.exp(-2))  # agreement at two lab_sigma: a colour that agrees less is another
CELL_PX = 3  # of a view of the usual resolution: the sampled points of a surface leave no cell of this size empty


@dataclass(frozen=True, slots=True, eq=False)
class JudgedSurface:
    """(N, 3) each, of points of a model: places, normals, CIE L*a*b*. They are spread evenly, and so are the first ones
    of them, however many."""

    points: Floats
    normals: Floats
    lab: Floats


class Verifier:
    """Judges poses of one model. Each point counts by the cosine of its incidence: grazing surfaces prove little."""

    def __init__(self, model: ConceptModel, config: VerificationConfig, pixels_across: int) -> None:
        self._config, self._diameter_m, self._pixels_across = config, model.diameter_m, pixels_across
        chosen = evenly(model.points, config.model_points)
        lab = model_appearance(model, pixels_across).fine
        self.surface = JudgedSurface(model.points[chosen], model.normals[chosen], lab[chosen])
        self._most = most_shown(self.surface.normals)
        self._sigma_m = config.sigma_m(model.diameter_m)

    def __call__(
        self, T_cam_obj: Pose, view: ObjectView, appearance: ViewAppearance, *, around: bool = False
    ) -> Evidence:
        """around: whether to look at what is around it, too."""
        judged = self.surface
        at = project(judged.points, judged.normals, T_cam_obj, view.camera)
        faces = (at.facing > FACING_LEAST) & (at.points_cam[:, 2] > 0)
        if not faces.any():
            return NOTHING_SEEN
        finer = max(1.0, view.pixels_across / self._pixels_across)  # than usual, where little of the object shows
        faces &= not_self_hidden(at, self._diameter_m, SELF_HIDDEN_PX * finer)
        rows, columns = nearest_pixels(at, view.camera)
        on_object = at.within(view.camera, 0) & view.inside[rows, columns]
        measured_m = np.where(on_object, view.depth_m[rows, columns], _frame_depth_m(at.points_cam, view))
        behind_m = np.where(measured_m > 0, measured_m - at.points_cam[:, 2], 0.0)
        reach_m = REACH * self._sigma_m
        hidden = faces & ~on_object & (behind_m < -reach_m)
        due = faces & ~hidden
        weights = at.facing * due
        total = weights.sum()
        if total <= 0:
            return NOTHING_SEEN
        in_place = due & on_object & (measured_m > 0) & (np.abs(behind_m) < reach_m)
        surface = weights * in_place * np.exp(-0.5 * (behind_m / self._sigma_m) ** 2)
        apart, usual = colours_apart(
            appearance.fine.lab[rows, columns], self.surface.lab, self.surface.normals, in_place
        )
        colour = usual * np.exp(-0.5 * (apart / self._config.lab_sigma) ** 2)
        met = max(float(surface.sum()), 1e-9)
        agreed = float((surface * colour**self._config.colour_share).sum() / total)
        met_px = rows[in_place], columns[in_place]
        explained = _explained(*met_px, view, round(CELL_PX * finer))
        return Evidence(
            score=agreed * float(worth(explained)),
            surface=float(surface.sum() / total),
            colour=float((surface * colour).sum() / met),
            contradicted=float((surface * (colour < CONTRADICTS)).sum() / met),
            seen_through=float((weights * (on_object & (behind_m > reach_m))).sum() / total),
            outside=float((weights * ~on_object).sum() / total),
            hidden=float((at.facing * hidden).sum() / (at.facing * faces).sum()),
            explained=explained,
            proved=float(weights[in_place].sum() / self._most),
            goes_on=goes_on(*met_px, appearance.fine.lab, view, finer) if around else 0.0,
        )


def worth(explained: npt.ArrayLike) -> Floats:
    """In [0, 1], of one share or of many. What a model does not know counts half of what it gets wrong, so that the
    true pose of an object that shows an unknown side is not beaten by a wrong one that shows a known side; under a
    third explained, worth falls with the square."""
    shares = np.asarray(explained, np.float64)
    return shares / (shares + UNKNOWN * (1 - shares)) * np.minimum(1.0, shares / LEAST_EXPLAINED) ** 2


def _explained(rows: np.ndarray, columns: np.ndarray, view: ObjectView, cell_px: int) -> float:
    """Share of the object's measured pixels in whose cell there is one of these pixels (N,)."""
    height, width = view.depth_m.shape
    across = width // cell_px + 1
    cells = (height // cell_px + 1) * across
    measured = np.nonzero(view.has_depth)
    area = np.bincount(measured[0] // cell_px * across + measured[1] // cell_px, minlength=cells)
    met = np.bincount(rows // cell_px * across + columns // cell_px, minlength=cells) > 0
    return float(area[met].sum() / max(area.sum(), 1))


def _frame_depth_m(points_cam: np.ndarray, view: ObjectView) -> np.ndarray:
    """(N,) depth of the frame, not of the view, where points project to; 0 outside the frame."""
    camera = view.frame.intrinsics
    depth_m = np.maximum(points_cam[:, 2], 1e-6)
    columns = np.rint(points_cam[:, 0] / depth_m * camera.fx + camera.cx)
    rows = np.rint(points_cam[:, 1] / depth_m * camera.fy + camera.cy)
    inside = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    clipped = (np.where(inside, rows, 0).astype(np.intp), np.where(inside, columns, 0).astype(np.intp))
    return np.where(inside, view.frame.depth_m[clipped], 0.0)


def evenly(points: np.ndarray, most: int) -> np.ndarray:
    """Indices of up to `most` of the points (N, 3), each the farthest from those before it: sides that were seen from
    afar have fewer points, and are to count as much."""
    chosen = np.zeros(min(most, len(points)), np.intp)
    apart = np.full(len(points), np.inf)
    for k in range(1, len(chosen)):
        apart = np.minimum(apart, np.square(points - points[chosen[k - 1]]).sum(axis=1))
        chosen[k] = apart.argmax()
    return chosen


def most_shown(normals: np.ndarray) -> float:
    """The largest weight of points (N, 3) that face a camera from any direction."""
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cosines = normals @ directions.T
    return float(np.where(cosines > FACING_LEAST, cosines, 0).sum(axis=0).max())
