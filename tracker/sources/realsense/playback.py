"""A recording of a RealSense camera: `.db3` as the SDK writes it now, `.bag` as it did."""

from __future__ import annotations

import threading
from collections.abc import Generator, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from tracker.errors import SourceError
from tracker.frame import Frame
from tracker.handover import Handover
from tracker.sources.pairing import Pairing
from tracker.sources.realsense.conversion import Converter, shot_of
from tracker.sources.realsense.devices import choose_streams
from tracker.sources.realsense.request import Options

POLL_S = 0.2
SILENCE_S = 10.0  # a file that is neither read nor at its end
IN_FLIGHT = 4  # frames of the SDK that may wait for whoever reads
SQLITE = b"SQLite format 3\0"


class RealSenseFile:
    """All frames of the file, however long each is looked at; registered here, as a recording is of what was seen.

    Raises SourceError that names the file where it is missing, truncated, of another kind or without both streams.
    """

    def __init__(self, sdk: Any, path: Path, options: Options | None = None, name: str | None = None) -> None:
        self.name = name or f"realsense:{path}"
        self.skipped = 0
        self._sdk, self._path, self._options = sdk, path, options or Options()
        _check_file(path)
        choose_streams(sdk, self._load(), self._options, str(path))

    def _load(self) -> Any:
        try:
            playback = self._sdk.context().load_device(str(self._path))
        except RuntimeError as error:
            raise SourceError(f"{self._path}: not a recording of a RealSense camera ({error})") from error
        playback.set_real_time(False)  # the file waits for the reader
        return playback

    def __iter__(self) -> Iterator[Frame]:
        """Raises SourceError where the file ends before the first pair of pictures."""
        playback = self._load()
        streams = choose_streams(self._sdk, playback, self._options, str(self._path))
        convert = Converter(self._sdk, streams, self._options, self.name)
        pairing, depth = Pairing(round(1e9 / streams.depth.fps())), self._sdk.stream.depth
        index = 0
        with closing(self._frames(playback, streams)) as frames:
            for frame in frames:
                is_depth = frame.get_profile().stream_type() == depth
                for pair in (pairing.add_depth if is_depth else pairing.add_colour)(shot_of(frame)):
                    yield convert(pair, index)
                    index += 1
                self.skipped = pairing.skipped
        for pair in pairing.finish():
            yield convert(pair, index)
            index += 1
        if not index:
            raise SourceError(f"{self._path}: the recording has no colour picture with depth of its moment")

    def _frames(self, playback: Any, streams: Any) -> Generator[Any]:
        """The pictures of both streams. The end of a file is told by the status: a wait that times out is not one."""
        door: Handover[Any] = Handover(IN_FLIGHT, newest=False)
        ended, stopped = threading.Event(), self._sdk.playback_status.stopped
        playback.set_status_changed_callback(lambda status: ended.set() if status == stopped else None)
        begun = (
            threading.Event()
        )  # until then the file waits with the first picture: no stream runs off before the other

        def take(frame: Any) -> None:
            begun.wait()
            door.put(frame)

        read, silent_s = 0, 0.0
        try:
            streams.start(take)
            begun.set()
            while silent_s < SILENCE_S:
                over = ended.is_set()  # asked before: what has come until then is still taken
                frame = door.get(POLL_S)
                if frame is not None:
                    read, silent_s = read + 1, 0.0
                    yield frame
                elif over:
                    return
                else:
                    silent_s += POLL_S
            raise SourceError(f"{self._path}: the recording is damaged: nothing comes after {read} pictures")
        except RuntimeError as error:
            raise SourceError(f"{self._path}: the recording cannot be played back ({error})") from error
        finally:
            begun.set()
            door.end()  # the SDK's threads may wait before it
            streams.stop()


def _check_file(path: Path) -> None:
    """What the SDK would notice in the middle of the recording, or not at all."""
    try:
        with path.open("rb") as file:
            head = file.read(100)
        size = path.stat().st_size
    except OSError as error:
        raise SourceError(f"{path}: cannot be read ({error.strerror})") from error
    if path.suffix.lower() != ".db3":
        return
    if not head.startswith(SQLITE):
        raise SourceError(f"{path}: not a recording of a RealSense camera: it is no SQLite database ({size} bytes)")
    # https://www.sqlite.org/fileformat.html: size of a page, 1 for 65536, and how many there are
    page = int.from_bytes(head[16:18], "big")
    expected = (65_536 if page == 1 else page) * int.from_bytes(head[28:32], "big")
    if size < expected:
        raise SourceError(f"{path}: the recording is truncated: {size} of {expected} bytes are there")
