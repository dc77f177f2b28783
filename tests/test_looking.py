"""Looking at places one after the other: no further than needed, and for concepts only as often as asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tracker.concept import ConceptModel
from tracker.confidence import Grounds, confidence
from tracker.config import TrackerConfig
from tracker.found import Found, Look
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.looking import Looking
from tracker.refinement import Refined
from tracker.rest import Resting
from tracker.saliency import Query, SaliencyBackend
from tracker.search import Hypothesis, Search, Sight
from tracker.sources.synthetic import SyntheticScene
from tracker.stopwatch import Stopwatch
from tracker.verification import Evidence
from tracker.view import ObjectView

CAN = "soup_can"


class Counted:
    """Looks, and answers what is asked for."""

    def __init__(self, model: ConceptModel, backend: SaliencyBackend, config: TrackerConfig) -> None:
        self.asked, self.seen = 0, 0
        self._model, self._backend = model, backend
        self.looking = Looking(model, config)

    def __call__(self, looks: list[Look | str], frame: Frame) -> Found | str:
        def counted():
            for look in looks:
                self.seen += 1
                yield look

        asking = self.looking.best(counted(), frame, Stopwatch())
        try:
            view = next(asking)
            while True:
                self.asked += 1
                view = asking.send(self._backend([Query(view, self._model.labels)])[0])
        except StopIteration as ended:
            return ended.value


@pytest.fixture
def can_looking(can_model: ConceptModel, attributes: SaliencyBackend) -> Counted:
    return Counted(can_model, attributes, TrackerConfig(concepts_every=4))


@pytest.fixture
def always_asking(can_model: ConceptModel, attributes: SaliencyBackend) -> Counted:
    return Counted(can_model, attributes, TrackerConfig(concepts_every=1))


def assert_at(found: Found | str, truth: Pose) -> None:
    assert isinstance(found, Found), found
    pose = found.hypothesis.refined.T_cam_obj
    assert pose.distance_to_m(truth) < 0.003
    assert np.degrees(pose.angle_to_rad(truth)) < 3


def test_the_first_place_without_doubt_is_the_last_that_is_looked_at(
    can_looking: Counted, can_frames: list[Frame], can_truth: Pose
) -> None:
    frame = can_frames[0]
    look = Look(frame.masks[CAN], None, masked=True)
    assert_at(can_looking(["hidden", look, look], frame), can_truth)
    assert can_looking.seen == 2


def test_where_nothing_is_the_first_place_says_why(can_looking: Counted, can_frames: list[Frame]) -> None:
    assert can_looking(["hidden", "out of view"], can_frames[0]) == "hidden"
    assert can_looking([], can_frames[0]) == "nothing in the picture looks like it"


def test_what_is_found_elsewhere_knows_why_it_was_missed(
    can_looking: Counted, can_frames: list[Frame], can_truth: Pose
) -> None:
    look = Look(can_frames[0].masks[CAN], None, masked=True)
    for looks, missed in ((["hidden", "out of view", look], "hidden"), ([look, "hidden"], "")):
        found = can_looking(looks, can_frames[0])
        assert_at(found, can_truth)
        assert isinstance(found, Found)
        assert found.missed == missed


def test_while_it_is_lost_no_place_is_passed_over(can_looking: Counted, can_frames: list[Frame]) -> None:
    look = Look(can_frames[0].masks[CAN], None, masked=True)
    found = can_looking([look], can_frames[0])
    assert isinstance(found, Found)
    for believed, seen in ((found, 1), (None, 2), (found, 1)):
        can_looking.seen = 0
        can_looking.looking.came_of_it(believed)
        assert isinstance(can_looking([look, "hidden"], can_frames[0]), Found)
        assert can_looking.seen == seen


def test_how_it_usually_looks_is_the_middle_of_the_last_frames_in_which_it_was_followed(
    can_looking: Counted, can_frames: list[Frame]
) -> None:
    def again() -> Found:
        found = can_looking([Look(can_frames[0].masks[CAN], None, masked=True)], can_frames[0])
        assert isinstance(found, Found)
        return found

    found = again()
    assert found.usual is None
    hardly = replace(found, hypothesis=replace(found.hypothesis, evidence=replace(GOOD, score=0.1, colour=0.2)))
    for believed in (*[found] * 20, None, *[hardly] * 14):
        can_looking.looking.came_of_it(believed)
    evidence = found.hypothesis.evidence
    assert again().usual == pytest.approx((found.explains, evidence.colour, evidence.contradicted))
    can_looking.looking.came_of_it(hardly)
    can_looking.looking.came_of_it(hardly)
    assert again().usual == pytest.approx((hardly.explains, 0.2, GOOD.contradicted))
    usual = again().usual
    assert usual is not None
    less = replace(hardly, usual=usual._replace(explains=2 * hardly.explains))
    for _ in range(40):  # of what shows half as much as usual nothing is learnt
        can_looking.looking.came_of_it(less)
    assert again().usual == usual
    can_looking.looking.forget()
    assert again().usual is None


def test_concepts_are_asked_for_once_in_so_many_looks(
    can_scene: SyntheticScene, can_looking: Counted, can_frames: list[Frame]
) -> None:
    for frame in can_frames[:9]:
        truth = can_scene.sightings(CAN)[frame.index].T_cam_obj
        look = Look(frame.masks[CAN], truth, (truth,), masked=True)
        assert_at(can_looking([look], frame), truth)
    assert can_looking.asked == 2  # the fourth and the eighth time


def test_concepts_are_asked_for_where_surface_and_colours_do_not_lead_to_it(
    can_looking: Counted, can_frames: list[Frame], can_truth: Pose
) -> None:
    far = can_truth.nudged(np.array((0, 0, 2.0, 0.05, 0, 0)))
    assert_at(can_looking([Look(can_frames[0].masks[CAN], far, (far,), masked=True)], can_frames[0]), can_truth)
    assert can_looking.asked == 1


def test_where_concepts_lead_astray_what_surface_and_colours_lead_to_is_kept(
    can_looking: Counted, can_frames: list[Frame], can_truth: Pose, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a surprising turn, so that they were asked."""
    monkeypatch.setattr(Search, "near", lambda *_, **__: [])
    monkeypatch.setattr(Search, "anywhere", lambda *_: [])
    tilted = can_truth.nudged(np.array((0.16, 0.05, 0, 0, 0, 0)))
    assert_at(can_looking([Look(can_frames[0].masks[CAN], tilted, (tilted,), masked=True)], can_frames[0]), can_truth)
    assert can_looking.asked == 1


