"""A camera and a tracker that is slower than it: the newest frame wins."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator, Mapping
from types import TracebackType

from tracker.frame import Frame
from tracker.handover import Handover
from tracker.sources import LiveSource

logger = logging.getLogger(__name__)

POLL_S = 0.1  # so that a ctrl-C is noticed while nothing comes
PATIENCE_S = 15.0  # for the camera to end; its SDK may be waiting for it
# Clocks of cameras whose stamps are Unix time of this machine: librealsense's names
HOST_CLOCKS = ("global_time", "system_time")


class Latest:
    """The frames of a camera, read in a thread of its own; those that nobody took before the next one came are dropped.

    To be used in a `with`: the thread ends with it. One frame waits at most, so nothing grows and nothing gets old.
    silence_s: a camera that has said nothing for so long is named in a warning, again after each such time.
    """

    def __init__(self, source: LiveSource, silence_s: float = 5.0) -> None:
        self._source, self._silence_s = source, silence_s
        self._door: Handover[tuple[Frame, int]] = Handover(1, newest=True)
        self._thread = threading.Thread(target=self._read, name=f"frames of {source.name}", daemon=True)
        self._taken: tuple[Frame, int] | None = None

    @property
    def dropped(self) -> int:
        """Frames that nobody took."""
        return self._door.dropped

    @property
    def left_out(self) -> Mapping[str, int]:
        """Frames of the camera that were not tracked, by what became of them."""
        return {**self._source.left_out, "dropped: newer ones had come before they could be tracked": self.dropped}

    def __enter__(self) -> Latest:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._source.stop()
        self._door.end()
        self._thread.join(PATIENCE_S)
        if self._thread.is_alive():
            logger.warning("%s does not end; it is left behind", self._source.name)

    def __iter__(self) -> Iterator[Frame]:
        """Until the camera ends. Raises what the camera raises, after the frame that came before it."""
        silent_since, warned = time.monotonic(), 0
        while not self._door.ended:
            taken = self._door.get(POLL_S)
            if taken is not None:
                self._taken = taken
                yield taken[0]
                silent_since, warned = time.monotonic(), 0
                continue
            silent_s = time.monotonic() - silent_since
            if silent_s > (warned + 1) * self._silence_s and not self._door.ended:
                warned += 1
                logger.warning("%s has shown nothing for %.0f s", self._source.name, silent_s)
        self._door.get(0)

    def latency_ms(self) -> float:
        """How old the frame that was taken last is by now; 0 before the first one.

        From its stamp where this is of this machine's clock (`stamped`), else from when it was read.
        """
        if self._taken is None:
            return 0.0
        frame, read_ns = self._taken
        return ((time.time_ns() - frame.stamp_ns) if self.stamped else (time.monotonic_ns() - read_ns)) / 1e6

    @property
    def stamped(self) -> bool:
        """The camera's stamps are of this machine's clock, so that they can be compared with it."""
        return self._taken is not None and self._taken[0].provenance.clock in HOST_CLOCKS

    def _read(self) -> None:
        try:
            for frame in self._source:
                self._door.put((frame, time.monotonic_ns()))
        except BaseException as error:
            self._door.end(error)
        else:
            self._door.end()
