"""The last seconds of what the camera saw, to be saved when something has happened."""

from __future__ import annotations

import threading
import time
import zipfile
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import RawIOBase

import cv2
import numpy as np

from tracker.errors import OutputError
from tracker.frame import Frame
from tracker.geometry import Intrinsics
from tracker.handover import Handover
from tracker.threads import give_way

METRES_PER_UNIT = 0.001  # of the layout that is written
JPEG_QUALITY = 95
POLL_S = 0.5
WAITING = 8  # frames that are not compressed yet; where that takes too long the oldest is left out
MOST_FRAMES_HZ = (
    31.0  # a usual camera's; of a recording that is played faster, compressing all would hold up the tracker
)


@dataclass(frozen=True, slots=True)
class Held:
    """A frame, compressed. rgb: JPEG. depth: PNG of 16 bits, millimetres."""

    stamp_ns: int
    intrinsics: Intrinsics
    rgb: bytes
    depth: bytes

    @property
    def size(self) -> int:
        return len(self.rgb) + len(self.depth)


@dataclass(frozen=True, slots=True)
class Extent:
    """How much is held. left_out: frames for which there was no time, or that came faster than those of a camera."""

    frames: int
    seconds: float
    megabytes: float
    left_out: int


class LastSeconds:
    """A ring of compressed frames, bounded in time and memory; a thread of its own compresses them.

    seconds: by the frames' stamps. most_bytes: of compressed frames, of which the oldest go first. `put` never waits.
    """

    def __init__(self, seconds: float = 30.0, most_bytes: int = 400_000_000) -> None:
        self._seconds, self._most_bytes = seconds, most_bytes
        self._door: Handover[Frame] = Handover(WAITING, newest=True)
        self._held: deque[Held] = deque()
        self._bytes, self._next_s, self._too_fast = 0, 0.0, 0
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._compress, name="the last seconds", daemon=True)
        self._thread.start()

    def put(self, frame: Frame) -> None:
        now_s = time.monotonic()
        if now_s < self._next_s:
            self._too_fast += 1
            return
        # some that come at once are let through, as of a camera that hiccups
        self._next_s = max(self._next_s, now_s - WAITING / MOST_FRAMES_HZ) + 1 / MOST_FRAMES_HZ
        self._door.put(frame)

    def close(self) -> None:
        """What waits is compressed, then the thread ends. What is held stays."""
        self._door.end()
        self._thread.join()

    def held(self) -> list[Held]:
        """By time."""
        with self._lock:
            return list(self._held)

    def extent(self) -> Extent:
        with self._lock:
            seconds = (self._held[-1].stamp_ns - self._held[0].stamp_ns) / 1e9 if self._held else 0.0
            return Extent(len(self._held), seconds, self._bytes / 1e6, self._door.dropped + self._too_fast)

    def _compress(self) -> None:
        give_way()
        while not self._door.ended:
            frame = self._door.get(POLL_S)
            if frame is not None:
                self._add(compressed(frame))

    def _add(self, new: Held) -> None:
        with self._lock:
            if self._held and self._held[-1].intrinsics != new.intrinsics:  # the layout has one camera
                self._held.clear()
                self._bytes = 0
            self._held.append(new)
            self._bytes += new.size
            oldest_ns = new.stamp_ns - round(self._seconds * 1e9)
            while self._held[0].stamp_ns < oldest_ns or (self._bytes > self._most_bytes and len(self._held) > 1):
                self._bytes -= self._held.popleft().size


def compressed(frame: Frame) -> Held:
    """Colours as JPEG, depth rounded to millimetres; what is farther than 65 m has no depth."""
    units = np.rint(frame.depth_m * np.float32(1 / METRES_PER_UNIT))
    depth = np.where(units < 2**16, units, 0).astype(np.uint16)
    colours = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    colours += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]  # concepts are colours
    # not by OpenCV, which would start threads here that give way, too, and are the tracker's as well
    bgr = np.ascontiguousarray(frame.rgb[:, :, ::-1])
    rgb = _encoded(".jpg", bgr, colours)
    # the least work that makes it small; OpenCV's own choice takes twice as long
    fast = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_SUB]
    fast += [cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY]
    return Held(frame.stamp_ns, frame.intrinsics, rgb, _encoded(".png", depth, fast))


def zipped(frames: Sequence[Held], name: str) -> Iterator[bytes]:
    """A zip, piece by piece, of a folder `name` that the source `folder:PATH` reads: rgb/ depth/ cam_K.txt; the
    pictures are called by their stamps, 19 digits, nanoseconds. Raises OutputError where there are no frames."""
    if not frames:
        raise OutputError("there is no frame yet to be saved")
    pieces = _Pieces()
    K = "\n".join(" ".join(f"{value:.9g}" for value in row) for row in frames[-1].intrinsics.matrix)
    with zipfile.ZipFile(pieces, "w", zipfile.ZIP_STORED) as archive:  # the pictures are compressed already
        archive.writestr(f"{name}/cam_K.txt", K + "\n")
        for frame in frames:
            archive.writestr(f"{name}/rgb/{frame.stamp_ns:019d}.jpg", frame.rgb)
            archive.writestr(f"{name}/depth/{frame.stamp_ns:019d}.png", frame.depth)
            yield pieces.taken()
    yield pieces.taken()


class _Pieces(RawIOBase):
    """A file that cannot be sought in, of which each piece is taken once, so that no zip is ever whole in memory."""

    def __init__(self) -> None:
        super().__init__()
        self._waiting = bytearray()

    def writable(self) -> bool:
        return True

    def write(self, data) -> int:
        self._waiting += data
        return len(data)

    def taken(self) -> bytes:
        piece = bytes(self._waiting)
        self._waiting.clear()
        return piece


def _encoded(kind: str, picture: np.ndarray, options: list[int]) -> bytes:
    written, data = cv2.imencode(kind, picture, options)
    if not written:
        raise OutputError(f"this OpenCV cannot write {kind} pictures")
    return data.tobytes()
