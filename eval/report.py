"""Scores -> JSON, a table for the terminal, and a page that stands alone."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping
from html import escape
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from eval.plots import error_curve, error_over_time
from eval.score import Metrics, Scores
from tracker.errors import OutputError

Columns = Mapping[str, tuple[str, int]]  # name in scores.json -> heading, digits

COLUMNS: Columns = {
    "add_auc": ("ADD", 1),
    "adds_auc": ("ADD-S", 1),
    "add_auc_2cm": ("ADD 2cm", 1),
    "adds_auc_2cm": ("ADD-S 2cm", 1),
    "over_1cm": ("> 1cm", 1),
    "instances": ("n", 0),
    "missing": ("missing", 0),
    "false_tracks": ("false", 0),
}
LEGEND = (
    "ADD and ADD-S: area under the curve up to 10 cm and, 2cm, up to 2 cm, in percent (VOCap). > 1cm: percent of the "
    "n instances with an ADD over 1 cm. missing: instances without a pose. false: poses of what cannot be seen."
)
BOP_COLUMNS: Columns = {
    "ar": ("AR", 3),
    "ar_vsd": ("VSD", 3),
    "ar_mssd": ("MSSD", 3),
    "ar_mspd": ("MSPD", 3),
    "add_or_adds_auc": ("ADD(-S)", 1),
    "add_or_adds_auc_2cm": ("2cm", 1),
    "add_or_adds_recall_0.1d": ("0.1d", 1),
}
BOP_LEGEND = (
    "AR: BOP's average recall, the mean of those by VSD, MSSD and MSPD. ADD(-S): ADD-S of the symmetric objects, ADD "
    "of the others; areas up to 10 cm and 2 cm, and percent of the instances under 0.1 diameters. -: not measured, the "
    "protocol says why."
)
POSE_COLUMNS: Columns = {
    "recall_5deg_2cm": ("5° 2cm", 1),
    "recall_10deg_5cm": ("10° 5cm", 1),
    "iou_mean": ("IoU", 1),
    "iou_recall_50": ("> 50%", 1),
    "iou_recall_75": ("> 75%", 1),
}
POSE_LEGEND = (
    "Percent of the instances within an angle and a distance. IoU: mean 3D overlap of the bounding boxes, and percent "
    "of the instances whose overlap is larger."
)
TABLES = (("", COLUMNS, LEGEND), ("BOP", BOP_COLUMNS, BOP_LEGEND), ("Poses and boxes", POSE_COLUMNS, POSE_LEGEND))
PACKAGES = ("conceptrack", "torch", "numpy", "scipy", "open3d", "opencv-python-headless", "small_gicp", "filterpy")


def environment() -> dict[str, str]:
    """What the run ran on: machine and versions, so that a table can be made again."""
    versions = {"python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed as a package"
    return versions


def write_scores(path: Path, scores: Scores, extra: Mapping[str, object]) -> None:
    """scores.json: protocol and metrics, and beside them what the caller adds."""
    path.write_text(json.dumps({**scores.as_json(), **extra}, indent=1, allow_nan=False) + "\n")


def write_figures(path: Path, figures: Mapping[str, object]) -> None:
    """Figures of a measurement as JSON, with what it ran on; whole or not at all. Raises OutputError."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(json.dumps({**figures, "environment": environment()}, indent=1, allow_nan=False) + "\n")
        partial.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error


def tables(scores: Scores, title: str) -> list[Table]:
    """Narrow ones, each with a row an object, the mean of objects, and all instances pooled."""
    return [_table(scores, heading or title, columns, legend) for heading, columns, legend in TABLES]


def _table(scores: Scores, title: str, columns: Columns, legend: str) -> Table:
    out = Table(title=title, caption=legend, caption_justify="left", box=SIMPLE_HEAD, padding=(0, 0), pad_edge=False)
    for heading in ("object", *(heading for heading, _ in columns.values())):
        out.add_column(heading, justify="left" if heading == "object" else "right", no_wrap=True)
    for name, metrics in scores.per_object.items():
        out.add_row(name, *_cells(metrics, columns))
    out.add_section()
    out.add_row("mean of objects", *_cells(scores.mean_of_objects, columns))
    out.add_row("pooled", *_cells(scores.pooled, columns), style="bold")
    return out


