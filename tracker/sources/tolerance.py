"""A camera's frame that cannot be right is left out; a camera whose frames never are ends."""

from __future__ import annotations

import logging
from collections.abc import Callable

from tracker.errors import FrameError, SourceError
from tracker.frame import Frame

logger = logging.getLogger(__name__)

MOST_IN_A_ROW = 30


class Tolerance:
    """Makes frames of a live camera. `refused` counts those that could not be made; the first one is warned of."""

    def __init__(self, name: str, most_in_a_row: int = MOST_IN_A_ROW) -> None:
        self._name, self._most = name, most_in_a_row
        self._in_a_row = 0
        self.refused = 0

    def made(self, make: Callable[[], Frame]) -> Frame | None:
        """The frame, or None where it is left out. Raises SourceError where so many in a row cannot be right."""
        try:
            frame = make()
        except (FrameError, SourceError) as error:
            self.refused += 1
            self._in_a_row += 1
            logger.log(logging.WARNING if self._in_a_row == 1 else logging.INFO, "left out: %s", error)
            if self._in_a_row >= self._most:
                raise SourceError(f"{self._name}: {self._in_a_row} frames in a row cannot be right: {error}") from error
            return None
        self._in_a_row = 0
        return frame
