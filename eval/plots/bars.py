"""Horizontal bars, a group a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from eval.plots.figure import WIDTH, figure, rect, rule, shortened, text

LEFT, RIGHT = 124, WIDTH - 46
BAR, GAP = 14, 8


@dataclass(frozen=True, slots=True)
class Bars:
    """values: (value, colour), a bar each."""

    name: str
    values: tuple[tuple[float, str], ...]


def bars(
    title: str,
    groups: Sequence[Bars],
    limit: float,
    unit: str,
    key: Sequence[tuple[str, str]] = (),
    note: str = "",
) -> str:
    """limit: the value of a bar of full length, more than 0. unit: follows the value in a bar's own title."""
    marks, y = [], 6.0
    for group in groups:
        height = BAR * len(group.values)
        marks.append(text(LEFT - 6, y + height / 2 + 4, shortened(group.name, 16), "end"))
        for k, (value, colour) in enumerate(group.values):
            length = (RIGHT - LEFT) * min(max(value / limit, 0.0), 1.0)
            at = y + k * BAR
            marks.append(rect(LEFT, at, length, BAR - 1, colour, f"{group.name}: {value:.1f} {unit}"))
            marks.append(text(LEFT + length + 5, at + BAR - 2.5, f"{value:.1f}", "start"))
        y += height + GAP
    marks.append(rule(LEFT, 0, LEFT, y - GAP + 4, "var(--ink)"))
    return figure(title, marks, y, key, note)
