"""How long each stage of a frame took."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Stopwatch:
    """`with clock("stage"): ...` adds to the stage's time. Starts when it is made."""

    def __init__(self) -> None:
        self._started = time.perf_counter()
        self._spent_s: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self._spent_s[stage] = self._spent_s.get(stage, 0.0) + time.perf_counter() - start

    def timings_ms(self) -> dict[str, float]:
        """Milliseconds of every stage, and of "total" since the stopwatch was made."""
        total_s = time.perf_counter() - self._started
        return {**{stage: s * 1e3 for stage, s in self._spent_s.items()}, "total": total_s * 1e3}
