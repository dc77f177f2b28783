"""Confidence against the share of poses that are right."""

from __future__ import annotations

from eval.plots.figure import ADDS_COLOUR, LETTERS, Panel, figure, rect, rule, text
from eval.reliability import RIGHT_WITHIN_DEG, RIGHT_WITHIN_M, Reliability


def reliability_diagram(found: Reliability) -> str:
    """A bar a bin, its count on it, a line at the mean confidence; a calibrated tracker's bars end at their lines."""
    panel = Panel((0, 1), (0, 100), top=40, bottom=204)
    marks = panel.grid([0, 0.2, 0.4, 0.6, 0.8, 1], range(0, 101, 20), "confidence", "poses that are right, %")
    marks.append(rule(panel.across(0), panel.up(0), panel.across(1), panel.up(100), "var(--ink)", ' opacity=".5"'))
    for each in found.bins:
        left, right = panel.across(each.low) + 1, panel.across(each.high) - 1
        if not each.count:
            continue
        top = panel.up(100 * each.right)
        said = f"{each.low:.1f} to {each.high:.1f}: {each.count} poses, {100 * each.right:.1f} % of them right"
        marks.append(rect(left, top, right - left, panel.bottom - top, ADDS_COLOUR, said, ' fill-opacity=".75"'))
        level = panel.up(100 * each.confidence)
        marks.append(rule(left, level, right, level, "var(--add)", ' stroke-width="3"'))
        marks.append(text((left + right) / 2, top - 4, _short(each.count), "middle"))
    wrong_by = f"Expected calibration error {100 * found.calibration_error:.1f} % over {found.count} poses."
    rule_of_right = f"Right: within {RIGHT_WITHIN_M * 100:g} cm and {RIGHT_WITHIN_DEG:g}° of a symmetric pose."
    key = [(ADDS_COLOUR, "right, with the count of poses"), ("var(--add)", "mean confidence")]
    return figure("Confidence and what it was worth", marks, 204 + 3 * LETTERS, key, f"{wrong_by} {rule_of_right}")


def _short(count: int) -> str:
    return str(count) if count < 10_000 else f"{count / 1000:.0f}k"
