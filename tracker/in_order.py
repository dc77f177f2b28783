"""Frames whose time goes on, out of a source in which it does not always."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator

from tracker.errors import SourceError
from tracker.frame import Frame

logger = logging.getLogger(__name__)

SET_BACK = 30  # refused frames in a row whose own time goes on: the clock was set back, no frame is late


class InOrder:
    """The frames of a camera as a tracker can take them: those that come after their successor, and those with the
    stamp of another, are left out and counted. Frames that were dropped on the way need nothing done: a tracker knows
    the time between two frames from their stamps.

    Raises SourceError where the source's clock was set back for good: of what comes then no frame could be taken.
    """

    def __init__(self, frames: Iterable[Frame]) -> None:
        self._frames = frames
        self.refused = 0

    def __iter__(self) -> Iterator[Frame]:
        last_ns, refused_ns, going_on = -1, -1, 0
        for frame in self._frames:
            if frame.stamp_ns > last_ns:
                last_ns, going_on = frame.stamp_ns, 0
                yield frame
                continue
            self.refused += 1
            going_on = going_on + 1 if frame.stamp_ns > refused_ns else 1
            refused_ns = frame.stamp_ns
            where = f"frame {frame.index} of {frame.provenance.source}"
            logger.info("%s is left out: its stamp %d ns is not after %d ns", where, refused_ns, last_ns)
            if going_on >= SET_BACK:
                raise SourceError(
                    f"{where}: the clock went back from {last_ns} ns and is at {refused_ns} ns after {going_on} more "
                    "frames; a recording has one clock, start again from here"
                )
