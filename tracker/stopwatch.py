"""How long each stage of a frame took."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager


class Stopwatch:
    """`with clock("stage"): ...` adds to the stage's time."""

    def __init__(self) -> None:
        self._spent_ms: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        start_s = time.perf_counter()
        try:
            yield
        finally:
            self._add(stage, time.perf_counter() - start_s)

    def timings_ms(self) -> dict[str, float]:
        """Milliseconds of every stage, and of all of them as "total"."""
        return {**self._spent_ms, "total": sum(self._spent_ms.values())}

    def _add(self, stage: str, spent_s: float) -> None:
        self._spent_ms[stage] = self._spent_ms.get(stage, 0.0) + spent_s * 1e3

    @staticmethod
    @contextmanager
    def shared(clocks: Sequence[Stopwatch], stage: str) -> Iterator[None]:
        """Work that is done for several at once: each bears an equal part of its time."""
        start_s = time.perf_counter()
        try:
            yield
        finally:
            spent_s = time.perf_counter() - start_s
            for clock in clocks:
                clock._add(stage, spent_s / len(clocks))
