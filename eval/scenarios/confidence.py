"""What a confidence is worth over the poses of all frames of all runs together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

from eval.reliability import Reliability, reliability_of
from eval.scenarios.frame_log import FrameLog


@dataclass(frozen=True, slots=True)
class ConfidenceQuality:
    """Of `poses` poses, of which `bad` are not right (`FrameLog.right`). auroc: as a detector of the bad ones, None
    where there are only good or only bad ones. reliability: None where there is no pose."""

    poses: int
    bad: int
    auroc: float | None
    reliability: Reliability | None


def confidence_quality(frames: Iterable[FrameLog]) -> ConfidenceQuality:
    """A pose of an object out of sight is bad, however near. Frames without a pose claim nothing, and are not in it."""
    posed = [frame for frame in frames if frame.tracking]
    stated, right = [frame.confidence for frame in posed], [frame.right for frame in posed]
    found = reliability_of(stated, right) if posed else None
    return ConfidenceQuality(len(posed), len(posed) - sum(right), auroc(stated, right), found)


def auroc(scores: Sequence[float], right: Sequence[bool]) -> float | None:
    """Area under the ROC curve: the chance that a right one has a higher score than a wrong one, a tie counting half
    (Fawcett 2006, "An introduction to ROC analysis", section 7: the Mann-Whitney statistic)."""
    true = np.array(right, bool)
    good, bad = int(true.sum()), int((~true).sum())
    if not good or not bad:
        return None
    return float((rankdata(scores)[true].sum() - good * (good + 1) / 2) / (good * bad))
