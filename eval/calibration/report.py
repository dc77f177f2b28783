"""A fit as text: weights to be pasted, and what they are worth as tables."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.table import Table

from eval.calibration.cross_validation import Judgement
from eval.reliability import Reliability
from tracker.geometry import Floats


def pasted(names: Sequence[str], weights: Floats) -> str:
    """Two lines of `tracker.confidence`."""
    named = ", ".join(f'"{name}"' for name in names)
    return f"MEASURES = ({named})\nWEIGHTS = np.array([{', '.join(f'{w:.2f}' for w in weights)}])"


def judgement_table(judgements: Sequence[Judgement], title: str) -> Table:
    out = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    for heading in ("poses of", "count", "wrong", "AUROC", "calibration error"):
        out.add_column(heading, justify="left" if heading == "poses of" else "right", no_wrap=True)
    for each in judgements:
        area = "-" if each.auroc is None else f"{each.auroc:.3f}"
        error = f"{each.reliability.calibration_error:.3f}"
        out.add_row(each.name, str(each.poses), str(each.wrong), area, error)
    return out


def reliability_table(found: Reliability, title: str) -> Table:
    out = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    for heading in ("confidence", "poses", "mean", "right"):
        out.add_column(heading, justify="right", no_wrap=True)
    for each in (each for each in found.bins if each.count):
        out.add_row(
            f"{each.low:.1f} to {each.high:.1f}", str(each.count), f"{each.confidence:.3f}", f"{each.right:.3f}"
        )
    return out
