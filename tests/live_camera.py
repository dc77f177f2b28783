"""A camera made of frames that a test shows when it wants to."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator, Mapping

from tracker.frame import Frame

LONG_S = 20.0


class LiveCamera:
    """`show` a frame, an error that reading is to end with, or None for the end. `all_read` waits until all of them
    were asked for."""

    name = "camera:7"
    left_out: Mapping[str, int] = {}

    def __init__(self) -> None:
        self._coming: queue.Queue[Frame | BaseException | None] = queue.Queue()
        self._stopped = threading.Event()
        self._asked = threading.Condition()
        self._shown, self._read = 0, 0

    def show(self, *what: Frame | BaseException | None) -> LiveCamera:
        for each in what:
            self._shown += 1
            self._coming.put(each)
        return self

    def all_read(self) -> None:
        with self._asked:
            assert self._asked.wait_for(lambda: self._read >= self._shown, LONG_S)

    def stop(self) -> None:
        self._stopped.set()

    def __iter__(self) -> Iterator[Frame]:
        while not self._stopped.is_set():
            try:
                frame = self._coming.get(timeout=0.01)
            except queue.Empty:
                continue
            if isinstance(frame, Frame):
                yield frame  # when it goes on here the frame was handed over
            with self._asked:
                self._read += 1
                self._asked.notify_all()
            if frame is None:
                return
            if isinstance(frame, BaseException):
                raise frame
