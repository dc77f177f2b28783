"""From what a frame shows to the best explained pose: wherever it is, near where it is expected, or none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tracker.appearance import ViewAppearance
from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.declared_symmetry import parse_symmetry
from tracker.geometry import Pose
from tracker.refinement import Refined
from tracker.registration import Candidate, register
from tracker.search import Hypothesis, Search, Sight, preferred
from tracker.stopwatch import Stopwatch
from tracker.verification import NOTHING_SEEN, Evidence, Verifier
from tracker.view import ObjectView


@pytest.fixture(scope="module")
def can_sight(can_view: ObjectView, can_cloud: PointCloud) -> Sight:
    return Sight.of(can_view, can_cloud)


@pytest.fixture(scope="module")
def can_search(can_model: ConceptModel) -> Search:
    return Search(can_model, TrackerConfig())


def assert_found(found: Hypothesis | None, truth: Pose, *origins: str) -> None:
    assert found is not None
    assert found.refined.T_cam_obj.distance_to_m(truth) < 0.003
    assert np.degrees(found.refined.T_cam_obj.angle_to_rad(truth)) < 3
    assert found.origin in origins


def test_without_a_prediction_it_is_found_anywhere(can_search: Search, can_sight: Sight, can_truth: Pose) -> None:
    clock = Stopwatch()
    assert_found(can_search(can_sight, None, clock), can_truth, "search")
    assert "registration" in clock.timings_ms()


def test_near_the_prediction_nothing_is_sampled(can_search: Search, can_sight: Sight, can_truth: Pose) -> None:
    clock = Stopwatch()
    near = can_truth.nudged(np.array((0.1, -0.05, 0.1, 0.005, -0.005, 0.01)))
    assert_found(can_search(can_sight, near, clock), can_truth, "concepts", "prediction")
    assert "registration" not in clock.timings_ms()


def test_a_prediction_that_is_far_off_does_no_harm(can_search: Search, can_sight: Sight, can_truth: Pose) -> None:
    for motion in ((0, 0, 2.0, 0.3, 0, 0), (3.0, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 1.0)):
        found = can_search(can_sight, can_truth.nudged(np.array(motion)), Stopwatch())
        assert_found(found, can_truth, "concepts", "prediction", "search")


def test_it_remembers_nothing(can_search: Search, can_sight: Sight, can_truth: Pose) -> None:
    first = can_search(can_sight, None, Stopwatch())
    can_search(can_sight, can_truth, Stopwatch())
    again = can_search(can_sight, None, Stopwatch())
    assert first is not None
    assert again is not None
    assert np.array_equal(first.refined.T_cam_obj.matrix, again.refined.T_cam_obj.matrix)


def test_candidates_that_a_symmetry_makes_one_are_verified_once(
    can_model: ConceptModel, can_sight: Sight, monkeypatch: pytest.MonkeyPatch
) -> None:
    verified: list[Pose] = []

    def one_and_its_turns(*arguments: Any) -> list[Candidate]:
        best = register(*arguments)[0]
        return [replace(best, T_cam_obj=turned) for turned in parse_symmetry("z:60").equivalents(best.T_cam_obj)]

    def verify(self: Verifier, pose: Pose, view: ObjectView, appearance: ViewAppearance) -> Evidence:
        verified.append(pose)
        return usual(self, pose, view, appearance)

    usual = Verifier.__call__
    monkeypatch.setattr("tracker.search.register", one_and_its_turns)
    monkeypatch.setattr(Verifier, "__call__", verify)
    for symmetry, distinct in (("none", 6), ("z:120", 2), ("z:60", 1), ("z:inf", 1)):
        verified.clear()
        config = TrackerConfig(prior=False, verified=1)
        search = Search(replace(can_model, symmetry=parse_symmetry(symmetry)), config)
        assert search(can_sight, None, Stopwatch()) is not None
        assert len(verified) == distinct + 1  # that one again, refined


@pytest.mark.parametrize(
    ("expected", "elsewhere", "chosen"),
    [
        (0.5, 0.55, "prediction"),  # hardly better: objects seldom jump
        (0.5, 0.65, "search"),
        (0.2, 0.22, "search"),  # the expected pose is not acceptable, so nothing speaks for it
        (0.2, 0.15, "prediction"),
        (None, 0.3, "search"),
        (0.5, None, "prediction"),
    ],
)
def test_a_pose_found_elsewhere_has_to_be_clearly_better(
    expected: float | None, elsewhere: float | None, chosen: str, can_view: ObjectView
) -> None:
    def found(score: float | None, origin: str) -> Hypothesis | None:
        if score is None:
            return None
        refined = Refined(Pose.identity(), np.eye(6), np.zeros((0, 6)), 0.0, 100)
        return Hypothesis(refined, replace(NOTHING_SEEN, score=score), origin, can_view)

    config = TrackerConfig(accept=0.25, jump=0.1)
    best = preferred(found(expected, "prediction"), found(elsewhere, "search"), config)
    assert best is not None
    assert best.origin == chosen