def test_what_concepts_could_not_explain_they_are_asked_again_some_frames_later(
    can_model: ConceptModel,
    attributes: SaliencyBackend,
    can_frames: list[Frame],
    can_truth: Pose,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("tracker.looking.LEAST_ENDS", 2.0)  # nothing explains so much
    looking, asked = Counted(can_model, attributes, TrackerConfig(concepts_every=100)), []
    for _ in range(6):
        looking([Look(can_frames[0].masks[CAN], can_truth, (can_truth,), masked=True)], can_frames[0])
        asked.append(looking.asked)
    assert asked == [1, 1, 1, 1, 2, 2]


def test_what_is_turned_otherwise_and_fits_as_well_is_remembered_until_it_is_tried_again(
    can_looking: Counted, can_frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    looking, look = can_looking.looking, Look(can_frames[0].masks[CAN], None, masked=True)
    for share in (0.4, 0.9):
        monkeypatch.setattr("tracker.looking.told_apart", lambda *_, share=share: share)
        found = can_looking([look], can_frames[0])
        assert isinstance(found, Found)
        assert found.told_apart == share
        looking.came_of_it(found)
        assert looking.told_apart == share
        looking.came_of_it(replace(found, told_apart=None))  # concepts were not asked: nothing else was tried
        assert looking.told_apart == share


def test_every_turn_is_tried_where_somebody_says_that_it_is_there_and_while_it_has_rivals(
    always_asking: Counted, can_frames: list[Frame], can_truth: Pose, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []

    def turned(*_: object, every: bool) -> list[Hypothesis]:
        asked.append(every)
        return []

    monkeypatch.setattr(Search, "turned", turned)
    mask, looking = can_frames[0].masks[CAN], always_asking.looking
    nobody, somebody = Look(mask, None, masked=True), Look(mask, None, masked=True, told=True)
    near = Look(mask, can_truth, (can_truth,), masked=True, told=True)
    for look, told_apart in ((nobody, 1.0), (somebody, 1.0), (near, 1.0), (nobody, 0.4)):
        looking.told_apart = told_apart
        always_asking([look], can_frames[0])
    assert asked == [False, True, False, True]


def test_what_it_may_be_taken_for_is_forgotten_where_it_is_lost(can_looking: Counted) -> None:
    for forget in (can_looking.looking.forget, lambda: can_looking.looking.came_of_it(None)):
        can_looking.looking.told_apart = 0.4
        forget()
        assert can_looking.looking.told_apart == 1.0


@pytest.mark.parametrize(("worse", "is_kept"), [(0.0, True), (0.2, False)])
def test_what_is_found_from_scratch_is_refined_to_the_end_unless_that_explains_clearly_less(
    worse: float,
    is_kept: bool,
    can_looking: Counted,
    can_frames: list[Frame],
    can_truth: Pose,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    settled, seen = Search.settled, []

    def told(search: Search, hypothesis: Hypothesis, sight: Sight, clock: Stopwatch) -> Hypothesis | None:
        found = settled(search, hypothesis, sight, clock)
        assert found is not None
        seen.append(replace(found, evidence=replace(found.evidence, score=found.evidence.score - worse)))
        return seen[-1]

    monkeypatch.setattr(Search, "settled", told)
    mask = can_frames[0].masks[CAN]
    found = can_looking([Look(mask, None, masked=True)], can_frames[0])
    assert isinstance(found, Found)
    assert (found.hypothesis is seen[0]) == is_kept
    can_looking([Look(mask, can_truth, (can_truth,), masked=True)], can_frames[0])
    assert len(seen) == 1  # what is followed goes on in the next frame


def test_what_is_far_from_where_it_was_expected_is_less_likely(
    can_looking: Counted, can_frames: list[Frame], can_truth: Pose
) -> None:
    mask = can_frames[0].masks[CAN]
    far = can_truth.nudged(np.array((0, 0, 1.0, 0.05, 0, 0)))
    near, surprising = (
        can_looking([Look(mask, None, (pose,), masked=True)], can_frames[0]) for pose in (can_truth, far)
    )
    assert isinstance(near, Found)
    assert isinstance(surprising, Found)
    assert near.score == pytest.approx(surprising.score, abs=0.001)  # other starts, the same place
    poses = [found.hypothesis.refined.T_cam_obj for found in (near, surprising)]
    assert np.degrees(poses[0].angle_to_rad(poses[1])) < 0.1
    assert near.confidence == confidence(near.grounds) > surprising.confidence
    assert surprising.grounds.turn_rad == pytest.approx(1.0, abs=0.1)


def test_the_nearest_of_expected_poses_at_one_place_is_the_one_that_is_turned_least(
    can_looking: Counted, can_frames: list[Frame], can_truth: Pose
) -> None:
    turned = can_truth.nudged(np.array((0, 0, 1.0, 0, 0, 0)))
    shifted = can_truth.nudged(np.array((0, 0, 0, 0.004, 0, 0)))
    found = can_looking([Look(can_frames[0].masks[CAN], None, (turned, shifted), masked=True)], can_frames[0])
    assert isinstance(found, Found)
    assert found.grounds.turn_rad == pytest.approx(0, abs=0.05)


@pytest.mark.parametrize(("off_m", "expected"), [(0.02, True), (0.4, False)])
def test_what_is_found_about_where_somebody_pointed_was_expected_there(
    off_m: float, expected: bool, can_looking: Counted, can_frames: list[Frame], can_truth: Pose
) -> None:
    place_m = can_truth.translation_m + np.array((off_m, 0, 0))
    found = can_looking([Look(can_frames[0].masks[CAN], None, place_m=place_m)], can_frames[0])
    assert isinstance(found, Found)
    assert found.expected == expected
    assert found.grounds.turn_rad is None  # a place has no pose that another could be turned from


@pytest.mark.parametrize(
    ("off_m", "turned_rad", "expected"), [(0.02, 0.0, True), (0.4, 0.0, False), (0.02, 0.4, True), (0.02, 0.8, False)]
)
def test_what_is_found_farther_than_its_own_size_away_or_turned_otherwise_was_not_expected_there(
    off_m: float, turned_rad: float, expected: bool, can_looking: Counted, can_frames: list[Frame], can_truth: Pose
) -> None:
    there = can_truth.nudged(np.array((0, turned_rad, 0, off_m, 0, 0)))
    found = can_looking([Look(can_frames[0].masks[CAN], None, (there,))], can_frames[0])
    assert isinstance(found, Found)
    assert found.expected == expected
    assert found.grounds.turn_rad == pytest.approx(turned_rad, abs=0.05)


GOOD = Evidence(
    score=0.6, surface=0.9, colour=0.8, contradicted=0.05, seen_through=0.0, outside=0.0, hidden=0.0, explained=0.9,
    proved=0.8,
)  # fmt: skip


def test_of_which_hardly_any_surface_is_in_place_is_not_the_likeliest_whatever_its_colours(
    can_looking: Counted,
    can_frames: list[Frame],
    can_truth: Pose,
    can_view: ObjectView,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    refined = Refined(can_truth, np.eye(6), np.zeros((0, 6)), 0.0, 100)
    fits = Hypothesis(refined, replace(GOOD, colour=0.7), "search", can_view)
    hardly = Hypothesis(refined, replace(GOOD, surface=0.19, colour=0.95, contradicted=0.0), "search", can_view)
    monkeypatch.setattr(Search, "anywhere", lambda *_: [hardly, fits, hardly])
    monkeypatch.setattr(Search, "turned", lambda *_, **__: [])
    found = can_looking([Look(can_frames[0].masks[CAN], None, masked=True)], can_frames[0])
    assert isinstance(found, Found)
    assert found.hypothesis is fits
    assert confidence(Grounds(hardly.evidence, 0.01)) > confidence(Grounds(fits.evidence, 0.01))


def test_what_a_search_finds_where_it_was_expected_has_not_jumped(
    can_looking: Counted, can_frames: list[Frame], can_truth: Pose
) -> None:
    mask = can_frames[0].masks[CAN]
    for turn_rad, shift_m, jumped in ((0.05, 0.005, False), (0.5, 0.0, True), (0.0, 0.06, True)):
        expected = can_truth.nudged(np.array((turn_rad, 0, 0, shift_m, 0, 0)))
        found = can_looking([Look(mask, None, (expected,), masked=True)], can_frames[0])
        assert isinstance(found, Found)
        assert found.hypothesis.origin == "search"
        assert found.jumped == jumped


def test_where_somebody_says_that_it_is_it_is_looked_for_longer(
    can_looking: Counted, sliver: Frame, can_truth: Pose, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Search, "anywhere", lambda *_: [])
    look = Look(sliver.masks[CAN], None, masked=True, told=True)
    found = can_looking([look], sliver)
    assert isinstance(found, Found)
    assert found.hypothesis.origin == "contact"
    assert found.hypothesis.refined.T_cam_obj.distance_to_m(can_truth) < 0.01
    assert isinstance(can_looking([replace(look, told=False)], sliver), str)


def test_what_fits_well_is_not_looked_for_longer(
    can_looking: Counted, can_frames: list[Frame], can_truth: Pose, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(Search, "touching")
    look = Look(can_frames[0].masks[CAN], None, masked=True, told=True)
    assert_at(can_looking([look], can_frames[0]), can_truth)


def at_rest(can_truth: Pose, sigma_rad: float = 0.02) -> Resting:
    return Resting(can_truth, np.diag([sigma_rad**2] * 3 + [0.002**2] * 3))


@pytest.fixture
def sliver(can_frames: list[Frame]) -> Frame:
    """A frame whose mask has only what is seen beside something in front of the can."""
    mask, depth_m = can_frames[0].masks[CAN], can_frames[0].depth_m.copy()
    columns = np.flatnonzero(mask.any(axis=0))
    shown = mask & (np.arange(mask.shape[1]) < columns[0] + len(columns) // 6)
    depth_m[mask & ~shown] *= np.float32(0.7)
    return replace(can_frames[0], masks={CAN: shown}, depth_m=depth_m)


def test_a_pose_that_hardly_anything_is_seen_of_is_held_by_where_it_is_if_it_stands_still(
    can_looking: Counted, sliver: Frame, can_truth: Pose
) -> None:
    near = can_truth.nudged(np.array((0, 0, 0.1, 0.004, 0, 0)))
    alone = Look(sliver.masks[CAN], near, (near,), masked=True)
    by_itself = can_looking([alone], sliver)
    assert isinstance(by_itself, Found)
    found = can_looking([replace(alone, rest=lambda *_: at_rest(can_truth))], sliver)
    assert_at(found, can_truth)
    assert isinstance(found, Found)
    assert found.hypothesis.origin == "stillness"
    assert found.confidence > by_itself.confidence
    assert np.degrees(by_itself.hypothesis.refined.T_cam_obj.angle_to_rad(can_truth)) > 3


def test_a_pose_that_is_sure_is_not_asked_whether_it_stands_still(
    can_looking: Counted, can_frames: list[Frame], can_truth: Pose
) -> None:
    def rest(*_: object) -> Resting:
        raise AssertionError("asked")

    look = Look(can_frames[0].masks[CAN], can_truth, (can_truth,), masked=True, rest=rest)
    assert_at(can_looking([look], can_frames[0]), can_truth)


def test_what_stands_elsewhere_does_not_hold_a_pose_that_explains_more(
    can_looking: Counted, sliver: Frame, can_truth: Pose
) -> None:
    look = Look(sliver.masks[CAN], can_truth, (can_truth,), masked=True)
    aside = can_truth.nudged(np.array((0, 0, 0, 0.02, 0, 0)))
    for rest in (lambda *_: None, lambda *_: at_rest(aside)):
        found = can_looking([replace(look, rest=rest)], sliver)
        assert isinstance(found, Found)
        assert found.hypothesis.origin != "stillness"
