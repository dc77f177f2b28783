"""What all charts share: a frame in the units of the data, marks in it, and the figure around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from tracker.geometry import Floats

WIDTH = 360  # units of an SVG; shown 328 CSS pixels wide on a phone of 360
LETTERS = 13  # units, so 11.8 pixels there
ADD_COLOUR, ADDS_COLOUR, ADD_OR_ADDS_COLOUR = "var(--add)", "var(--adds)", "var(--both)"


@dataclass(frozen=True, slots=True)
class Panel:
    """A rectangle of the drawing (its edges in its units, y down) and the ranges of data that it spans (y up)."""

    x: tuple[float, float]
    y: tuple[float, float]
    left: float = 42
    top: float = 26
    right: float = WIDTH - 14
    bottom: float = 190
    logarithmic: bool = False

    def across(self, value: float) -> float:
        low, high = self.x
        return self.left + (value - low) / (high - low) * (self.right - self.left)

    def up(self, value: float) -> float:
        low, high = self.y
        value = min(max(value, low), high)
        if self.logarithmic:
            low, high, value = np.log(low), np.log(high), np.log(value)
        share = float(value - low) / float(high - low)
        return self.bottom - share * (self.bottom - self.top)

    def grid(self, ticks_x: Sequence[float], ticks_y: Sequence[float], x_name: str = "", y_name: str = "") -> list[str]:
        """Rules with their numbers, and the names of the axes."""
        marks = []
        for value in ticks_x:
            place = self.across(value)
            marks += [rule(place, self.top, place, self.bottom), text(place, self.bottom + 16, f"{value:g}", "middle")]
        for value in ticks_y:
            place = self.up(value)
            marks += [rule(self.left, place, self.right, place), text(self.left - 6, place + 4, f"{value:g}", "end")]
        if x_name:
            marks.append(text((self.left + self.right) / 2, self.bottom + 33, x_name, "middle"))
        if y_name:
            marks.append(text(4, self.top - 12, y_name, "start"))
        return marks

    def line(self, x: Sequence[float] | Floats, y: Sequence[float] | Floats, colour: str, style: str = "") -> str:
        points = " ".join(f"{self.across(a):.1f},{self.up(b):.1f}" for a, b in zip(x, y, strict=True))
        return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"{style}/>'


def text(x: float, y: float, words: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>'


def rule(x0: float, y0: float, x1: float, y1: float, colour: str = "var(--faint)", style: str = "") -> str:
    return f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" stroke="{colour}"{style}/>'


def rect(x: float, y: float, width: float, height: float, colour: str, title: str = "", style: str = "") -> str:
    inner = f"<title>{escape(title)}</title>" if title else ""
    size = f'x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"'
    return f'<rect {size} fill="{colour}"{style}>{inner}</rect>'


def figure(title: str, marks: Sequence[str], height: float, key: Sequence[tuple[str, str]] = (), note: str = "") -> str:
    """title: what is drawn. key: (colour, what it stands for), in letters of the page. note: a line under it."""
    swatches = "".join(f'<span class="key"><i style="background:{c}"></i>{escape(what)}</span>' for c, what in key)
    return (
        f"<figure><figcaption>{escape(title)}</figcaption>"
        f'<svg viewBox="0 0 {WIDTH} {height:g}" role="img" aria-label="{escape(title)}">{"".join(marks)}</svg>'
        f"{f'<p>{swatches}</p>' if key else ''}{f'<p>{escape(note)}</p>' if note else ''}</figure>"
    )


def shortened(name: str, letters: int) -> str:
    return name if len(name) <= letters else name[: letters - 1] + "…"
