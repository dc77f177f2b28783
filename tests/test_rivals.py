"""Poses in one place that are turned otherwise: how they speak against each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tracker.concept import ConceptModel
from tracker.confidence import Grounds
from tracker.found import Found
from tracker.geometry import Pose
from tracker.refinement import Refined
from tracker.rivals import rival, told_apart
from tracker.search import Hypothesis
from tracker.verification import Evidence
from tracker.view import ObjectView

GOOD = Evidence(
    score=0.6, surface=0.9, colour=0.8, contradicted=0.05, seen_through=0.0, outside=0.0, hidden=0.0, explained=0.9,
    proved=0.8,
)  # fmt: skip
POSE = Pose(np.eye(3), np.array((0, 0, 0.7)))


def found(view: ObjectView, turn_rad: float, shift_m: float = 0.0, evidence: Evidence = GOOD) -> Found:
    pose = POSE.nudged(np.array((turn_rad, 0, 0, shift_m, 0, 0)))
    hypothesis = Hypothesis(Refined(pose, np.eye(6), np.zeros((0, 6)), 0.0, 100), evidence, "turn", view)
    return Found(hypothesis, Grounds(evidence, 0.01), 0.9, expected=True, masked=False)


@pytest.mark.parametrize(
    ("turn_rad", "shift_m", "score", "is_rival"),
    [(0.8, 0.0, 0.7, True), (0.8, 0.0, 0.63, False), (0.1, 0.0, 0.7, False), (0.8, 0.3, 0.7, False)],
)
def test_what_explains_clearly_more_and_is_turned_otherwise_is_a_rival(
    turn_rad: float, shift_m: float, score: float, is_rival: bool, can_model: ConceptModel, can_view: ObjectView
) -> None:
    astray, other = found(can_view, 0.0), found(can_view, turn_rad, shift_m, replace(GOOD, score=score))
    assert rival(astray, (astray, other), can_model) == (other.hypothesis.refined.T_cam_obj if is_rival else None)
    assert rival(other, (astray, other), can_model) is None


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_of_poses_that_fit_alike_each_is_as_likely(turns: int, can_model: ConceptModel, can_view: ObjectView) -> None:
    tried = [found(can_view, 0.5 * k) for k in range(turns + 1)]
    again = [found(can_view, 0.5 * k + 0.05) for k in range(turns + 1)]  # what leads to the same says nothing new
    for one in tried:
        assert told_apart(one, tried, can_model) == pytest.approx(1 / (turns + 1))
        assert told_apart(one, [*tried, *again], can_model) == pytest.approx(1 / (turns + 1))


def test_what_fits_worse_or_is_elsewhere_speaks_less_against_it(can_model: ConceptModel, can_view: ObjectView) -> None:
    best = found(can_view, 0.0)
    worse = found(can_view, 0.8, evidence=replace(GOOD, colour=GOOD.colour / 2))
    assert 0.5 < told_apart(best, [best, worse], can_model) < 1
    assert told_apart(best, [best, worse], can_model) + told_apart(worse, [best, worse], can_model) == pytest.approx(1)
    assert told_apart(best, [best, found(can_view, 0.8, 0.3)], can_model) == 1


def test_what_was_expected_says_nothing(can_model: ConceptModel, can_view: ObjectView) -> None:
    best, other = found(can_view, 0.0), found(can_view, 0.8)
    surprising = replace(other, grounds=replace(other.grounds, turn_rad=0.8))
    assert told_apart(best, [best, other], can_model) == told_apart(best, [best, surprising], can_model)
