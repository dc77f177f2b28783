"""What is told at the end of a run, and while it goes on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from rich.table import Table

from tracker.result import TrackResult
from tracker.terminal import ALWAYS


class Summary:
    """latencies_ms: of a camera's frames, for whoever knows them to add to."""

    def __init__(self) -> None:
        self.latencies_ms: list[float] = []
        self._states: Counter[tuple[str, str]] = Counter()
        self._times_ms: dict[str, list[float]] = {}
        self._last: dict[str, str] = {}

    def add(self, results: Sequence[TrackResult]) -> None:
        for result in results:
            object_id, state = result.object_id, result.state.value
            self._states[object_id, state] += 1
            self._times_ms.setdefault(object_id, []).append(result.timings_ms["total"])
            self._last[object_id] = state

    def now(self) -> str:
        """How many objects are in which state."""
        return ", ".join(f"{count} {state}" for state, count in Counter(self._last.values()).items())

    def table(self, since: str) -> Table:
        """since: what the latency is counted from."""
        table = Table("object", "frames", "tracking", "lost", "median ms", title="tracked")
        for object_id, times_ms in self._times_ms.items():
            tracking, lost = self._states[object_id, "tracking"], self._states[object_id, "lost"]
            table.add_row(object_id, str(len(times_ms)), str(tracking), str(lost), f"{np.median(times_ms):.1f}")
        if self.latencies_ms:
            median, p95 = np.percentile(self.latencies_ms, (50, 95))
            table.caption = f"a frame's result comes {median:.0f} ms after {since} (median; 95 %: {p95:.0f} ms)"
        return table


def tell_left_out(refused: int, left_out: Mapping[str, int], without_concepts: int) -> None:
    """Which frames were not tracked, or not as they should be, and how many, if any."""
    counts = {
        "left out: they came late, or with the stamp of another": refused,
        **left_out,
        "went without concepts that were asked for": without_concepts,
    }
    for what, count in counts.items():
        if count:
            ALWAYS.print(f"{count} frames {what}")
