"""What somebody asks of a running tracker from another thread; the loop carries it out between two frames."""

from __future__ import annotations

import threading
from collections import deque
from concurrent.futures import Future
from typing import Protocol

from tracker.errors import ConfigError, TrackerError
from tracker.pointing import Pointer

MOST_WAITING = 16  # whoever asks faster than frames come is refused: nothing grows


class Pointable(Protocol):
    def point_out(self, object_id: str, there: Pointer) -> None: ...


class RemoteControl:
    """`point_out` and `pause` from any thread, `carry_out` in the loop that owns the tracker.

    ended: why nothing is carried out any more, None while it is.
    """

    def __init__(self) -> None:
        self._asked: deque[tuple[str, Pointer, Future[None]]] = deque()
        self._changed = threading.Condition()
        self._paused = False
        self.ended: str | None = None

    @property
    def paused(self) -> bool:
        return self._paused

    def point_out(self, object_id: str, there: Pointer) -> Future[None]:
        """Done when the tracker has been told, for the next frame; holds the TrackerError by which it was refused."""
        told: Future[None] = Future()
        with self._changed:
            if self.ended is not None:
                told.set_exception(ConfigError(self.ended))
            elif len(self._asked) == MOST_WAITING:
                told.set_exception(ConfigError(f"{MOST_WAITING} commands wait already for the next frame"))
            else:
                self._asked.append((object_id, there, told))
                self._changed.notify_all()
        return told

    def pause(self, paused: bool) -> None:
        """Whether the loop waits before the next frame. What is pointed out meanwhile is told at once."""
        with self._changed:
            self._paused = paused and self.ended is None
            self._changed.notify_all()

    def carry_out(self, tracker: Pointable) -> None:
        """All that was asked; then, while it is paused, wait for more."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._asked or not self._paused)
                if not self._asked:
                    return
                object_id, there, told = self._asked.popleft()
            try:
                tracker.point_out(object_id, there)
            except TrackerError as error:  # it is the asker's, the loop goes on
                told.set_exception(error)
            except BaseException as error:
                told.set_exception(error)
                raise
            else:
                told.set_result(None)

    def end(self, why: str) -> None:
        """Nothing is carried out any more, and who waits is told why."""
        with self._changed:
            self.ended, self._paused = why, False
            waiting = list(self._asked)
            self._asked.clear()
            self._changed.notify_all()
        for _, _, told in waiting:
            told.set_exception(ConfigError(why))
