"""The tables of a report: which numbers stand in which column, and their drawing in a terminal."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from eval.score import Scores
from eval.summary import Metrics

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


def cells(metrics: Metrics, columns: Columns) -> list[str]:
    """The numbers of a row as text; "-" for what was not measured."""
    values = {name: metrics.get(name, np.nan) for name in columns}
    return ["-" if np.isnan(values[name]) else f"{values[name]:.{digits}f}" for name, (_, digits) in columns.items()]


def headings(columns: Columns) -> list[str]:
    return ["object", *(heading for heading, _ in columns.values())]


def object_rows(scores: Scores, columns: Columns) -> list[list[str]]:
    return [[name, *cells(metrics, columns)] for name, metrics in scores.per_object.items()]


def total_rows(scores: Scores, columns: Columns) -> list[list[str]]:
    """The mean of objects, and all instances pooled."""
    return [
        ["mean of objects", *cells(scores.mean_of_objects, columns)],
        ["pooled", *cells(scores.pooled, columns)],
    ]


def tables(scores: Scores, title: str) -> list[Table]:
    """Narrow ones for a terminal, each with a row an object, the mean of objects, and all instances pooled."""
    return [_table(scores, heading or title, columns, legend) for heading, columns, legend in TABLES]


def _table(scores: Scores, title: str, columns: Columns, legend: str) -> Table:
    out = Table(title=title, caption=legend, caption_justify="left", box=SIMPLE_HEAD, padding=(0, 0), pad_edge=False)
    for heading in headings(columns):
        out.add_column(heading, justify="left" if heading == "object" else "right", no_wrap=True)
    for row in object_rows(scores, columns):
        out.add_row(*row)
    out.add_section()
    mean, pooled = total_rows(scores, columns)
    out.add_row(*mean)
    out.add_row(*pooled, style="bold")
    return out
