"""Poses of a recording, each by all of its measurements: those that came later too.

The smoother of Rauch, Tung and Striebel (Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3, 1965)
on SE(3). The filter goes forward as it does while tracking; then, from the last step to the first, what was learnt
later about the state that a step led to is taken back to it. States are poses with velocities: they are compared and
moved by small deviations in camera axes, as in `tracker.pose_filter`, and only these are linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tracker.geometry import Floats, Pose
from tracker.pose_filter import FilterStep, Prediction, deviation
from tracker.result import TrackResult


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """velocity: (6,) rad/s and m/s. covariance: (12, 12) of deviation and velocity. lasting: as of the filter."""

    T_cam_obj: Pose
    velocity: Floats
    covariance: Floats
    lasting: Floats

    @property
    def pose_covariance(self) -> Floats:
        """(6, 6) of (turn, radians; shift, metres), in camera axes about the object's origin."""
        return self.covariance[:6, :6] + self.lasting


def smooth(steps: Sequence[FilterStep | None]) -> list[Smoothed | None]:
    """The steps of one object's filter, in their order, each by its whole stretch; None where there was none.

    A stretch ends where a frame has no step, as the object was lost there, and where the filter started anew. The last
    of a stretch is as it was.
    """
    found: list[Smoothed | None] = [None] * len(steps)
    for k in reversed(range(len(steps))):
        if (step := steps[k]) is not None:
            after, later = (steps[k + 1], found[k + 1]) if k + 1 < len(steps) else (None, None)
            goes_on = after is not None and after.before is not None and after.run == step.run
            found[k] = _taken_back(step, after.before, later) if goes_on and later else _as_it_was(step)  # pyright: ignore[reportOptionalMemberAccess, reportArgumentType]
    return found


def smooth_results(results: Sequence[TrackResult]) -> list[TrackResult]:
    """The results of a recording, of one object or of several, in their order, with smoothed poses and covariances.

    All else stays: where there was no pose there is none, and confidence and evidence are those of the frame.
    """
    places: dict[str, list[int]] = {}
    for k, result in enumerate(results):
        places.setdefault(result.object_id, []).append(k)
    smoothed = list(results)
    for of_object in places.values():
        for k, found in zip(of_object, smooth([results[k].step for k in of_object]), strict=True):
            if found is not None:
                smoothed[k] = replace(results[k], pose=found.T_cam_obj, covariance=found.pose_covariance)
    return smoothed


def _as_it_was(step: FilterStep) -> Smoothed:
    return Smoothed(step.T_cam_obj, step.velocity, step.covariance, step.lasting)


def _taken_back(step: FilterStep, expected: Prediction, later: Smoothed) -> Smoothed:
    """Equations 3.29 to 3.31 of the paper; the gain maps what was learnt of the next state to this one."""
    scale = np.sqrt(np.diag(expected.covariance))  # radians, metres and their rates are far apart
    scaled = expected.covariance / np.outer(scale, scale)
    gain = np.linalg.solve(scaled, (expected.transition @ step.covariance) / scale[:, None]).T / scale
    learnt = np.concatenate((deviation(later.T_cam_obj, expected.T_cam_obj), later.velocity - expected.velocity))
    change = gain @ learnt
    covariance = step.covariance + gain @ (later.covariance - expected.covariance) @ gain.T
    return Smoothed(
        step.T_cam_obj.nudged(change[:6]), step.velocity + change[6:], (covariance + covariance.T) / 2, step.lasting
    )
