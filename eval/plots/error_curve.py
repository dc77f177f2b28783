"""The curves whose areas the AUCs are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eval.instances import InstanceError
from eval.plots.figure import ADD_COLOUR, ADD_OR_ADDS_COLOUR, ADDS_COLOUR, Panel, figure
from eval.summary import Metrics
from eval.worst_frames import counted_error_m
from tracker.geometry import Floats

COLOURS = {"ADD": ADD_COLOUR, "ADD-S": ADDS_COLOUR, "ADD(-S)": ADD_OR_ADDS_COLOUR}
KEYS = {"ADD": "add", "ADD-S": "adds", "ADD(-S)": "add_or_adds"}
STEPS = 608  # two a unit of the drawing: what is drawn is the curve, not a sample that is joined


def error_curves(rows: Sequence[InstanceError], pooled: Metrics) -> str:
    """Share of the instances under each error up to 10 cm and up to 2 cm. pooled: where the areas are named."""
    errors_m = {"ADD": np.array([r.add_m for r in rows]), "ADD-S": np.array([r.adds_m for r in rows])}
    if rows and all(r.symmetric is not None for r in rows):
        errors_m["ADD(-S)"] = np.array([counted_error_m(r) for r in rows])
    return error_curve(errors_m, 0.1, _areas(pooled, "auc")) + error_curve(errors_m, 0.02, _areas(pooled, "auc_2cm"))


def _areas(pooled: Metrics, curve: str) -> dict[str, float]:
    return {name: pooled[f"{key}_{curve}"] for name, key in KEYS.items() if f"{key}_{curve}" in pooled}


def error_curve(errors_m: dict[str, Floats], limit_m: float, areas: dict[str, float]) -> str:
    """areas: by the name of the error, in percent, as the tables have them."""
    panel = Panel((0, limit_m * 1000), (0, 100))
    marks = panel.grid(np.linspace(0, limit_m * 1000, 5 + 1).tolist(), range(0, 101, 20), "error up to, mm", "%")
    limits_m = np.linspace(0, limit_m, STEPS + 1)
    for name, errors in errors_m.items():
        under = np.searchsorted(np.sort(errors), limits_m, side="right") / max(len(errors), 1)
        # ADD(-S) lies on one of the others where no object, or every one, is symmetric
        dashes = ' stroke-dasharray="5 4"' if name == "ADD(-S)" else ""
        marks.append(panel.line(limits_m * 1000, 100 * under, COLOURS[name], dashes))
    key = [(COLOURS[name], f"{name} {areas[name]:.1f}" if name in areas else name) for name in errors_m]
    title = f"Instances with an error under a limit, up to {limit_m * 100:g} cm"
    return figure(title, marks, 228, key, "Beside each name its area (VOCap, pooled).")
