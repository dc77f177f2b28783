"""Does the error grow with occlusion? Rows of errors and what can be seen -> regression lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import linregress

from eval.datasets import Dataset
from eval.instances import InstanceError

LEAST_PAIRS = 3  # two points lie on a line whatever they are
EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # of the hidden fraction


@dataclass(frozen=True, slots=True)
class Line:
    """error_mm = intercept_mm + slope_mm x hidden fraction, by least squares over `pairs` instances with a pose.

    r: Pearson's correlation; r2: its square, the share of the errors' variance that the line explains (the paper's
    figure has it for ADD-S). None where fewer than three instances, or no two that differ in either, are there.
    missing: instances without a pose, which have no error and are not in the line."""

    pairs: int
    missing: int
    slope_mm: float | None
    intercept_mm: float | None
    r: float | None
    r2: float | None


@dataclass(frozen=True, slots=True)
class Band:
    """Instances of which this much is hidden: low <= hidden < high (the last band includes its end)."""

    low: float
    high: float
    instances: int
    missing: int
    add_mm: float | None
    adds_mm: float | None


@dataclass(frozen=True, slots=True)
class Occlusion:
    """lines: error ("add", "adds") -> object, or "pooled" -> line. bands: medians over all objects."""

    lines: Mapping[str, Mapping[str, Line]]
    bands: tuple[Band, ...]


def occlusion(dataset: Dataset, rows: Sequence[InstanceError]) -> Occlusion:
    """The hidden fraction is 1 - `visible_fraction` of the dataset's targets."""
    seen = {
        (scene_id, t.image_id, t.object_id): t.visible_fraction
        for scene_id in {row.scene_id for row in rows}
        for t in dataset.targets(scene_id)
    }
    hidden = np.array([1 - seen[row.scene_id, row.image_id, row.object_id] for row in rows])
    objects = np.array([row.object_id for row in rows], dtype=object)
    errors_mm = {
        "add": 1000 * np.array([row.add_m for row in rows]),
        "adds": 1000 * np.array([row.adds_m for row in rows]),
    }
    groups = {name: objects == name for name in dict.fromkeys(objects)} | {"pooled": np.ones(len(rows), bool)}
    lines = {
        error: {name: line(hidden[group], values[group]) for name, group in groups.items()}
        for error, values in errors_mm.items()
    }
    return Occlusion(lines, tuple(_bands(hidden, errors_mm)))


def line(hidden: np.ndarray, error_mm: np.ndarray) -> Line:
    """hidden: (N,) fractions. error_mm: (N,), infinite where there is no pose."""
    there = np.isfinite(error_mm)
    x, y = hidden[there], error_mm[there]
    missing = int((~there).sum())
    if len(x) < LEAST_PAIRS or np.ptp(x) == 0 or np.ptp(y) == 0:
        return Line(len(x), missing, None, None, None, None)
    fit: tuple[float, ...] = tuple(linregress(x, y))
    slope, intercept, r = map(float, fit[:3])
    return Line(len(x), missing, slope, intercept, r, r * r)


def _bands(hidden: np.ndarray, errors_mm: Mapping[str, np.ndarray]) -> list[Band]:
    bands = []
    for low, high in pairwise(EDGES):
        chosen = (hidden >= low) & ((hidden < high) | (high == EDGES[-1]))
        there = chosen & np.isfinite(errors_mm["add"])
        add, adds = (float(np.median(errors_mm[name][there])) if there.any() else None for name in ("add", "adds"))
        bands.append(Band(low, high, int(chosen.sum()), int((chosen & ~there).sum()), add, adds))
    return bands
