"""The report as one page that stands alone: no file beside it, nothing fetched, readable on a phone."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from html import escape
from pathlib import Path

from eval.html_tables import definitions, html_table
from eval.page import page
from eval.plots.error_curve import error_curves
from eval.plots.error_over_time import error_over_time
from eval.plots.object_bars import object_bars
from eval.plots.reliability_diagram import reliability_diagram
from eval.plots.stage_timings import stage_timings
from eval.report import Report
from eval.report_text import (
    MOST_GROUPS,
    TextTable,
    about_published,
    latency,
    missing_table,
    published_conventions,
    published_table,
    worst_caption,
)
from eval.score_tables import TABLES, headings, object_rows, total_rows
from eval.worst_pictures import WorstFrame


def write_html(path: Path, report: Report) -> None:
    """All sections that the run has data for; of the others a line says why they are not there."""
    sections = (_scores, _anchors, _sizes, _times, _confidence, _stages, _worst, _missing, _conventions)
    body = "\n".join((f"<h1>{escape(report.title)}</h1>", *(section(report) for section in sections)))
    path.write_text(page(report.title, body), encoding="utf-8")


def _scores(report: Report) -> str:
    parts = []
    for heading, columns, legend in TABLES:
        rows, totals = object_rows(report.scores, columns), total_rows(report.scores, columns)
        parts.append(f"<h2>{escape(heading)}</h2>" if heading else "")
        parts.append(html_table(headings(columns), rows, totals) + f'<p class="legend">{escape(legend)}</p>')
    return "\n".join(parts)


def _anchors(report: Report) -> str:
    if not report.anchors:
        return _absent("comparison with published numbers", "the report was not told what data it is of")
    said = escape(about_published(report))
    table = published_table(report)
    return f"<h2>Beside published numbers</h2>{_text_table(table)}<p>{said}</p>{_definitions(published_conventions())}"


def _sizes(report: Report) -> str:
    if not report.scores.instances:
        return _absent("error curve", "there is not one instance to score")
    curves = error_curves(report.scores.instances, report.scores.pooled)
    return f"<h2>How large are the errors?</h2>{_grid(curves, object_bars(report.scores))}"


def _times(report: Report) -> str:
    if not report.scores.instances:
        return _absent("plot of errors over time", "there is not one instance to score")
    about = "Missing poses and errors over 10 cm are on the upper edge, those under 0.5 mm on the lower one."
    if not report.records:
        about += " No states and no confidence: the poses came from a file, which does not tell them."
    drawn = error_over_time(report.scores.instances, report.records)
    return f"<h2>When do they happen?</h2><p>{about}</p>{_grid(drawn)}"


def _confidence(report: Report) -> str:
    if report.reliability is None:
        return _absent("reliability diagram", "no pose that is scored came with a tracker's confidence")
    return f"<h2>Is the confidence to be trusted?</h2>{_grid(reliability_diagram(report.reliability))}"


def _stages(report: Report) -> str:
    told = latency(report)
    if told is None:
        return _absent("stage timings", "nothing was timed")
    return f"<h2>Where does the time go?</h2>{_grid(stage_timings(*told))}"


def _worst(report: Report) -> str:
    if not report.worst:
        return _absent("drawing of worst frames", "there is not one pose to draw")
    about = "The largest ADD(-S), the worst first: the true pose green, the estimate red."
    return f"<h2>Worst frames</h2><p>{about}</p>{_grid(*map(_overlay, report.worst))}"


def _overlay(worst: WorstFrame) -> str:
    which, how = worst_caption(worst)
    if worst.jpeg is None:
        shown = f'<p class="absent">No picture: {escape(worst.why_not)}</p>'
    else:
        data = b64encode(worst.jpeg).decode("ascii")
        shown = f'<img alt="{escape(which)}" src="data:image/jpeg;base64,{data}" width="320" height="240">'
    return f"<figure>{shown}<figcaption>{escape(which)}</figcaption><p>{escape(how)}</p></figure>"


def _missing(report: Report) -> str:
    if not report.missing:
        return _absent("list of missing poses", "every instance has a pose")
    more = len(report.missing) - MOST_GROUPS
    rest = f'<p class="absent">And {more} more groups.</p>' if more > 0 else ""
    return f"<h2>Missing poses</h2>{_text_table(missing_table(report))}{rest}"


def _conventions(report: Report) -> str:
    parts = ["<h2>Protocol</h2>", _definitions(report.scores.protocol)]
    for name, value in report.extra.items():
        if isinstance(value, Mapping):
            parts.append(f"<h2>{escape(name.replace('_', ' ').capitalize())}</h2>{_definitions(value)}")
    return "\n".join(parts)


def _text_table(table: TextTable) -> str:
    return html_table(table.heading, table.rows)


def _definitions(values: Mapping[str, object]) -> str:
    return definitions({name.replace("_", " "): value for name, value in values.items()})


def _grid(*figures: str) -> str:
    return f'<div class="grid">{"".join(figures)}</div>'


def _absent(what: str, why: str) -> str:
    return f'<p class="absent">No {what}: {why}.</p>'
