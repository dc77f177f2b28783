"""Masks of a source that has them in every frame, as of one that points each object out once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from tracker.frame import Frame

LEAST_PX = 400  # as of a reference frame: what is pointed out has to be seen


class FirstMasks:
    """Takes from every frame the masks of objects that were pointed out in an earlier one, or are in another way."""

    def __init__(self, pointed_out: Iterable[str] = ()) -> None:
        self._pointed_out = set(pointed_out)

    def __call__(self, frame: Frame) -> Frame:
        """The frame with the masks of those objects alone of which enough is seen for the first time."""
        first = {o: m for o, m in frame.masks.items() if o not in self._pointed_out and np.count_nonzero(m) >= LEAST_PX}
        self._pointed_out.update(first)
        return replace(frame, masks=first)
