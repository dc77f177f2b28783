"""Logistic regression: the chance that a pose is right, as a function of what speaks for it."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from tracker.errors import ConfigError
from tracker.frame import Mask
from tracker.geometry import Floats

PENALTY = 1e-3  # of standardised measures: what one pose in a thousand would lose


def fit(measures: Floats, right: Mask, weights: Floats, penalty: float = PENALTY) -> Floats:
    """(M,) weights of the measures (N, M), so that expit(measures @ weights) is the chance of being right (N,).

    The minimum of sum_n v_n log(1 + exp(-y_n x_n w)) + penalty / 2 sum_m (s_m w_m)^2, with y = 1 for right and -1 for
    wrong, v the weights (N,) of the rows over their sum, and s the measures' standard deviations: a measure in other
    units gives the same chances, and measures that part right from wrong in all rows have finite weights. A measure
    that never changes, the constant, is not penalised. Raises ConfigError where all are right, or none.
    """
    if right.all() or not right.any():
        raise ConfigError(f"of {len(right)} poses {'all' if right.any() else 'none'} are right: nothing to tell apart")
    share = weights / weights.sum()
    spread, largest = np.sqrt(share @ (measures - share @ measures) ** 2), np.abs(measures).max(axis=0)
    varies = spread > 1e-9 * largest
    scale = np.where(varies, spread, np.where(largest > 0, largest, 1.0))
    standard, signs, ridge = measures / scale, np.where(right, 1.0, -1.0), penalty * varies

    def loss(w: Floats) -> tuple[float, Floats]:
        margins = signs * (standard @ w)
        slope = -(share * signs * expit(-margins)) @ standard
        return float(share @ np.logaddexp(0, -margins) + 0.5 * ridge @ w**2), slope + ridge * w

    options = {"gtol": 1e-9, "ftol": 1e-15, "maxiter": 5000}
    return minimize(loss, np.zeros(measures.shape[1]), jac=True, method="L-BFGS-B", options=options).x / scale


def chances(measures: Floats, weights: Floats) -> Floats:
    """(N,) of being right, by measures (N, M) and their weights (M,)."""
    return expit(measures @ weights)
