"""A RealSense camera that is connected: what it shows now, also after it was unplugged for a while."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tracker.errors import SourceError
from tracker.frame import Frame
from tracker.handover import Handover
from tracker.sources.pairing import Pair, Pairing
from tracker.sources.realsense.conversion import Converter, shot_of
from tracker.sources.realsense.devices import choose_streams
from tracker.sources.realsense.request import Options
from tracker.sources.tolerance import Tolerance

logger = logging.getLogger(__name__)

IN_FLIGHT = 4  # frames of the SDK that may wait for whoever reads; older ones are dropped
POLL_S = 0.2
FIRST_WAIT_S, LONGEST_WAIT_S = 0.5, 8.0  # before a lost camera is looked for again, twice as long each time


@dataclass(frozen=True, slots=True)
class Patience:
    """stall_s: a camera that shows nothing for so long is lost. wait_s: before it is looked for again."""

    stall_s: float = 3.0
    wait_s: float = FIRST_WAIT_S


class RealSenseCamera:
    """Frames as they come, until `stop`, or until the camera is gone for longer than options.reconnect_s.

    find: answers the device, anew after each loss; it raises SourceError where there is none. What comes while nobody
    looks is dropped and counted. Stamps are the camera's own and may begin anew after a loss.
    """

    def __init__(
        self,
        sdk: Any,
        find: Callable[[], Any],
        options: Options | None = None,
        name: str = "realsense",
        patience: Patience | None = None,
    ) -> None:
        self.name = name
        self._sdk, self._find, self._options = sdk, find, options or Options()
        self._patience = patience or Patience()
        self._stopped = threading.Event()
        self._tolerance = Tolerance(name)
        self._record: Path | None = None
        self._index, self._recordings = 0, 0
        self._dropped, self._skipped = 0, 0

    def record(self, path: Path) -> None:
        """From the next opening on, write all that comes to the file, in place of what is there; after a loss, to one
        beside it (NAME-2.db3).

        Raises SourceError unless it is to be a .db3, which is all that the SDK writes.
        """
        if path.suffix.lower() != ".db3":
            raise SourceError(f"{path}: a RealSense camera is recorded as .db3; expected {path.with_suffix('.db3')}")
        path.unlink(missing_ok=True)
        self._record = path

    def stop(self) -> None:
        """Ends the frames soon, from any thread."""
        self._stopped.set()

    @property
    def left_out(self) -> Mapping[str, int]:
        """Frames that never came out, by what became of them."""
        return {
            "skipped at the start: depth without colour, or colour without depth": self._skipped,
            "dropped: newer ones had come before they could be read": self._dropped // 2,  # two pictures a frame
            "left out: they could not be right": self._tolerance.refused,
        }

    def __iter__(self) -> Iterator[Frame]:
        """Raises SourceError where the camera cannot be opened, is gone for too long, or shows nothing usable."""
        lost_at, wait_s, why, seen = time.monotonic(), self._patience.wait_s, "", False
        while not self._stopped.is_set():
            try:
                with closing(self._until_lost()) as frames:
                    for frame in frames:
                        if why:
                            logger.warning("%s is back after %.1f s", self.name, time.monotonic() - lost_at)
                        why, wait_s, seen = "", self._patience.wait_s, True
                        yield frame
                        lost_at = time.monotonic()
                why_now = f"no pictures for {self._patience.stall_s:g} s"
            except _NotThereError as error:
                if not seen and not why:
                    raise SourceError(f"{self.name}: the camera cannot be opened: {error}") from error
                why_now = str(error)
            if self._stopped.is_set():
                return
            if not why:
                logger.warning("%s is lost (%s); it is looked for again", self.name, why_now)
            why, away_s = why_now, time.monotonic() - lost_at
            if away_s + wait_s > self._options.reconnect_s:
                raise SourceError(f"{self.name}: the camera is gone for {away_s:.1f} s ({why})")
            self._stopped.wait(wait_s)
            wait_s = min(2 * wait_s, LONGEST_WAIT_S)

    def _until_lost(self) -> Generator[Frame]:
        """Raises _NotThereError where the camera cannot be opened."""
        door: Handover[Any] = Handover(IN_FLIGHT, newest=True)
        device, streams = None, None
        try:
            try:
                device = self._opened_device()
                streams = choose_streams(self._sdk, device, self._options, self.name)
                convert = Converter(self._sdk, streams, self._options, self.name)
                pairing = Pairing(round(1e9 / streams.depth.fps()))
                streams.start(door.put)
            except (RuntimeError, SourceError) as error:
                raise _NotThereError(str(error)) from error
            for pair in self._pairs(door, pairing):
                frame = self._tolerance.made(lambda pair=pair: convert(pair, self._index))
                self._index += 1
                if frame is not None:
                    yield frame
        finally:
            door.end()
            if streams is not None:
                streams.stop()
            device = None  # a recording is whole when its device is gone
            self._dropped += door.dropped

    def _opened_device(self) -> Any:
        device = self._find()
        if self._record is None:
            return device
        self._recordings += 1
        beside = f"{self._record.stem}-{self._recordings}{self._record.suffix}"
        path = self._record if self._recordings == 1 else self._record.with_name(beside)
        return self._sdk.recorder(str(path), device)

    def _pairs(self, door: Handover[Any], pairing: Pairing) -> Iterator[Pair]:
        """Until it is stopped or nothing has come for too long."""
        depth, heard_at, blind = self._sdk.stream.depth, time.monotonic(), False
        skipped_before = self._skipped
        while not self._stopped.is_set() and time.monotonic() - heard_at < self._patience.stall_s:
            shot = door.get(min(POLL_S, self._patience.stall_s))
            if shot is None:
                continue
            is_depth = shot.get_profile().stream_type() == depth
            for pair in (pairing.add_depth if is_depth else pairing.add_colour)(shot_of(shot)):
                heard_at = time.monotonic()
                if (pair.depth is None) != blind:
                    blind = pair.depth is None
                    logger.warning("%s: colour comes %s depth", self.name, "without" if blind else "again with")
                if self._skipped < skipped_before + pairing.skipped:
                    self._skipped = skipped_before + pairing.skipped
                    logger.info("%s: %d first pictures without the other's are skipped", self.name, pairing.skipped)
                yield pair
                heard_at = time.monotonic()  # however long the taker had it


class _NotThereError(Exception):
    """The camera cannot be opened now."""
