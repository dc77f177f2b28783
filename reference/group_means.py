"""Weighted means over groups of points, as over those in one voxel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tracker.geometry import Floats


class GroupMeans:
    """group: (N,) the number, below G, of the group that a value is of. weights: (N,)."""

    def __init__(self, group: npt.NDArray[np.intp], weights: Floats) -> None:
        self._group, self._weights, self.total = group, weights, np.bincount(group, weights)

    def __call__(self, values: npt.NDArray) -> Floats:
        """(N, C) -> (G, C)."""
        sums = [np.bincount(self._group, self._weights * column) for column in values.T]
        return np.stack(sums, axis=1) / self.total[:, None]
