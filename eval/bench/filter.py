"""`python -m eval bench filter`: how steady a still object is, how closely a moving one is followed, and no jumps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from eval.bench.measurement import Measurement, text_of
from tracker.terminal import progress

STILL, MOVING = "still", "turn?object=tea_box"
SYMMETRIC = {"bowl": "z:inf", "soup_can": "z:inf"}  # of their shapes: the can's print is declared to be nothing


@dataclass
class FilterBench(Measurement):
    """Follow rendered objects at a usual camera's noise: one that is still (300 frames), one at up to 0.39 m/s, a bowl
    and a can that any turn leaves alike. Poses before the filter, after it, and smoothed, against the true ones."""

    frames: int = 300
    """Of the still object; the moving ones have three tenths of them."""
    size: str = "640x480"
    """Of the pictures."""

    def title(self) -> str:
        return "the pose over time"

    def rows(self, figures: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        for scene, of_scene in figures.items():
            for name, value in of_scene.items():
                yield f"{scene}: {name}", text_of(value)

    def measured(self) -> dict[str, Any]:
        from eval.bench.followed import follow, jumps, lag, steadiness

        fast = max(6, round(0.3 * self.frames))
        asked = [
            ("still", STILL, self.frames, 1, "none"),
            ("moving", MOVING, 2 * fast, 2, "none"),
            *((name, f"turn?object={name}", fast, 1, declared) for name, declared in SYMMETRIC.items()),
        ]
        found: dict[str, Any] = {}
        for name, scene, frames, stride, declared in progress(asked, len(asked), "scenes"):
            options = f"{'&' if '?' in scene else '?'}frames={frames}&noise=1.0&size={self.size}"
            followed = follow(scene + options, stride, declared)
            found[name] = {**steadiness(followed), "lost": followed.lost}
            if name == "moving":
                found[name] |= lag(followed)
            if name in SYMMETRIC:
                found[name] |= jumps(followed)
        found["settings"] = {"frames": self.frames, "size": self.size, "noise": 1.0}
        return found
