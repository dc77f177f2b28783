"""Plots of a report as SVG, drawn in the page's own colours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from eval.instances import InstanceError
from tracker.geometry import Floats

WIDTH, HEIGHT = 760, 260
LEFT, RIGHT, TOP, BOTTOM = 64, 16, 28, 44
COLOURS = {"ADD": "var(--add)", "ADD-S": "var(--adds)"}
LARGEST_MM = 100.0


def error_curve(errors_m: Mapping[str, Floats]) -> str:
    """Share of the instances under each error up to 2 cm: the curve whose area the AUC up to 2 cm is."""
    limits_m = np.linspace(0, 0.02, 101)
    axes = _Axes((0, 20), (0, 100), "error up to, mm", "instances, %")
    for name, errors in errors_m.items():
        shares = [100 * float((errors <= limit).mean()) if len(errors) else 0.0 for limit in limits_m]
        axes.line(limits_m * 1000, np.array(shares), COLOURS[name])
    return axes.svg(list(errors_m), "Share of the instances whose error is under a limit")


def error_over_time(rows: Sequence[InstanceError]) -> str:
    """ADD of every instance over the images, a plot a scene; missing poses and errors over 10 cm on the upper edge."""
    plots = []
    for scene_id in sorted({row.scene_id for row in rows}):
        of_scene = [row for row in rows if row.scene_id == scene_id]
        images = [row.image_id for row in of_scene]
        axes = _Axes((min(images), max(images) + 1), (0.5, LARGEST_MM), "image", "ADD, mm", logarithmic=True)
        for row in of_scene:
            axes.dot(row.image_id, min(row.add_m * 1000, LARGEST_MM), f"object {row.object_id}, image {row.image_id}")
        plots.append(axes.svg([], f"Scene {scene_id}"))
    return "\n".join(plots)


class _Axes:
    """A frame with ticks into which lines and dots are drawn in the units of the data."""

    def __init__(
        self, x: tuple[float, float], y: tuple[float, float], x_name: str, y_name: str, logarithmic: bool = False
    ) -> None:
        self._x, self._y, self._logarithmic = x, y, logarithmic
        self._marks: list[str] = []
        ticks_y = [0.5, 1, 2, 5, 10, 20, 50, 100] if logarithmic else np.linspace(*y, 6)
        for value in np.linspace(*x, 6):
            place = self._across(value)
            self._text(place, HEIGHT - BOTTOM + 18, f"{value:.0f}", "middle")
            self._rule(place, TOP, place, HEIGHT - BOTTOM)
        for value in ticks_y:
            place = self._up(float(value))
            self._text(LEFT - 8, place + 4, f"{value:g}", "end")
            self._rule(LEFT, place, WIDTH - RIGHT, place)
        self._text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 6, x_name, "middle")
        self._text(LEFT, TOP - 10, y_name, "middle")

    def line(self, x: Floats, y: Floats, colour: str) -> None:
        points = " ".join(f"{self._across(a):.1f},{self._up(b):.1f}" for a, b in zip(x, y, strict=True))
        self._marks.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>')

    def dot(self, x: float, y: float, title: str) -> None:
        self._marks.append(
            f'<circle cx="{self._across(x):.1f}" cy="{self._up(y):.1f}" r="2" fill="{COLOURS["ADD"]}" '
            f'fill-opacity=".6"><title>{escape(title)}: {y:.1f} mm</title></circle>'
        )

    def svg(self, legend: Sequence[str], title: str) -> str:
        for k, name in enumerate(legend):
            x = WIDTH - RIGHT - 90 * (len(legend) - k)
            self._marks.append(f'<rect x="{x}" y="{TOP - 16}" width="12" height="4" fill="{COLOURS[name]}"/>')
            self._text(x + 18, TOP - 10, name, "start")
        return (
            f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(title)}">'
            f"<title>{escape(title)}</title>{''.join(self._marks)}</svg>"
        )

    def _across(self, value: float) -> float:
        low, high = self._x
        return LEFT + (value - low) / (high - low) * (WIDTH - LEFT - RIGHT)

    def _up(self, value: float) -> float:
        low, high = self._y
        if self._logarithmic:
            share = np.log(max(value, low) / low) / np.log(high / low)
        else:
            share = (value - low) / (high - low)
        return HEIGHT - BOTTOM - float(share) * (HEIGHT - TOP - BOTTOM)

    def _text(self, x: float, y: float, text: str, anchor: str) -> None:
        self._marks.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>')

    def _rule(self, x0: float, y0: float, x1: float, y1: float) -> None:
        self._marks.append(
            f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" stroke="var(--faint)" stroke-width="1"/>'
        )
