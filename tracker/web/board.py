"""What there is to be shown: the newest frame with its results, and a while of what went before."""

from __future__ import annotations

import json
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.output import as_json_line
from tracker.result import TrackResult

CHARTED_S = 60.0
MOST_FRAMES = 9000  # of which results are kept: five minutes at 30 frames a second
RATED_S = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """number: of the frame on the board, from 1."""

    number: int
    frame: Frame
    results: tuple[TrackResult, ...]
    truth: Mapping[str, Pose]


@dataclass(frozen=True, slots=True, eq=False)
class Past:
    """What is kept of a frame, without its pictures. put_s: when it came, monotonic seconds."""

    number: int
    index: int
    stamp_ns: int
    put_s: float
    results: tuple[TrackResult, ...]


class Board:
    """Written by the tracker's thread, which never waits for a reader; read by any other one.

    listener: called after every frame while there is one.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._past: deque[Past] = deque(maxlen=MOST_FRAMES)
        self.newest: Shown | None = None
        self.listener: Callable[[], None] | None = None

    def put(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        now_s = time.monotonic()
        light = tuple(replace(result, surface=None, step=None) for result in results)
        with self._lock:
            number = self.newest.number + 1 if self.newest else 1
            self._past.append(Past(number, frame.index, frame.stamp_ns, now_s, light))
            self.newest = Shown(number, frame, tuple(results), truth)
        if listener := self.listener:
            listener()

    def since(self, number: int) -> list[Past]:
        """The frames after this one that a chart shows, by time."""
        chosen: list[Past] = []
        with self._lock:
            oldest_ns = self._past[-1].stamp_ns - round(CHARTED_S * 1e9) if self._past else 0
            for past in reversed(self._past):
                if past.number <= number or past.stamp_ns < oldest_ns:
                    break
                chosen.append(past)
        return chosen[::-1]

    def rate_hz(self) -> float:
        """Frames a second that the tracker made lately."""
        with self._lock:
            times_s = [past.put_s for past in list(self._past)[-200:]]
        recent = [at_s for at_s in times_s if times_s[-1] - at_s < RATED_S] if times_s else []
        return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 1 else 0.0

    def lines(self) -> Iterator[str]:
        """Lines as those of poses.jsonl, of all frames that are kept."""
        with self._lock:
            kept = list(self._past)
        for past in kept:
            for result in past.results:
                yield as_json_line(result, past.index) + "\n"


def as_sample(past: Past) -> list[Any]:
    """[stamp in seconds, [state, confidence] of every object]: what a chart needs."""
    return [past.stamp_ns / 1e9, [[result.state.value, round(result.confidence, 3)] for result in past.results]]


def as_row(result: TrackResult) -> dict[str, Any]:
    """What the page says of an object: millimetres, degrees and their standard deviations; null without a pose."""
    pose, spread = result.pose, result.covariance
    deviations = None if spread is None else np.sqrt(np.maximum(np.diag(spread), 0))
    return {
        "object": result.object_id,
        "state": result.state.value,
        "reason": result.reason,
        "confidence": round(result.confidence, 3),
        "position_mm": None if pose is None else (pose.translation_m * 1e3).round(2).tolist(),
        "quaternion_wxyz": None if pose is None else pose.quaternion_wxyz.round(4).tolist(),
        "sigma_mm": None if deviations is None else _told(float(np.linalg.norm(deviations[3:])) * 1e3),
        "sigma_deg": None if deviations is None else _told(float(np.degrees(np.linalg.norm(deviations[:3])))),
    }


def _told(value: float) -> float | None:
    return round(value, 2) if math.isfinite(value) else None


def packet(header: Mapping[str, Any], picture: bytes) -> bytes:
    """One message: the length of the header (4 bytes, little endian), the header as JSON, the picture."""
    text = json.dumps(header, allow_nan=False).encode()
    return len(text).to_bytes(4, "little") + text + picture
