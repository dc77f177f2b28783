"""Whose pixels are whose: what one object explains is not searched for another, and no two are in one place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from tracker.frame import Mask

SAME_PIXELS = 0.5  # of those that either explains: two objects that share more are in one place


def claimed_by_others(shown: Sequence[Mask | None]) -> list[Mask | None]:
    """shown: of every object the pixels (H, W) that it explains, None where it is not followed. Of every object the
    pixels that any other one explains, None where there are none."""
    claimed: list[Mask | None] = []
    for k in range(len(shown)):
        others = [mask for j, mask in enumerate(shown) if j != k and mask is not None]
        claimed.append(np.logical_or.reduce(others) if others else None)
    return claimed


def in_one_place(shown: Sequence[Mask | None]) -> Iterator[tuple[int, int]]:
    """Pairs of objects, by position, that explain the same pixels."""
    for (a, one), (b, other) in combinations([(k, m) for k, m in enumerate(shown) if m is not None], 2):
        shared = np.count_nonzero(one & other)
        if shared > SAME_PIXELS * np.count_nonzero(one | other):
            yield a, b
