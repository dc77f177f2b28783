"""From what a frame shows to the best explained pose: wherever it is, near where it is expected, or none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from tracker.closest_points import ClosestPoints
from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.declared_symmetry import parse_symmetry
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.glance import Glance
from tracker.registration import Candidate, register
from tracker.revolution import TURNS, Turns
from tracker.search import TURNED, Hypothesis, Search, Sight
from tracker.stopwatch import Stopwatch
from tracker.symmetry import about
from tracker.umeyama import Motions
from tracker.view import ObjectView, ViewConfig, view_object


@pytest.fixture(scope="module")
def can_sight(can_view: ObjectView) -> Sight:
    return Sight.of(can_view, masked=True)


@pytest.fixture(scope="module")
def can_search(can_model: ConceptModel) -> Search:
    return Search(can_model, TrackerConfig())


def best(found: list[Hypothesis]) -> Hypothesis:
    return max(found, key=lambda hypothesis: hypothesis.evidence.score)


def assert_found(found: Hypothesis | None, truth: Pose, *origins: str) -> None:
    assert found is not None
    assert found.refined.T_cam_obj.distance_to_m(truth) < 0.003
    assert np.degrees(found.refined.T_cam_obj.angle_to_rad(truth)) < 3
    assert found.origin in origins


def test_it_is_found_anywhere(can_search: Search, can_sight: Sight, can_cloud: PointCloud, can_truth: Pose) -> None:
    clock = Stopwatch()
    assert_found(best(can_search.anywhere(can_sight, can_cloud, clock)), can_truth, "search")
    assert "registration" in clock.timings_ms()


def test_it_is_found_by_what_touches_what(
    can_search: Search, can_sight: Sight, can_cloud: PointCloud, can_truth: Pose
) -> None:
    clock = Stopwatch()
    found = can_search.touching(can_sight, can_cloud, clock)
    assert_found(best(found), can_truth, "contact")
    assert len(found) <= TrackerConfig().verified
    assert "contacts" in clock.timings_ms()
    assert "registration" not in clock.timings_ms()


def test_near_the_prediction_nothing_is_sampled(
    can_search: Search, can_sight: Sight, can_cloud: PointCloud, can_truth: Pose
) -> None:
    clock = Stopwatch()
    near = can_truth.nudged(np.array((0.1, -0.05, 0.1, 0.005, -0.005, 0.01)))
    assert_found(
        best(can_search.near(near, None, can_sight, can_cloud, clock, by_surface=True)),
        can_truth, "concepts", "prediction",
    )  # fmt: skip
    assert "registration" not in clock.timings_ms()


def test_what_leads_to_where_it_was_continued_to_is_not_looked_at_again(
    can_search: Search, can_sight: Sight, can_cloud: PointCloud, can_truth: Pose, monkeypatch: pytest.MonkeyPatch
) -> None:
    continued = can_search.continued(can_truth, can_sight, Stopwatch())
    assert continued is not None
    for turn_rad, looked_at in ((0.01, 0), (0.1, 1)):
        aligned = continued.refined.T_cam_obj.nudged(np.array((0.0, turn_rad, 0.0, 0.0, 0.0, 0.0)))
        monkeypatch.setattr(ClosestPoints, "align", lambda *_, aligned=aligned: aligned)
        near = can_search.near(can_truth, continued, can_sight, can_cloud, Stopwatch(), by_surface=True)
        assert len(near) == looked_at


def test_what_leads_to_the_same_is_judged_once(
    can_search: Search, can_sight: Sight, can_cloud: PointCloud, can_truth: Pose, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(can_search.touching(can_sight, can_cloud, Stopwatch())) > 1
    monkeypatch.setattr(ClosestPoints, "align", lambda *_: can_truth)
    assert len(can_search.touching(can_sight, can_cloud, Stopwatch())) == 1


def test_it_remembers_nothing(can_search: Search, can_sight: Sight, can_cloud: PointCloud, can_truth: Pose) -> None:
    first = can_search.anywhere(can_sight, can_cloud, Stopwatch())
    can_search.near(can_truth, None, can_sight, can_cloud, Stopwatch(), by_surface=True)
    again = can_search.anywhere(can_sight, can_cloud, Stopwatch())
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.refined.T_cam_obj.matrix, other.refined.T_cam_obj.matrix)


def test_a_turn_that_leads_back_began_where_the_pose_did(
    can_search: Search, can_sight: Sight, can_cloud: PointCloud, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = best(can_search.anywhere(can_sight, can_cloud, Stopwatch()))
    for angle_rad, origin in ((0.05, "search"), (np.pi, "turn")):
        turned = Pose(about(np.array((0.0, 0.0, 1.0)), angle_rad), np.zeros(3))
        monkeypatch.setattr(Turns, "of", lambda _, pose, turned=turned: [pose @ turned])
        monkeypatch.setattr("tracker.search.NEARLY_AS_GOOD", 0.0)
        (again,) = can_search.turned(found, can_sight, Stopwatch())
        assert again.origin == origin
        assert again.anywhere  # as what it is a turn of


def test_every_turn_that_explains_nearly_as_much_is_tried_where_that_is_asked_for(
    can_search: Search, can_sight: Sight, can_cloud: PointCloud, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = best(can_search.anywhere(can_sight, can_cloud, Stopwatch()))
    monkeypatch.setattr("tracker.search.NEARLY_AS_GOOD", 0.0)
    assert len(can_search.turned(found, can_sight, Stopwatch())) == TURNED
    assert len(can_search.turned(found, can_sight, Stopwatch(), every=True)) == TURNS - 1
    monkeypatch.setattr("tracker.search.NEARLY_AS_GOOD", 2.0)
    assert can_search.turned(found, can_sight, Stopwatch(), every=True) == []


@pytest.mark.parametrize("angle_deg", [-150, -60, 45, 100])
def test_a_turn_about_its_axis_that_the_shape_allows_is_undone_by_the_paint(
    angle_deg: float, can_search: Search, can_sight: Sight, can_truth: Pose
) -> None:
    wrong = can_truth @ Pose(about(np.array([0.0, 0.0, 1.0]), np.radians(angle_deg)), np.zeros(3))
    slid = can_search.continued(wrong, can_sight, Stopwatch())
    assert slid is not None
    assert slid.refined.T_cam_obj.angle_to_rad(can_truth) > 0.3
    assert_found(best([slid, *can_search.turned(slid, can_sight, Stopwatch())]), can_truth, "turn")


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


def test_candidates_that_a_symmetry_makes_one_are_looked_at_once(
    can_model: ConceptModel, can_sight: Sight, can_cloud: PointCloud, monkeypatch: pytest.MonkeyPatch
) -> None:
    glanced_at: list[Pose] = []

    def one_and_its_turns(*arguments: Any) -> list[Candidate]:
        best = register(*arguments)[0]
        return [replace(best, T_cam_obj=turned) for turned in parse_symmetry("z:60").equivalents(best.T_cam_obj)]

    def motions(self: Glance, poses: list[Pose]) -> Motions:
        glanced_at.extend(poses)
        return usual(self, poses)

    usual = Glance.motions
    monkeypatch.setattr("tracker.search.register", one_and_its_turns)
    monkeypatch.setattr(Glance, "motions", motions)
    for symmetry, distinct in (("none", 6), ("z:120", 2), ("z:60", 1), ("z:inf", 1)):
        glanced_at.clear()
        config = TrackerConfig(prior=False, verified=1)
        search = Search(replace(can_model, symmetry=parse_symmetry(symmetry)), config)
        assert search.anywhere(can_sight, can_cloud, Stopwatch())
        assert len(glanced_at) == distinct
