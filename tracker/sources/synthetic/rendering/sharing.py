"""Light that was found at every second pixel, spread to all: only pixels of the same surface share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tracker.sources.synthetic.rendering.raycast import Float32s

TILE = 4  # a pixel took one of TILE x TILE rays; the mean over any tile holds them all
SAME_DISTANCE = 0.03  # of the distance
Owners = npt.NDArray[np.int16]


def shared(found: Sequence[Float32s], owner: Owners, distance: Float32s) -> list[Float32s]:
    """Values at every second pixel of every second row -> (H, W) each, smooth on every surface.

    owner, distance: (H, W), what tells surfaces apart.
    """
    coarse_owner, coarse_distance = owner[::2, ::2], distance[::2, ::2]
    smooth = _mean(found, coarse_owner, coarse_distance, coarse_owner, coarse_distance, TILE // 2, TILE)
    full = [np.empty(owner.shape, np.float32) for _ in found]
    for row in range(2):
        for column in range(2):
            part = (slice(row, None, 2), slice(column, None, 2))
            values = _mean(smooth, coarse_owner, coarse_distance, owner[part], distance[part], 0, 2)
            for target, spread in zip(full, values, strict=True):
                target[part] = spread
    return full


def _mean(
    values: Sequence[Float32s],
    owner: Owners,
    distance: Float32s,
    target_owner: Owners,
    target_distance: Float32s,
    before: int,
    size: int,
) -> list[Float32s]:
    """Mean over `size` x `size` values, from `before` to the left of and above each target on, that see its surface."""
    shape = target_owner.shape
    pad = ((before, size), (before, size))
    owners, distances = np.pad(owner, pad, constant_values=-9), np.pad(distance, pad)
    padded = [np.pad(value, pad, mode="edge") for value in values]
    tolerance = SAME_DISTANCE * target_distance
    totals = [np.zeros(shape, np.float32) for _ in values]
    weights = np.zeros(shape, np.float32)
    for row in range(size):
        for column in range(size):
            window = (slice(row, row + shape[0]), slice(column, column + shape[1]))
            same = (owners[window] == target_owner) & (np.abs(distances[window] - target_distance) < tolerance)
            share = same.astype(np.float32) + np.float32(1e-4)  # where nobody sees the surface, all count
            weights += share
            for total, value in zip(totals, padded, strict=True):
                total += share * value[window]
    return [total / weights for total in totals]
