"""The two AUCs of every object."""

from __future__ import annotations

import math

from eval.plots.bars import Bars, bars
from eval.plots.figure import ADD_COLOUR, ADDS_COLOUR
from eval.score import Scores


def object_bars(scores: Scores) -> str:
    """ADD-AUC and ADD-S-AUC up to 10 cm, from 0 to 100."""
    groups = []
    for name, metrics in scores.per_object.items():
        values = (metrics.get("add_auc", math.nan), ADD_COLOUR), (metrics.get("adds_auc", math.nan), ADDS_COLOUR)
        groups.append(Bars(name, tuple((value, colour) for value, colour in values if not math.isnan(value))))
    key = [(ADD_COLOUR, "ADD"), (ADDS_COLOUR, "ADD-S")]
    return bars("AUC up to 10 cm by object, %", groups, 100.0, "%", key)
