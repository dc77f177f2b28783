"""Areas under the curve of recall over the error threshold, from 0 to tau, in percent of the whole square.

With errors d_1 <= ... <= d_n and k = #{d_i <= tau}. A missing pose has an infinite error, and counts. No error at or
under tau gives 0; no errors at all give NaN and a warning. Four integrations are in use and they differ by points, so
each has its own name here and a report says which it prints.
"""

from __future__ import annotations

import warnings

import numpy as np
import numpy.typing as npt

from tracker.geometry import Floats

AUC_THRESHOLD_M = 0.1  # Xiang et al. 2018 (PoseCNN), section V


def auc_vocap(errors_m: npt.ArrayLike, threshold_m: float = AUC_THRESHOLD_M) -> float:
    """exact + d_k / (tau n): VOCap of YCB_Video_toolbox, from which DenseFusion and most tables since descend.

    It holds the curve's last value up to tau from 0 on, so the largest error under tau costs nothing.
    """
    errors = _checked(errors_m)
    within = errors[errors <= threshold_m]
    if not within.size:
        return 0.0 if errors.size else np.nan
    return auc_exact(errors, threshold_m) + 100 * float(within.max()) / (threshold_m * errors.size)


def auc_exact(errors_m: npt.ArrayLike, threshold_m: float = AUC_THRESHOLD_M) -> float:
    """(1/n) sum max(0, 1 - d_i / tau): the integral of the step function, as in DLR's ICG and M3T."""
    errors = _checked(errors_m)
    return 100 * float(np.maximum(0.0, 1 - errors / threshold_m).mean()) if errors.size else np.nan


def auc_trapezoid(errors_m: npt.ArrayLike, threshold_m: float = AUC_THRESHOLD_M, steps: int = 100) -> float:
    """Trapezoid rule on steps + 1 thresholds from 0, an error at the threshold within: FoundationPose's helper.

    100 steps up to 0.1 m are its grid of 1 mm.
    """
    errors = _checked(errors_m)
    # Millimetres divided by 1000 are the doubles nearest to the written decimals, so 0.03 m is at the threshold 30 mm.
    thresholds = np.arange(steps + 1) * (threshold_m * 1000 / steps) / 1000
    return 100 * float(np.trapezoid(_recalls(errors <= thresholds[:, None]), dx=1 / steps)) if errors.size else np.nan


def auc_mean_recall(errors_m: npt.ArrayLike, threshold_m: float = AUC_THRESHOLD_M, steps: int = 100) -> float:
    """Mean of the recalls at `steps` equal thresholds up to tau, an error under it within: GDR-Net's and its forks'.

    The thresholds are `np.linspace(tau / steps, tau, steps)`, rounding and all: whether an error that equals a
    threshold to the last written digit is under it is a matter of the last bit, and published numbers have it so.
    """
    errors = _checked(errors_m)
    thresholds = np.linspace(threshold_m / steps, threshold_m, steps)
    return 100 * float(_recalls(errors < thresholds[:, None]).mean()) if errors.size else np.nan


def recall_below(errors_m: npt.ArrayLike, thresholds_m: npt.ArrayLike) -> float:
    """Percent of the errors under the threshold, one for all or one an error (0.1 of each object's diameter)."""
    errors = _checked(errors_m)
    return 100 * float(np.mean(errors < np.asarray(thresholds_m))) if errors.size else np.nan


def share_over(errors_m: npt.ArrayLike, limit_m: float) -> float:
    """Percent of the errors over the limit; a missing pose is."""
    errors = _checked(errors_m)
    return 100 * float(np.mean(errors > limit_m)) if errors.size else np.nan


def _recalls(correct: npt.NDArray[np.bool_]) -> Floats:
    return correct.mean(axis=1)


def _checked(errors_m: npt.ArrayLike) -> Floats:
    """(n,) float64. Raises ValueError where an error is not a number: a missing pose is infinite."""
    errors = np.asarray(errors_m, np.float64)
    if errors.ndim != 1 or np.isnan(errors).any():
        raise ValueError(f"errors are one list of numbers (a missing pose is inf), got shape {errors.shape} with NaN")
    if not errors.size:
        warnings.warn("there is not one instance to score: the result is not a number", RuntimeWarning, stacklevel=1)
    return errors
