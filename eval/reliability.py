"""How far a confidence can be trusted: the share of right poses among those of like confidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eval.instances import InstanceError, ObjectInImage

RIGHT_WITHIN_M, RIGHT_WITHIN_DEG = 0.02, 10.0
BINS = 10


@dataclass(frozen=True, slots=True)
class ConfidenceBin:
    """Poses whose confidence is in [low, high), in the last bin in [low, high].

    confidence, right: their mean confidence and the share of them that is right, both in [0, 1]; NaN where count is 0.
    """

    low: float
    high: float
    count: int
    confidence: float
    right: float


@dataclass(frozen=True, slots=True)
class Reliability:
    """calibration_error: the expected calibration error, sum over bins of count / all * |right - confidence|, in
    [0, 1] (Guo et al. 2017, "On Calibration of Modern Neural Networks", equation 3)."""

    bins: tuple[ConfidenceBin, ...]
    calibration_error: float

    @property
    def count(self) -> int:
        return sum(each.count for each in self.bins)


def reliability(
    rows: Sequence[InstanceError], confidences: Mapping[ObjectInImage, float], bins: int = BINS
) -> Reliability | None:
    """Of the instances that have a pose and a confidence in [0, 1]; None where there is not one.

    A pose is right within 2 cm and 10 degrees of the nearest of the declared symmetries. Missing poses are not in it:
    whoever says nothing claims nothing.
    """
    kept = [(r, (r.scene_id, r.object_id, r.image_id)) for r in rows if not r.missing]
    kept = [(r, key) for r, key in kept if key in confidences]
    if not kept:
        return None
    return reliability_of([confidences[key] for _, key in kept], [is_right(r) for r, _ in kept], bins)


def reliability_of(confidences: Sequence[float], right: Sequence[bool], bins: int = BINS) -> Reliability:
    """Of poses with a confidence in [0, 1] each, one at least, and whether each is right."""
    stated, true = np.array(confidences, np.float64), np.array(right, bool)
    place = np.clip((stated * bins + 1e-9).astype(int), 0, bins - 1)  # 0.3 * 10 is a hair under 3
    found = []
    for k in range(bins):
        inside = place == k
        count = int(inside.sum())
        means = (float(stated[inside].mean()), float(true[inside].mean())) if count else (np.nan, np.nan)
        found.append(ConfidenceBin(k / bins, (k + 1) / bins, count, *means))
    error = sum(b.count * abs(b.right - b.confidence) for b in found if b.count) / len(stated)
    return Reliability(tuple(found), float(error))


def is_right(row: InstanceError) -> bool:
    return right_within(row.translation_m, row.symmetric_rotation_deg)


def right_within(error_m: float, error_deg: float) -> bool:
    """Less than 2 cm and 10 degrees off."""
    return error_m < RIGHT_WITHIN_M and error_deg < RIGHT_WITHIN_DEG
