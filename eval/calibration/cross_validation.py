"""What a fit is worth in scenes of a kind, and for objects, that it has not seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eval.calibration.logistic import chances, fit
from eval.calibration.rows import TrainingSet
from eval.reliability import Reliability, reliability_of
from eval.scenarios.confidence import auroc
from tracker.errors import ConfigError
from tracker.geometry import Floats


@dataclass(frozen=True, slots=True)
class Judgement:
    """Of confidences in some poses. name: which poses. auroc: as a detector of the wrong ones, None where there are
    only right or only wrong ones."""

    name: str
    poses: int
    wrong: int
    auroc: float | None
    reliability: Reliability


def held_out_chances(rows: TrainingSet, groups: np.ndarray) -> Floats:
    """(N,) each by the weights that are fitted to the other groups; groups: (N,), which one each row is in.

    Raises ConfigError where there is one group only, or where the others have only right or only wrong poses.
    """
    names = np.unique(groups)
    if len(names) < 2:
        raise ConfigError(f"cross validation needs two scenes or objects at least, there is {', '.join(names)}")
    found = np.zeros(len(rows.right))
    for name in names:
        out = groups == name
        weights = fit(rows.measures[~out], rows.right[~out], rows.weights[~out])
        found[out] = chances(rows.measures[out], weights)
    return found


def judge(name: str, confidences: Floats, right: np.ndarray) -> Judgement:
    """Confidences (N,) in [0, 1] of poses, and whether each is right (N,)."""
    stated, true = confidences.tolist(), right.tolist()
    return Judgement(name, len(true), len(true) - sum(true), auroc(stated, true), reliability_of(stated, true))


def judge_by_scene(confidences: Floats, rows: TrainingSet) -> list[Judgement]:
    """One a kind of scene, in alphabetical order."""
    kinds = np.unique(rows.scenes)
    return [judge(str(k), confidences[rows.scenes == k], rows.right[rows.scenes == k]) for k in kinds]
