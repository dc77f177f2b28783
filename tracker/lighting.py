"""How much the colours of a surface differ from a model's once the light that falls on it is taken off."""

from __future__ import annotations

import numpy as np

from tracker.frame import Mask
from tracker.geometry import Floats

NO_LIGHT = np.array((-16.0, 0.0, 0.0))  # in Lab, where the cube root would be straight on to 0
GAIN_RANGE = (0.5, 2.0)  # of Lab colours
GAIN_SIGMA, OFFSET_SIGMA = 0.5, 25.0
RATIO_SIGMA = 0.08  # how far the ratio of two brightnesses strays where the colours are the same
RIDGE = 0.015  # what a slope of 1 costs, in points: what only a few points speak for stays small
ROUNDS = 3
LIGHTNESS_SHARE = 0.6  # of a difference in Lab: light changes it more than hue
LEAST_POINTS = 20  # fewer say nothing of the light


def colours_apart(lab: Floats, model_lab: Floats, normals: Floats, known: Mask) -> tuple[Floats, float]:
    """(N,) differences in Lab between colours (N, 3) and a model's of points with these normals (N, 3), and in [0, 1]
    how usual it is that the light differs as it does. known: (N,) bool, the points by which the light is found.

    Light that comes from everywhere and from somewhere makes brightness a linear function of the normal, to a few
    percent (Ramamoorthi and Hanrahan, SIGGRAPH 2001, of the first order); a cast of colour is the same everywhere. Lab
    is a cube root of light: light that is k times as bright makes (L + 16, a, b) cbrt(k) times as large.
    """
    if np.count_nonzero(known) < LEAST_POINTS:
        return np.full(len(lab), np.inf), 0.0
    ratio = (lab[:, 0] - NO_LIGHT[0]) / (model_lab[:, 0] - NO_LIGHT[0])
    gain = float(np.clip(np.median(ratio[known]), *GAIN_RANGE))
    gains = np.clip(_shading(ratio, normals, known, gain), *GAIN_RANGE)
    expected = gains[:, None] * (model_lab - NO_LIGHT) + NO_LIGHT
    offset = np.median((lab - expected)[known], axis=0)
    apart = np.linalg.norm((lab - expected - offset) * (LIGHTNESS_SHARE, 1, 1), axis=1)
    drift = np.linalg.norm(offset * (0.3, 1, 1))
    return apart, float(np.exp(-0.5 * ((np.log(gain) / GAIN_SIGMA) ** 2 + (drift / OFFSET_SIGMA) ** 2)))


def _shading(ratio: Floats, normals: Floats, known: Mask, gain: float) -> Floats:
    """(N,) the ratios that light makes of itself: those known, as a linear function of the normal, in spite of those
    that print or a shadow makes (weights of Cauchy's)."""
    terms = np.column_stack((np.ones(len(normals)), normals))
    seen, ratios = terms[known], ratio[known]
    ridge = np.diag((1e-9, *[RIDGE * len(ratios)] * 3))
    light = np.array((gain, 0.0, 0.0, 0.0))
    for _ in range(ROUNDS):
        weighted = seen / (1 + ((ratios - seen @ light) / RATIO_SIGMA) ** 2)[:, None]
        light = np.linalg.solve(weighted.T @ seen + ridge, weighted.T @ ratios)
    return terms @ light
