"""The report in GitHub's Markdown: the page's tables, for an issue or a repository."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from eval.report import Report
from eval.report_text import (
    MOST_GROUPS,
    TextTable,
    about_published,
    latency,
    missing_table,
    plain,
    published_conventions,
    published_table,
    reliability_table,
    worst_table,
)
from eval.score_tables import TABLES, headings, object_rows, total_rows


def write_markdown(path: Path, report: Report) -> None:
    """All tables and the whole protocol; charts and pictures are in the page alone."""
    path.write_text("\n\n".join(_parts(report)) + "\n", encoding="utf-8")


def _parts(report: Report) -> Iterable[str]:
    yield f"# {_safe(report.title)}"
    for heading, columns, legend in TABLES:
        yield from [f"## {heading}"] if heading else []
        totals = [[f"**{_safe(cell)}**" for cell in row] for row in total_rows(report.scores, columns)]
        rows = [[_safe(cell) for cell in row] for row in object_rows(report.scores, columns)]
        yield _table(headings(columns), [*rows, *totals], words=1)
        yield _safe(legend)
    if report.anchors:
        yield "## Beside published numbers"
        yield _text_table(published_table(report), words=1)
        yield _safe(about_published(report))
        yield _definitions(published_conventions())
    confidence = reliability_table(report)
    if confidence is not None and report.reliability is not None:
        yield "## Confidence"
        yield _text_table(confidence, words=0)
        yield f"Expected calibration error: {100 * report.reliability.calibration_error:.1f} %."
    told = latency(report)
    if told is not None:
        median, p95, stages = told
        rows = (("whole, median", f"{median:.1f}"), ("whole, p95", f"{p95:.1f}"))
        yield "## Milliseconds of an object and frame"
        yield _text_table(TextTable(("stage", "ms"), (*rows, *((k, f"{v:.1f}") for k, v in stages.items()))), words=1)
    if report.worst:
        yield "## Worst frames"
        yield _text_table(worst_table(report), words=0)
    if report.missing:
        yield "## Missing poses"
        yield _text_table(missing_table(report), words=0)
        more = len(report.missing) - MOST_GROUPS
        yield from [f"And {more} more groups."] if more > 0 else []
    yield "## Protocol"
    yield _definitions(report.scores.protocol)
    for name, value in report.extra.items():
        if isinstance(value, Mapping) and name != "latency_ms":
            yield f"## {_safe(name.replace('_', ' ').capitalize())}"
            yield _definitions(value)


def _text_table(table: TextTable, words: int) -> str:
    return _table(table.heading, [[_safe(cell) for cell in row] for row in table.rows], words)


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]], words: int) -> str:
    """rows: safe already. words: how many of the first columns are not numbers."""
    lines = [
        [_safe(name) for name in heading],
        [":--" if k < words else "--:" for k in range(len(heading))],
        *rows,
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _definitions(values: Mapping[str, object]) -> str:
    return "\n".join(f"- {_safe(k.replace('_', ' '))}: {_safe(plain(v))}" for k, v in values.items())


def _safe(text: str) -> str:
    """Text that Markdown shows as it is and that stays in its cell."""
    return re.sub(r"([\\`*_\[\]<>|&#~!])", r"\\\1", " ".join(text.split()))
