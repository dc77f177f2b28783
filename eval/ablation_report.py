"""The report of an ablation: the table beside the paper's numbers, as Markdown, as a page and as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from html import escape
from pathlib import Path

from eval.ablation import CellResult, DatasetCells
from eval.ablation_table import column_groups, dataset_labels, not_the_same
from eval.environment import environment
from eval.html_tables import definitions, html_table
from eval.occlusion import Occlusion
from eval.occlusion_text import OCCLUSION_LEGEND, occlusion_tables
from eval.page import page
from eval.preset import Preset
from tracker.whole_file import write_whole

Facts = dict[str, object]


def write_ablation(folder: Path, preset: Preset, found: Sequence[DatasetCells], facts: Facts) -> None:
    """ablation.json, ablation.md and ablation.html, each whole or not at all. facts: of the run, a line each.

    Raises OutputError where they cannot be written."""
    content = json.dumps(as_json(preset, found, facts), indent=1, allow_nan=False) + "\n"
    texts = {"json": content, "md": markdown(preset, found, facts), "html": html(preset, found, facts)}
    for ending, text in texts.items():
        write_whole(folder / f"ablation.{ending}", text)


def markdown(preset: Preset, found: Sequence[DatasetCells], facts: Facts) -> str:
    """The whole report."""
    headings, rows, _ = _grid(preset, found, flat=True)
    lines = [
        f"# {preset.title}",
        "",
        *([preset.about.strip(), ""] if preset.about else []),
        *_ruled(headings, rows),
        "",
    ]
    if legend := not_the_same(preset):
        lines += [f"{legend}.", ""]
    if failed := list(_failures(found)):
        lines += ["Not run:", *(f"- {name}: {failure}" for name, failure in failed), ""]
    for name, occlusion in _occlusions(found):
        lines += [f"## Occlusion and error: {name}", ""]
        for table in occlusion_tables(occlusion):
            lines += [*_ruled(table.heading, table.rows), ""]
        lines += [OCCLUSION_LEGEND, ""]
    return "\n".join([*lines, *(f"- {name}: {value}" for name, value in (_of_datasets(found) | facts).items()), ""])


def html(preset: Preset, found: Sequence[DatasetCells], facts: Facts) -> str:
    """The same as a page that stands alone, its table sorted by a click."""
    headings, rows, groups = _grid(preset, found, flat=False)
    parts = [f"<h1>{escape(preset.title)}</h1>", f"<p>{escape(preset.about.strip())}</p>" if preset.about else ""]
    parts.append(html_table(headings, rows, groups=groups))
    if legend := not_the_same(preset):
        parts.append(f'<p class="legend">{escape(legend)}.</p>')
    if failed := dict(_failures(found)):
        parts += ["<h2>Not run</h2>", definitions(failed)]
    for name, occlusion in _occlusions(found):
        parts.append(f"<h2>Occlusion and error: {escape(name)}</h2>")
        parts += [html_table(table.heading, table.rows) for table in occlusion_tables(occlusion)]
        parts.append(f'<p class="legend">{escape(OCCLUSION_LEGEND)}</p>')
    parts += ["<h2>Run</h2>", definitions(_of_datasets(found) | facts)]
    parts += ["<h2>Environment</h2>", definitions(environment())]
    return page(preset.title, "\n".join(parts))


def as_json(preset: Preset, found: Sequence[DatasetCells], facts: Facts) -> Facts:
    """The same with every metric, the differences of each cell, and what decided it. One dataset is told at the top
    level; several are a list of the same under `datasets`."""
    of_datasets = [
        {
            "cells": [_cell(result) for result in each.results],
            "dataset": each.dataset,
            "scenes": list(each.scene_ids),
            "instances": each.instances,
        }
        for each in found
    ]
    return {
        "title": preset.title,
        "columns": list(preset.columns),
        "paper_is": not_the_same(preset) or None,
        **(of_datasets[0] if len(found) == 1 else {"datasets": of_datasets}),
        **facts,
        "environment": environment(),
    }


def _cell(result: CellResult) -> Facts:
    return {
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


def _of_datasets(found: Sequence[DatasetCells]) -> Facts:
    """What there was to score: of several datasets a line each, by the label that the table has for it."""
    if len(found) == 1:
        (only,) = found
        return {"dataset": only.dataset, "scenes": list(only.scene_ids), "instances": only.instances}
    return {
        label: f"{each.dataset}, scenes {', '.join(map(str, each.scene_ids))}, {each.instances} instances"
        for label, each in zip(_labels(found), found, strict=True)
    }


def _grid(
    preset: Preset, found: Sequence[DatasetCells], flat: bool
) -> tuple[list[str], list[list[str]], list[tuple[str, int]]]:
    """Headings, rows, and (label, columns) of each group. flat: for a table of one row of headings, which then say
    the dataset too."""
    groups = column_groups(preset, found)
    headings = [f"{g.label}: {name}" if flat and g.label else name for g in groups for name in g.headings]
    rows = [
        [result.cell.name, *(text for group in groups for text in group.rows[k])]
        for k, result in enumerate(found[0].results)
    ]
    above = [("", 1), *((group.label, len(group.headings)) for group in groups)] if len(found) > 1 else []
    return ["", *headings], rows, above


def _failures(found: Sequence[DatasetCells]) -> Iterator[tuple[str, str]]:
    return ((name, result.failure) for name, result in _named(found) if result.failure)


def _occlusions(found: Sequence[DatasetCells]) -> Iterator[tuple[str, Occlusion]]:
    return ((name, result.occlusion) for name, result in _named(found) if result.occlusion)


def _named(found: Sequence[DatasetCells]) -> Iterator[tuple[str, CellResult]]:
    for label, each in zip(_labels(found), found, strict=True):
        for result in each.results:
            yield f"{result.cell.name} on {label}" if label else result.cell.name, result


def _labels(found: Sequence[DatasetCells]) -> list[str]:
    return dataset_labels([each.dataset for each in found])


def _ruled(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    ruled = ["---", *(["---:"] * (len(headings) - 1))]
    return [f"| {' | '.join(cells)} |" for cells in (headings, ruled, *rows)]
