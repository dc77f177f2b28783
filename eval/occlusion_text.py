"""Errors against occlusion as tables of text."""

from __future__ import annotations

from eval.occlusion import Line, Occlusion
from eval.report_text import TextTable

ERRORS = {"add": "ADD", "adds": "ADD-S"}
OCCLUSION_LEGEND = (
    "Lines are least squares over the instances with a pose; a missing pose has no error and is counted beside. "
    "The paper (LINEMOD-Occlusion, pairs of images, ADD-S): R² < 0.3 for every object. Not the same data."
)


def occlusion_tables(found: Occlusion) -> tuple[TextTable, TextTable]:
    """Medians of the bands of occlusion, and the lines of the objects."""
    bands = tuple(
        (f"{b.low:.0%} to {b.high:.0%}", str(b.instances), str(b.missing), _mm(b.add_mm), _mm(b.adds_mm))
        for b in found.bands
    )
    lines = tuple(
        (ERRORS[error], name, str(one.pairs), str(one.missing), *_line(one))
        for error, of_objects in found.lines.items()
        for name, one in of_objects.items()
    )
    return (
        TextTable(("hidden", "n", "missing", "median ADD mm", "median ADD-S mm"), bands),
        TextTable(("error", "object", "n", "missing", "mm per 10 % hidden", "r", "R²"), lines),
    )


def _line(one: Line) -> tuple[str, str, str]:
    if one.slope_mm is None or one.r is None or one.r2 is None:
        return "-", "-", "-"
    return f"{one.slope_mm / 10:+.2f}", f"{one.r:+.2f}", f"{one.r2:.2f}"


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
