"""What is asked of a pose before it is believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tracker.belief import believed, doubt, doubtful
from tracker.confidence import Grounds
from tracker.config import TrackerConfig
from tracker.found import Found, Usual
from tracker.geometry import Pose
from tracker.refinement import Refined
from tracker.search import Hypothesis
from tracker.verification import Evidence
from tracker.view import ObjectView

GOOD = Evidence(
    score=0.6, surface=0.9, colour=0.8, contradicted=0.05, seen_through=0.0, outside=0.0, hidden=0.0, explained=0.9,
    proved=0.8,
)  # fmt: skip
WALL = replace(GOOD, surface=0.78, hidden=0.07, explained=0.6, proved=0.37)  # behind a can's lid
TABLE = replace(GOOD, surface=0.74, hidden=0.57, explained=0.75, proved=0.33)  # around a can's lid
CUP = replace(GOOD, explained=0.62, proved=0.66)  # of which the inside is not known
AIR = replace(GOOD, surface=0.1)
ALIKE = replace(GOOD, contradicted=0.22)  # another box of that size
GLASS = replace(GOOD, seen_through=0.2)
GLASSY = replace(GOOD, seen_through=0.07)
LITTLE = replace(GOOD, surface=0.35)  # most of it is hidden, or depth is rough
ASIDE = replace(GOOD, outside=0.25)  # a thing of another shape, in its colours
NARROW = replace(GOOD, proved=0.2)  # the narrow side of a box
PATCH = replace(GOOD, goes_on=0.55)  # of a table in the colour of a lid
CORNER = replace(GOOD, explained=0.2)  # of a mask around a wall


@pytest.mark.parametrize(
    ("evidence", "confidence", "how", "said"),
    [
        (GOOD, 0.15, "masked", ""),
        (GOOD, 0.05, "masked", "right at 5%"),
        (AIR, 0.9, "masked", "10% of what should be seen"),
        (CORNER, 0.9, "masked", "20% of what is seen there is explained"),
        (GLASS, 0.9, "masked", "20% of what should be seen is seen through"),
        (GLASS, 0.9, "followed", "20% of what should be seen is seen through"),
        (WALL, 0.15, "followed", ""),
        (WALL, 0.15, "turned", ""),
        (AIR, 0.9, "followed", "10% of what should be seen"),
        (GOOD, 0.35, "jumped", ""),
        (GOOD, 0.25, "jumped", "right at 25%"),
        (GOOD, 0.35, "expected", ""),
        (GOOD, 0.25, "expected", "right at 25%"),
        (GOOD, 0.55, "anywhere", ""),
        (GOOD, 0.45, "anywhere", "right at 45%"),
        (CUP, 0.55, "anywhere", ""),
        (WALL, 0.8, "anywhere", "goes on beyond it"),
        (WALL, 0.35, "expected", ""),  # most of it may be hidden, but there it is likely
        (TABLE, 0.8, "anywhere", "57% of it would be hidden"),
        (ALIKE, 0.95, "anywhere", "22% of what is in place has another colour"),
        (ALIKE, 0.95, "expected", "22% of what is in place has another colour"),
        (GLASSY, 0.95, "expected", "7% of what should be seen is seen through"),
        (LITTLE, 0.95, "expected", ""),
        (ASIDE, 0.95, "expected", "25% of what should be seen is not there"),
        (ASIDE, 0.95, "jumped", "25% of what should be seen is not there"),
        (ASIDE, 0.95, "masked", ""),
        (PATCH, 0.95, "expected", "what is seen goes on beyond 55% of its outline"),
        (PATCH, 0.95, "followed", ""),  # for a while
        (NARROW, 0.95, "expected", ""),
        (ALIKE, 0.95, "followed", ""),  # light that changes makes other colours of the object's own
        (ALIKE, 0.95, "masked", ""),
    ],
)
def test_what_is_asked_of_a_pose_depends_on_how_it_came_about(
    evidence: Evidence, confidence: float, how: str, said: str, can_view: ObjectView
) -> None:
    origin = {"followed": "prediction", "turned": "turn"}.get(how, "search")
    refined = Refined(Pose.identity(), np.eye(6), np.zeros((0, 6)), 0.0, 100)
    grounds = Grounds(evidence, 0.01, None if how == "anywhere" else 0.02)
    expected, masked = how != "anywhere", how == "masked"
    hypothesis = Hypothesis(refined, evidence, origin, can_view)
    found = Found(hypothesis, grounds, confidence, expected, masked, jumped=how == "jumped")
    followed, config = how in ("followed", "turned", "jumped"), TrackerConfig()
    assert believed(found, followed, config) == (not said)
    assert said in doubt(found, followed, config)
    assert bool(doubt(found, followed, config)) == bool(said)


@pytest.mark.parametrize(("evidence", "confidence", "masked", "is_doubtful"), [
    (GOOD, 0.35, False, False), (GOOD, 0.25, False, True), (ASIDE, 0.95, False, True), (ASIDE, 0.25, True, False),
    (PATCH, 0.95, False, True),
])  # fmt: skip
def test_what_is_followed_is_doubtful_where_it_would_not_be_believed_of_what_is_seen_again(
    evidence: Evidence, confidence: float, masked: bool, is_doubtful: bool, can_view: ObjectView
) -> None:
    refined = Refined(Pose.identity(), np.eye(6), np.zeros((0, 6)), 0.0, 100)
    found = Found(
        Hypothesis(refined, evidence, "prediction", can_view), Grounds(evidence, 0.01), confidence, True, masked
    )
    assert doubtful(found, TrackerConfig()) == is_doubtful


@pytest.mark.parametrize("how", ["followed", "jumped", "expected", "anywhere", "masked"])
@pytest.mark.parametrize(
    ("usual", "said", "asked_of"),
    [
        (Usual(0.7, 0.85, 0.02), "", ()),
        (Usual(0.9, 1.0, 0.0), "", ()),
        (Usual(0.6, 0.8, 0.3), "", ()),
        (Usual(1.5, 0.8, 0.05), "it explains 38% of what it usually does", ("jumped", "anywhere")),
        (Usual(0.6, 1.2, 0.05), "its colours agree to 80%, to 120% as", ("jumped", "expected", "anywhere")),
        (
            Usual(0.6, 0.8, -0.1),
            "5% of what is in place has another colour, -10% had",
            ("jumped", "expected", "anywhere"),
        ),
    ],
)
def test_what_is_seen_again_has_to_look_as_it_usually_did(
    usual: Usual, said: str, asked_of: tuple[str, ...], how: str, can_view: ObjectView
) -> None:
    origin = "prediction" if how == "followed" else "search"
    refined = Refined(Pose.identity(), np.eye(6), np.zeros((0, 6)), 0.0, 100)
    hypothesis = Hypothesis(refined, GOOD, origin, can_view)
    expected, masked = how not in ("anywhere", "jumped"), how == "masked"
    found = Found(hypothesis, Grounds(GOOD, 0.01), 0.9, expected, masked, jumped=how == "jumped", usual=usual)
    answer = doubt(found, how in ("followed", "jumped"), TrackerConfig())
    assert bool(answer) == (how in asked_of)
    assert not answer or said in answer


def test_what_did_not_even_show_at_the_first_place_is_said_for_that(can_view: ObjectView) -> None:
    refined = Refined(Pose.identity(), np.eye(6), np.zeros((0, 6)), 0.0, 100)
    hypothesis = Hypothesis(refined, AIR, "search", can_view)
    found = Found(hypothesis, Grounds(AIR, 0.01), 0.9, expected=False, masked=False, missed="hidden")
    assert doubt(found, False, TrackerConfig()) == "hidden"
    assert doubt("out of view", True, TrackerConfig()) == "out of view"
