"""Is a concept model good enough to track with, and what is it missing?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference.viewsphere import icosphere_directions
from tracker.concept import ConceptModel

SEEN_WITHIN_RAD = np.radians(60)  # a camera this far from a reference direction still sees half of what that saw
LEAST_POINTS = 150
LEAST_AGREEMENT = 0.7
LEAST_SPREAD_RAD = np.radians(15)
LEAST_SHARED = 0.05  # of the points, between views that are near enough to see the same side


@dataclass(frozen=True, slots=True)
class Quality:
    """points: surface points of the model. coverage: share of the viewing sphere within 60 degrees of a reference
    view, in [0, 1]. shared: share of the points that more than one view saw. agreement: mean over those of how well
    the views' concepts agree, in [0, 1]; 1 where there are none. problems: what is missing, in sentences."""

    points: int
    coverage: float
    shared: float
    agreement: float
    problems: tuple[str, ...]

    @property
    def usable(self) -> bool:
        return self.points >= LEAST_POINTS


def judge(model: ConceptModel) -> Quality:
    cosines = icosphere_directions(3) @ model.view_directions.T
    coverage = float((cosines.max(axis=1) > np.cos(SEEN_WITHIN_RAD)).mean())
    several = model.view_count > 1
    shared = float(several.mean()) if len(model) else 0.0
    agreement = float(model.agreement[several].mean()) if several.any() else 1.0
    nearest_rad, spread_rad = _angles_between_views_rad(model)
    problems = []
    if len(model) < LEAST_POINTS:
        problems.append(
            f"only {len(model)} surface points, {LEAST_POINTS} are needed: move the camera closer, "
            "or check that masks and depth lie on the object"
        )
    if len(model.view_directions) == 1:
        problems.append("one reference view: only the side that it shows can be tracked; add a frame from another side")
    elif spread_rad < LEAST_SPREAD_RAD:
        problems.append(
            f"the reference views differ by {np.degrees(spread_rad):.0f} degrees at most: only one side is known"
        )
    if shared < LEAST_SHARED and nearest_rad < SEEN_WITHIN_RAD:
        problems.append(
            f"only {shared:.0%} of the points are seen twice, though two reference views differ by "
            f"{np.degrees(nearest_rad):.0f} degrees only: their poses or masks contradict each other"
        )
    if agreement < LEAST_AGREEMENT:
        problems.append(
            f"the views agree on their shared points to {agreement:.2f} only (1 is perfect): "
            "the poses of the reference frames may be wrong, or the light changed"
        )
    return Quality(len(model), coverage, shared, agreement, tuple(problems))


def _angles_between_views_rad(model: ConceptModel) -> tuple[float, float]:
    """The least and the greatest angle between two reference views; (pi, 0) of a single view."""
    cosines = np.clip(model.view_directions @ model.view_directions.T, -1, 1)
    between = cosines[np.triu_indices(len(cosines), k=1)]
    return float(np.arccos(between.max(initial=-1))), float(np.arccos(between.min(initial=1)))
