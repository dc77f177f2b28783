"""An ablation as a table beside the paper's, for the terminal, as Markdown and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.table import Table

from eval.ablation import CellResult
from eval.environment import environment
from eval.occlusion import Line, Occlusion
from eval.preset import COLUMNS, Preset
from tracker.whole_file import write_whole

ERRORS = {"add": "ADD", "adds": "ADD-S"}


def not_the_same(preset: Preset) -> str:
    """Why the paper's numbers are not to be compared one by one; empty where there are none."""
    if not any(variation.paper for axis in preset.axes for variation in axis):
        return ""
    return f"paper: not the same data ({preset.paper_data or 'as the paper says'}); compare the trend, not the numbers"


def terminal_table(preset: Preset, results: Sequence[CellResult]) -> Table:
    """A row a cell, and under it the paper's where it has one: side by side they are too wide for a terminal."""
    legend = not_the_same(preset)
    out = Table(
        title=preset.title, caption=legend, caption_justify="left", box=SIMPLE_HEAD, padding=(0, 0), pad_edge=False
    )
    for column in ("", *preset.columns):
        heading = COLUMNS[column][0] if column else ""
        out.add_column(heading, justify="right" if column else "left", min_width=5 if column else None)
    for result in results:
        out.add_row(result.cell.name, *(_text(result.value(column), column) for column in preset.columns))
        if result.cell.paper:
            told = (_text(result.cell.paper.get(column), column) for column in preset.columns)
            out.add_row("  paper", *told, style="dim")
    return out


def markdown(preset: Preset, results: Sequence[CellResult], facts: dict[str, object]) -> str:
    """The whole report. facts: of the run, a line each."""
    headings, rows = _cells(preset, results)
    lines = [f"# {preset.title}", "", *([preset.about.strip(), ""] if preset.about else []), *_grid(headings, rows), ""]
    if legend := not_the_same(preset):
        lines += [f"{legend}.", ""]
    if failed := [result for result in results if result.failure]:
        lines += ["Not run:", *(f"- {result.cell.name}: {result.failure}" for result in failed), ""]
    for result in results:
        if result.occlusion:
            lines += [f"## Occlusion and error: {result.cell.name}", "", *_occlusion(result.occlusion), ""]
    return "\n".join([*lines, *(f"- {name}: {value}" for name, value in facts.items()), ""])


def as_json(preset: Preset, results: Sequence[CellResult], facts: dict[str, object]) -> dict[str, object]:
    """The same with every metric, the differences of each cell, and what decided it."""
    cells = [
        {
            "name": result.cell.name,
            "options": result.cell.options.model_dump(exclude_none=True),
            "config": result.cell.config,
            "failure": result.failure or None,
            "paper": result.cell.paper,
            **(result.scores.as_json() if result.scores else {}),
            "latency_ms": result.latency_ms,
            "occlusion": asdict(result.occlusion) if result.occlusion else None,
            "scenes": list(result.fingerprints),
        }
        for result in results
    ]
    return {
        "title": preset.title,
        "columns": list(preset.columns),
        "paper_is": not_the_same(preset) or None,
        "cells": cells,
        **facts,
        "environment": environment(),
    }


def write_ablation(folder: Path, preset: Preset, results: Sequence[CellResult], facts: dict[str, object]) -> None:
    """ablation.json and ablation.md, each whole or not at all. Raises OutputError where they cannot be written."""
    content = json.dumps(as_json(preset, results, facts), indent=1, allow_nan=False) + "\n"
    for name, text in (("ablation.json", content), ("ablation.md", markdown(preset, results, facts))):
        write_whole(folder / name, text)


def _cells(preset: Preset, results: Sequence[CellResult]) -> tuple[list[str], list[list[str]]]:
    """Headings and rows: each column of ours, followed by the paper's where it has one."""
    has_paper = {column for result in results for column in result.cell.paper}
    headings = [""]
    for column in preset.columns:
        headings += [COLUMNS[column][0], *(["(paper)"] if column in has_paper else [])]
    rows = []
    for result in results:
        row = [result.cell.name]
        for column in preset.columns:
            row.append(_text(result.value(column), column))
            if column in has_paper:
                row.append(_text(result.cell.paper.get(column), column))
        rows.append(row)
    return headings, rows


def _text(value: float | None, column: str) -> str:
    return "-" if value is None else f"{value:.{COLUMNS[column][1]}f}"


def _grid(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    ruled = ["---", *(["---:"] * (len(headings) - 1))]
    return [f"| {' | '.join(cells)} |" for cells in (headings, ruled, *rows)]


def _occlusion(found: Occlusion) -> list[str]:
    bands = [
        [f"{b.low:.0%} to {b.high:.0%}", str(b.instances), str(b.missing), _mm(b.add_mm), _mm(b.adds_mm)]
        for b in found.bands
    ]
    lines = [
        [ERRORS[error], name, str(one.pairs), str(one.missing), *_line(one)]
        for error, of_objects in found.lines.items()
        for name, one in of_objects.items()
    ]
    return [
        *_grid(["hidden", "n", "missing", "median ADD mm", "median ADD-S mm"], bands),
        "",
        *_grid(["error", "object", "n", "missing", "mm per 10 % hidden", "r", "R²"], lines),
        "",
        "Lines are least squares over the instances with a pose; a missing pose has no error and is counted beside. "
        "The paper (LINEMOD-Occlusion, pairs of images, ADD-S): R² < 0.3 for every object. Not the same data.",
    ]


def _line(one: Line) -> list[str]:
    if one.slope_mm is None or one.r is None or one.r2 is None:
        return ["-", "-", "-"]
    return [f"{one.slope_mm / 10:+.2f}", f"{one.r:+.2f}", f"{one.r2:.2f}"]


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
