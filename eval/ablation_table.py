"""The table of an ablation: a row a cell of the preset, and side by side the columns of every dataset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.box import SIMPLE_HEAD
from rich.table import Table

from eval.ablation import CellResult, DatasetCells
from eval.preset import COLUMNS, Preset
from tracker.errors import ConfigError

PAPER = "paper"


@dataclass(frozen=True, slots=True)
class ColumnGroup:
    """Columns that belong together. label: of the dataset, empty where there is only one. headings: of the columns.
    rows: as text, one a cell of the preset."""

    label: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def dataset_labels(names: Sequence[str]) -> list[str]:
    """The ends of the datasets' names, as short as tells them apart; an empty text for one that stands alone.

    Raises ConfigError where a dataset is there twice."""
    parts = [name.rstrip("/").split("/") for name in names]
    if len({tuple(each) for each in parts}) < len(parts):
        raise ConfigError(f"--dataset: each once, got {', '.join(names)}")
    if len(names) == 1:
        return [""]
    return [_shortest_end(own, [other for other in parts if other is not own]) for own in parts]


def _shortest_end(own: Sequence[str], others: Sequence[Sequence[str]]) -> str:
    ends = (own[-length:] for length in range(1, len(own)))
    return "/".join(next((end for end in ends if all(other[-len(end) :] != end for other in others)), own))


def not_the_same(preset: Preset) -> str:
    """Why the paper's numbers are not to be compared one by one; empty where there are none."""
    if not any(variation.paper for axis in preset.axes for variation in axis):
        return ""
    return f"paper: not the same data ({preset.paper_data or 'as the paper says'}); compare the trend, not the numbers"


def column_groups(preset: Preset, found: Sequence[DatasetCells]) -> list[ColumnGroup]:
    """A group a dataset. What the paper has stands beside each column of ours where there is one dataset; where there
    are several, it is the last group."""
    results = found[0].results
    told = {column for result in results for column in result.cell.paper}
    if len(found) == 1:
        columns = [
            (column, paper) for column in preset.columns for paper in ((False, True) if column in told else (False,))
        ]
        headings = tuple(f"({PAPER})" if paper else COLUMNS[column][0] for column, paper in columns)
        rows = [[_paper(r, column) if paper else _ours(r, column) for column, paper in columns] for r in results]
        return [ColumnGroup("", headings, tuple(map(tuple, rows)))]
    headings = tuple(COLUMNS[column][0] for column in preset.columns)
    groups = [
        ColumnGroup(label, headings, tuple(tuple(_ours(r, c) for c in preset.columns) for r in each.results))
        for label, each in zip(dataset_labels([each.dataset for each in found]), found, strict=True)
    ]
    if shared := [column for column in preset.columns if column in told]:
        of_paper = tuple(tuple(_paper(result, column) for column in shared) for result in results)
        groups.append(ColumnGroup(PAPER, tuple(COLUMNS[column][0] for column in shared), of_paper))
    return groups


def terminal_table(preset: Preset, found: Sequence[DatasetCells]) -> Table:
    """A row a cell, and under it the paper's where it has one: side by side they are too wide for a terminal. So are
    datasets, which stand one under the other in the same columns."""
    legend = not_the_same(preset)
    out = Table(
        title=preset.title, caption=legend, caption_justify="left", box=SIMPLE_HEAD, padding=(0, 0), pad_edge=False
    )
    out.add_column("", overflow="fold")  # names are told apart by their ends
    for column in preset.columns:
        out.add_column(COLUMNS[column][0], justify="right", min_width=5)
    for label, each in zip(dataset_labels([each.dataset for each in found]), found, strict=True):
        if label:
            out.add_section()
            out.add_row(label, style="bold")
        for result in each.results:
            out.add_row(result.cell.name, *(_ours(result, column) for column in preset.columns))
            if result.cell.paper:
                out.add_row(f"  {PAPER}", *(_paper(result, column) for column in preset.columns), style="dim")
    return out


def _ours(result: CellResult, column: str) -> str:
    return _text(result.value(column), column)


def _paper(result: CellResult, column: str) -> str:
    return _text(result.cell.paper.get(column), column)


def _text(value: float | None, column: str) -> str:
    return "-" if value is None else f"{value:.{COLUMNS[column][1]}f}"
