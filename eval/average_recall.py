"""BOP's average recalls: the mean of recalls over ten thresholds, in [0, 1]. An error *under* a threshold is correct.

Hodan et al. 2020, "BOP Challenge 2020 on 6D Object Localization", section 2.4. The text there has MSPD's thresholds in
shares of the image; those in use, also by the BOP server, are 5 to 50 pixels at a width of 640.
A missing pose has an infinite error, and counts; of no error at all the average is not a number.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tracker.geometry import Floats

SHARES = np.arange(1, 11) / 20  # of the diameter for MSSD, of the surface for VSD: 0.05, 0.10 .. 0.50
PIXELS = 5.0 * np.arange(1, 11)


def ar_mssd(errors_m: npt.ArrayLike, diameters_m: npt.ArrayLike) -> float:
    """errors_m: (K,). diameters_m: (K,) of each instance's object."""
    return _average(np.asarray(errors_m), SHARES[:, None] * np.asarray(diameters_m))


def ar_mspd(errors_px: npt.ArrayLike) -> float:
    """errors_px: (K,) in images 640 pixels wide."""
    return _average(np.asarray(errors_px), PIXELS[:, None])


def ar_vsd(errors: npt.ArrayLike) -> float:
    """errors: (K, 10), VSD at each of the ten misalignments; the mean is over those and the ten thresholds."""
    return _average(np.asarray(errors, np.float64).ravel(), SHARES[:, None])


def _average(errors: Floats, thresholds: Floats) -> float:
    return float(np.mean(errors < thresholds)) if errors.size else np.nan
