"""Correspondences with a known answer, most of them wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tracker.geometry import Floats, Pose

RADII_M = np.array([0.10, 0.06, 0.04])
DIAMETER_M = 0.2
NOISE_M = 0.002


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """points_cam: (N, 3) of the cloud. points_obj: (N, 3) the model's, to which they are said to correspond."""

    points_cam: Floats
    points_obj: Floats
    T_cam_obj: Pose

    def errors(self, found: Pose | None) -> tuple[float, float]:
        """Degrees and metres; infinite without a pose."""
        if found is None:
            return float("inf"), float("inf")
        return float(np.degrees(found.angle_to_rad(self.T_cam_obj))), found.distance_to_m(self.T_cam_obj)


def problem(seed: int, count: int, outliers: float) -> Problem:
    """Points of an ellipsoid of 20 x 12 x 8 cm with 2 mm of noise. A share `outliers` of them is said to correspond to
    any point of the surface."""
    rng = np.random.default_rng([seed, 11])
    directions = rng.normal(size=(count, 3))
    surface = directions / np.linalg.norm(directions, axis=1, keepdims=True) * RADII_M
    T_cam_obj = Pose(Rotation.random(rng=rng).as_matrix(), np.array([0.1, -0.05, 0.8]))
    seen = T_cam_obj @ (surface + rng.normal(size=surface.shape) * NOISE_M)
    wrong = rng.random(count) < outliers
    index = np.where(wrong, rng.integers(count, size=count), np.arange(count))
    return Problem(seen, surface[index], T_cam_obj)