def write_html(path: Path, scores: Scores, extra: Mapping[str, object], title: str) -> None:
    """report.html: tables, curves and the whole protocol in one file without a script or a link."""
    errors = {
        "ADD": np.array([row.add_m for row in scores.instances]),
        "ADD-S": np.array([row.adds_m for row in scores.instances]),
    }
    sections = [
        f"<h1>{escape(title)}</h1>",
        *(part for each in TABLES for part in _html_table(scores, *each)),
        "<h2>How large are the errors?</h2>",
        error_curve(errors),
        "<h2>When do they happen?</h2>",
        error_over_time(scores.instances),
        "<h2>Protocol</h2>",
        _definitions(scores.protocol),
        *(f"<h2>{escape(name.replace('_', ' ').capitalize())}</h2>{_definitions(value)}"
          for name, value in extra.items() if isinstance(value, Mapping)),
    ]  # fmt: skip
    path.write_text(PAGE.format(title=escape(title), body="\n".join(sections)), encoding="utf-8")


def _html_table(scores: Scores, heading: str, columns: Columns, legend: str) -> list[str]:
    rows = [_row(name, metrics, columns) for name, metrics in scores.per_object.items()]
    rows += [_row("mean of objects", scores.mean_of_objects, columns), _row("pooled", scores.pooled, columns)]
    headings = "".join(f"<th>{escape(h)}</th>" for h in ("object", *(heading for heading, _ in columns.values())))
    return [
        *([f"<h2>{escape(heading)}</h2>"] if heading else []),
        f"<div class=wide><table><thead><tr>{headings}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>",
        f"<p>{escape(legend)}</p>",
    ]


def _cells(metrics: Metrics, columns: Columns) -> list[str]:
    values = {name: metrics.get(name, np.nan) for name in columns}
    return ["-" if np.isnan(values[name]) else f"{values[name]:.{digits}f}" for name, (_, digits) in columns.items()]


def _row(name: str, metrics: Metrics, columns: Columns) -> str:
    strong = ' class="total"' if name in ("pooled", "mean of objects") else ""
    return f"<tr{strong}><td>{escape(name)}</td>{''.join(f'<td>{cell}</td>' for cell in _cells(metrics, columns))}</tr>"


def _definitions(values: Mapping[str, object]) -> str:
    def text(value: object) -> str:
        if isinstance(value, Mapping):
            return ", ".join(f"{k}: {text(v)}" for k, v in value.items()) or "-"
        if isinstance(value, list | tuple):
            return ", ".join(text(v) for v in value) or "-"
        return f"{value:.3g}" if isinstance(value, float) else str(value)

    pairs = (f"<dt>{escape(str(k).replace('_', ' '))}</dt><dd>{escape(text(v))}</dd>" for k, v in values.items())
    return f"<dl>{''.join(pairs)}</dl>"


PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; --ink: light-dark(#1a1a1a, #e8e8e8); --faint: light-dark(#d5d5d5, #444);
  --paper: light-dark(#fff, #161616); --add: #d55e00; --adds: #0072b2; }}
body {{ font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 62rem;
  margin: 2rem auto; padding: 0 1rem; }}
h1 {{ font-size: 1.5rem; }} h2 {{ font-size: 1.1rem; margin-top: 2rem; }}
.wide {{ overflow-x: auto; }}
table {{ border-collapse: collapse; font-variant-numeric: tabular-nums; }}
th, td {{ padding: .25rem .7rem; text-align: right; white-space: nowrap; border-bottom: 1px solid var(--faint); }}
th:first-child, td:first-child {{ text-align: left; }} .total td {{ font-weight: 600; }}
dl {{ display: grid; grid-template-columns: minmax(8rem, 14rem) 1fr; gap: .2rem 1rem; }}
dt {{ opacity: .7; }} dd {{ margin: 0; overflow-wrap: anywhere; }}
svg {{ max-width: 100%; height: auto; display: block; }}
svg text {{ fill: var(--ink); font: 12px system-ui, sans-serif; }}
</style></head><body>
{body}
</body></html>
"""
