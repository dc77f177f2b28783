"""Things handed from one thread to another through a narrow door."""

from __future__ import annotations

import threading
from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Handover(Generic[Item]):
    """At most `capacity` things wait. Where there is no room, newest=True drops the oldest one and counts it,
    newest=False lets the giver wait."""

    def __init__(self, capacity: int, *, newest: bool) -> None:
        self._waiting: deque[Item] = deque()
        self._capacity, self._newest = capacity, newest
        self._changed = threading.Condition()
        self._ended = False
        self._error: BaseException | None = None
        self.dropped = 0

    def put(self, item: Item) -> None:
        """Does nothing once it has ended."""
        with self._changed:
            if not self._newest:
                self._changed.wait_for(lambda: self._ended or len(self._waiting) < self._capacity)
            if self._ended:
                return
            if len(self._waiting) == self._capacity:
                self._waiting.popleft()
                self.dropped += 1
            self._waiting.append(item)
            self._changed.notify_all()

    def get(self, timeout_s: float) -> Item | None:
        """The oldest that waits; None where nothing comes in time or ever. Raises what the giver ended with."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._ended, timeout_s)
            if self._waiting:
                item = self._waiting.popleft()
                self._changed.notify_all()
                return item
            if self._error is not None:
                raise self._error
            return None

    def end(self, error: BaseException | None = None) -> None:
        """Nothing more comes; whoever waits goes on, and what waits can still be taken. error: for the taker."""
        with self._changed:
            self._ended, self._error = True, self._error or error
            self._changed.notify_all()

    @property
    def ended(self) -> bool:
        """Nothing waits and nothing more comes."""
        with self._changed:
            return self._ended and not self._waiting
