"""Where the time of a step goes."""

from __future__ import annotations

from collections.abc import Mapping

from eval.plots.bars import Bars, bars
from eval.plots.figure import ADD_COLOUR, ADDS_COLOUR


def stage_timings(median_ms: float, p95_ms: float, stages_ms: Mapping[str, float]) -> str:
    """stages_ms: median of every stage over the steps in which it ran; the sum is not the median of the whole."""
    whole = Bars("whole, median", ((median_ms, ADD_COLOUR),)), Bars("whole, p95", ((p95_ms, ADD_COLOUR),))
    slowest_first = sorted(stages_ms.items(), key=lambda item: -item[1])
    stages = [Bars(name.replace("_", " "), ((value, ADDS_COLOUR),)) for name, value in slowest_first]
    limit = max([p95_ms, median_ms, *stages_ms.values(), 1e-9])
    key = [(ADD_COLOUR, "the whole step"), (ADDS_COLOUR, "a stage, median where it ran")]
    return bars("Milliseconds of an object and frame", [*whole, *stages], limit, "ms", key)
