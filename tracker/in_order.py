"""Frames whose time goes on, out of a source in which it does not always."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from tracker.errors import SourceError
from tracker.frame import Frame

logger = logging.getLogger(__name__)

# Refused frames in a row whose own time goes on: the clock was set back, no frame is late.
SET_BACK = 30
SET_BACK_LIVE = 5  # a camera's frames come in order; the tracker may be slow, and each one refused is one not tracked


class InOrder:
    """The frames of a camera as a tracker can take them: those that come after their successor, and those with the
    stamp of another, are left out and counted. Frames that were dropped on the way need nothing done: a tracker knows
    the time between two frames from their stamps.

    live: a camera, whose clock may begin anew when it was unplugged. Its stamps then go on by the time that has passed
    on `now_ns`, which is logged, so that nothing behind has to know.
    Raises SourceError where the clock of a recording was set back for good: of what comes then no frame could be taken.
    """

    def __init__(
        self, frames: Iterable[Frame], *, live: bool = False, now_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._frames, self._live, self._now_ns = frames, live, now_ns
        self.refused = 0

    def __iter__(self) -> Iterator[Frame]:
        last_ns, refused_ns, going_on = -1, -1, 0
        offset_ns, taken_ns = 0, 0  # own stamps -> those that go on; when the last frame was taken
        for own in self._frames:
            stamp_ns, where = own.stamp_ns + offset_ns, f"frame {own.index} of {own.provenance.source}"
            if stamp_ns <= last_ns:
                self.refused += 1
                going_on = going_on + 1 if stamp_ns > refused_ns else 1
                refused_ns = stamp_ns
                logger.info("%s is left out: its stamp %d ns is not after %d ns", where, stamp_ns, last_ns)
                if going_on < (SET_BACK_LIVE if self._live else SET_BACK):
                    continue
                if not self._live:
                    raise SourceError(
                        f"{where}: the clock went back from {last_ns} ns and is at {stamp_ns} ns after {going_on} more "
                        "frames; a recording has one clock, start again from here"
                    )
                self.refused -= 1
                stamp_ns = last_ns + max(self._now_ns() - taken_ns, 1)
                offset_ns = stamp_ns - own.stamp_ns
                logger.warning("%s: the clock went back; from here on its stamps count %d ns more", where, offset_ns)
            last_ns, going_on, taken_ns = stamp_ns, 0, self._now_ns()
            yield replace(own, stamp_ns=stamp_ns) if offset_ns else own
