"""`python -m eval bench filter`: how steady a still object is, how closely a moving one is followed, and no jumps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.table import Table

from tracker.terminal import STDERR, hush, progress

STILL, MOVING = "still", "turn?object=tea_box"
SYMMETRIC = {"bowl": "z:inf", "soup_can": "z:inf"}  # of their shapes: the can's print is declared to be nothing


@dataclass
class FilterBench:
    """Follow rendered objects at a usual camera's noise: one that is still (300 frames), one at up to 0.39 m/s, a bowl
    and a can that any turn leaves alike. Poses before the filter, after it, and smoothed, against the true ones."""

    frames: int = 300
    """Of the still object; the moving ones have three tenths of them."""
    size: str = "640x480"
    """Of the pictures."""
    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """File for the figures."""
    overwrite: bool = False
    """Replace the file if it exists."""
    quiet: bool = False
    """Nothing on the terminal but warnings and errors."""

    def __call__(self) -> None:
        from eval.environment import write_figures
        from tracker.output import require_free

        hush(self.quiet)
        if self.json:
            require_free(self.json, self.overwrite)
        figures = self.measured()
        table = Table("", "", title="the pose over time", show_header=False)
        for scene, of_scene in figures.items():
            for name, value in of_scene.items():
                text = f"{value:.3g}" if isinstance(value, float) else str(value)
                table.add_row(f"{scene.replace('_', ' ')}: {name.replace('_', ' ')}", text)
        STDERR.print(table)
        if self.json:
            write_figures(self.json, figures)

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
