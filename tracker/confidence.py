"""How likely a pose is right, within 2 cm and 10 degrees, by what speaks for it.

A logistic model of a handful of measures, each of them without a unit, so that it holds for a cup and for a cereal box.
Its weights were fitted to rendered scenes alone (`python -m eval calibrate`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracker.geometry import Floats
from tracker.refinement import Refined
from tracker.symmetry import Symmetry
from tracker.verification import Evidence

# Fitted before `contradicted` counted unusual light. On poses found after that: AUROC 0.98, calibration error 0.01.
# A fit to those counts colour for less, and took other things for the object where masks were carried in clutter.
MEASURES = ("colour", "contradicted", "explained", "turn_sigma", "turn", "not_expected", "constant")
WEIGHTS = np.array([1.54, -1.63, 0.27, -3.31, -0.76, 0.40, -21.39])
LEAST_INFORMATION = 1e-6  # of a direction that the data leave free
LEAST = 0.02  # a share or an angle nearer to 0 than this says no more than this


@dataclass(frozen=True, slots=True)
class Grounds:
    """What speaks for a pose. evidence: of the picture. turn_sigma_rad: standard deviation of its rotation, by the
    information that refinement had. turn_rad: angle from the nearest pose that was expected, modulo the symmetry; None
    where none was. told_apart: in [0, 1], how surely it is told from poses that are turned otherwise."""

    evidence: Evidence
    turn_sigma_rad: float
    turn_rad: float | None = None
    told_apart: float = 1.0

    def measures(self) -> Floats:
        """(M,) what the confidence is a function of: in the order of `MEASURES`."""
        shares = (_log_odds(s) for s in (self.evidence.colour, self.evidence.contradicted, self.evidence.explained))
        sigma = np.log(np.clip(self.turn_sigma_rad, 1e-4, 1.0))
        turned = (0.0, 1.0) if self.turn_rad is None else (np.log(LEAST + self.turn_rad), 0.0)
        return np.array([*shares, sigma, *turned, 1.0])


def turn_sigma_rad(refined: Refined, symmetry: Symmetry) -> float:
    """Standard deviation of the rotation, without that about the axis of a solid of revolution, which is nobody's."""
    covariance = np.linalg.inv(refined.information + LEAST_INFORMATION * np.eye(6))[:3, :3]
    if symmetry.axis is not None:
        axis_cam = refined.T_cam_obj.rotation @ symmetry.axis
        covariance = covariance - np.outer(axis_cam, axis_cam) * (axis_cam @ covariance @ axis_cam)
    return float(np.sqrt(max(np.trace(covariance), 0.0)))


def confidence(grounds: Grounds) -> float:
    """In [0, 1]."""
    return float(grounds.told_apart / (1 + np.exp(-grounds.measures() @ WEIGHTS)))


def odds(grounds: Grounds) -> float:
    """How many times likelier it is right than wrong, by the measures."""
    return float(np.exp(grounds.measures() @ WEIGHTS))


def _log_odds(share: float) -> float:
    share = float(np.clip(share, LEAST, 1 - LEAST))
    return float(np.log(share / (1 - share)))
