"""From what a frame shows to the best explained pose: wherever it is, near where it is expected, or none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from tracker.appearance import ViewAppearance
from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.declared_symmetry import parse_symmetry
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.refinement import Refined
from tracker.registration import Candidate, register
from tracker.search import Hypothesis, Search, Sight, preferred
from tracker.stopwatch import Stopwatch
from tracker.verification import NOTHING_SEEN, Evidence, Verifier
from tracker.view import ObjectView, ViewConfig, view_object


@pytest.fixture(scope="module")
def can_sight(can_view: ObjectView) -> Sight:
    return Sight.of(can_view, masked=True)


@pytest.fixture(scope="module")
def can_search(can_model: ConceptModel) -> Search:
    return Search(can_model, TrackerConfig())


def assert_found(found: Hypothesis | None, truth: Pose, *origins: str) -> None:
    assert found is not None
    assert found.refined.T_cam_obj.distance_to_m(truth) < 0.003
    assert np.degrees(found.refined.T_cam_obj.angle_to_rad(truth)) < 3
    assert found.origin in origins


def test_without_a_prediction_it_is_found_anywhere(
    can_search: Search, can_sight: Sight, can_cloud: PointCloud, can_truth: Pose
) -> None:
    clock = Stopwatch()
    assert_found(can_search(can_sight, can_cloud, None, clock), can_truth, "search")
    assert "registration" in clock.timings_ms()


def test_near_the_prediction_nothing_is_sampled(
    can_search: Search, can_sight: Sight, can_cloud: PointCloud, can_truth: Pose
) -> None:
    clock = Stopwatch()
    near = can_truth.nudged(np.array((0.1, -0.05, 0.1, 0.005, -0.005, 0.01)))
    assert_found(can_search(can_sight, can_cloud, near, clock), can_truth, "concepts", "prediction")
    assert "registration" not in clock.timings_ms()


def test_a_prediction_that_is_far_off_does_no_harm(
    can_search: Search, can_sight: Sight, can_cloud: PointCloud, can_truth: Pose
) -> None:
    for motion in ((0, 0, 2.0, 0.3, 0, 0), (3.0, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 1.0)):
        found = can_search(can_sight, can_cloud, can_truth.nudged(np.array(motion)), Stopwatch())
        assert_found(found, can_truth, "concepts", "prediction", "search")


def test_it_remembers_nothing(can_search: Search, can_sight: Sight, can_cloud: PointCloud, can_truth: Pose) -> None:
    first = can_search(can_sight, can_cloud, None, Stopwatch())
    can_search(can_sight, can_cloud, can_truth, Stopwatch())
    again = can_search(can_sight, can_cloud, None, Stopwatch())
    assert first is not None
    assert again is not None
    assert np.array_equal(first.refined.T_cam_obj.matrix, again.refined.T_cam_obj.matrix)


def test_without_concepts_it_goes_on_from_where_it_is_expected(
    can_search: Search, can_sight: Sight, can_truth: Pose
) -> None:
    near = can_truth.nudged(np.array((0.04, -0.03, 0.04, 0.003, -0.003, 0.004)))
    assert_found(can_search.continued(near, can_sight, Stopwatch()), can_truth, "prediction")


def test_where_nobody_knows_the_pixels_a_pose_is_judged_by_those_that_it_claims(
    can_search: Search, can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    around = cv2.dilate(can_frames[0].masks["soup_can"].astype(np.uint8), np.ones((41, 41), np.uint8)) > 0
    view = view_object(can_frames[0], around, can_model.diameter_m, ViewConfig())
    assert view is not None
    masked, unmasked = (
        can_search.continued(can_truth, Sight.of(view, masked=masked), Stopwatch()) for masked in (True, False)
    )
    assert masked is not None
    assert unmasked is not None
    assert unmasked.evidence.explained > masked.evidence.explained + 0.3
    assert unmasked.evidence.score > masked.evidence.score + 0.1


def test_candidates_that_a_symmetry_makes_one_are_verified_once(
    can_model: ConceptModel, can_sight: Sight, can_cloud: PointCloud, monkeypatch: pytest.MonkeyPatch
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
        assert search(can_sight, can_cloud, None, Stopwatch()) is not None
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
