"""Laws of symmetry: equivalent poses are one, the nearest is nearest, and what is declared is what is meant."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tracker.declared_symmetry import from_models_info, parse_symmetry
from tracker.errors import ConfigError
from tracker.geometry import Floats, Pose
from tracker.refinement import Refined
from tracker.symmetry import NO_SYMMETRY, Symmetry, about, angles_rad

ORIGIN_M = np.array([0.02, -0.05, 0.03])
DECLARED = ("none", "z:180", "x:90", "z:1", "x:180,y:180", "z:120,x:180", "x:90,y:90", "1/1/1:120,z:180")
FREE = ("z:inf", "y:inf", "z:inf,x:180", "0.1/0.2/0.97:inf", "z:inf,z:90")
ORDERS = {"none": 1, "z:180": 2, "x:90": 4, "z:1": 360, "x:180,y:180": 4, "z:120,x:180": 6, "x:90,y:90": 24}
ORDERS |= {"1/1/1:120,z:180": 12, "z:inf": 1, "z:inf,x:180": 2, "z:inf,z:90": 1, "z:90,z:60": 12, " Z:180 , x:180 ": 4}

numbers = st.floats(-3, 3, allow_nan=False)
poses = st.lists(numbers, min_size=6, max_size=6).map(lambda twist: Pose.exp(np.array(twist)))
symmetries = st.sampled_from([*DECLARED, *FREE]).map(lambda text: parse_symmetry(text, ORIGIN_M))
angles = st.floats(-np.pi, np.pi)


def elements(symmetry: Symmetry, angle_rad: float) -> list[Pose]:
    """Motions of the object that nobody sees: its turns, each before a turn about the free axis."""
    spin = np.eye(3) if symmetry.axis is None else about(symmetry.axis, angle_rad)
    turns = [turn @ spin for turn in symmetry.turns[:40]]
    return [Pose(turn, symmetry.origin_m - turn @ symmetry.origin_m) for turn in turns]


@given(symmetries, poses, poses)
@settings(max_examples=150)
def test_the_nearest_is_never_farther_than_what_was_given_and_is_its_own_nearest(
    symmetry: Symmetry, pose: Pose, to: Pose
) -> None:
    nearest = symmetry.nearest(pose, to)
    assert nearest.angle_to_rad(to) <= pose.angle_to_rad(to) + 1e-6
    again = symmetry.nearest(nearest, to)
    assert np.allclose(again.matrix, nearest.matrix, atol=1e-6)
    assert symmetry.same(nearest, pose, 1e-5, 1e-9)


@given(symmetries, poses, poses, angles)
@settings(max_examples=100)
def test_it_does_not_matter_which_of_the_equivalent_poses_was_given(
    symmetry: Symmetry, pose: Pose, to: Pose, angle_rad: float
) -> None:
    nearest = symmetry.nearest(pose, to)
    others = [one for one in symmetry.equivalents(nearest)[1:] if symmetry.axis is None]
    assume(all(other.angle_to_rad(to) > nearest.angle_to_rad(to) + 1e-3 for other in others))  # two are nearest
    for element in elements(symmetry, angle_rad):
        moved = symmetry.nearest(pose @ element, to)
        assert abs(moved.angle_to_rad(to) - nearest.angle_to_rad(to)) < 1e-6
        if symmetry.axis is None:
            assert np.allclose(moved.matrix, nearest.matrix, atol=1e-6)
        assert symmetry.same(pose, pose @ element, 1e-5, 1e-9)


@given(st.sampled_from(FREE).map(parse_symmetry), poses, poses)
@settings(max_examples=40)
def test_about_a_free_axis_the_closed_form_is_as_near_as_the_best_of_3600_turns(
    symmetry: Symmetry, pose: Pose, to: Pose
) -> None:
    assert symmetry.axis is not None
    spins = np.stack([about(symmetry.axis, angle_rad) for angle_rad in np.linspace(0, 2 * np.pi, 3600, endpoint=False)])
    tried = np.concatenate([pose.rotation @ turn @ spins for turn in symmetry.turns])
    best_rad, found_rad = angles_rad(tried, to.rotation).min(), symmetry.nearest(pose, to).angle_to_rad(to)
    assert best_rad - np.radians(0.1) < found_rad < best_rad + 1e-6


@given(st.sampled_from(DECLARED).map(lambda text: parse_symmetry(text, ORIGIN_M)), poses, poses)
@settings(max_examples=60)
def test_of_turns_the_nearest_is_the_best_of_all(symmetry: Symmetry, pose: Pose, to: Pose) -> None:
    least_rad = min(one.angle_to_rad(to) for one in symmetry.equivalents(pose))
    assert symmetry.nearest(pose, to).angle_to_rad(to) == pytest.approx(least_rad, abs=1e-4)


@pytest.mark.parametrize("text", DECLARED)
def test_the_turns_are_a_group(text: str) -> None:
    turns = parse_symmetry(text).turns
    assert np.array_equal(turns[0], np.eye(3))
    for turn in turns[:: max(1, len(turns) // 20)]:
        assert max(angles_rad(turns, turn @ other).min() for other in turns) < 1e-6
        assert angles_rad(turns, turn.T).min() < 1e-6
        assert np.sum(angles_rad(turns, turn) < 1e-3) == 1


@pytest.mark.parametrize("text", ORDERS)
def test_a_group_has_as_many_turns_as_geometry_says(text: str) -> None:
    symmetry = parse_symmetry(text)
    assert len(symmetry.turns) == ORDERS[text]
    assert (symmetry.axis is not None) == ("inf" in text)
    assert symmetry.trivial == (text == "none")


def test_a_turn_leaves_the_origin_where_it_is_and_turns_the_rest() -> None:
    symmetry, pose = parse_symmetry("z:180", ORIGIN_M), Pose.exp([0.3, 0.2, -0.5, 0.1, 0.2, 0.7])
    other = symmetry.equivalents(pose)[1]
    beside = ORIGIN_M + np.array([0.01, 0, 0.04])
    assert np.allclose(other @ ORIGIN_M[None], pose @ ORIGIN_M[None])
    assert np.allclose(other @ beside[None], pose @ (ORIGIN_M + np.array([-0.01, 0, 0.04]))[None])


def test_without_symmetry_a_pose_is_left_as_it_is_and_all_are_distinct() -> None:
    pose = Pose.exp([0.3, 0.2, -0.5, 0.1, 0.2, 0.7])
    assert NO_SYMMETRY.nearest(pose, Pose.identity()) is pose
    assert NO_SYMMETRY.distinct([pose, pose], 0.1, 0.1) == [0, 1]


def test_equivalent_poses_count_as_one_the_first_of_them() -> None:
    symmetry, pose = parse_symmetry("z:inf,x:180", ORIGIN_M), Pose.exp([0.3, 0.2, -0.5, 0.1, 0.2, 0.7])
    spun, flipped = elements(symmetry, 2.0)
    tilted, shifted = Pose.exp([0.15, 0, 0, 0, 0, 0]), Pose(np.eye(3), np.array([0, 0, 0.02]))
    found = [pose, pose @ spun, pose @ tilted, pose @ flipped, pose @ shifted, pose @ tilted @ flipped]
    assert symmetry.distinct(found, 0.1, 0.01) == [0, 2, 4]
    assert symmetry.distinct(found, 0.2, 0.05) == [0]
    assert symmetry.distinct(found[::-1], 0.1, 0.01) == [0, 1, 2]


@given(poses, st.lists(numbers, min_size=6, max_size=6), angles)
@settings(max_examples=40)
def test_information_goes_with_the_origin_when_a_result_is_turned(
    pose: Pose, motion: list[float], angle_rad: float
) -> None:
    """A small motion costs the same, whichever of the equivalent poses it is told of."""
    symmetry = parse_symmetry("z:inf", ORIGIN_M)
    square = np.random.default_rng(1).normal(size=(6, 6))
    found = Refined(pose, square @ square.T, np.eye(6)[:2], 0.0, 100)
    turned = found.nearest(pose @ Pose.exp([0, 0, angle_rad, 0, 0, 0]), symmetry)
    for before, carried in zip(found.free, turned.free, strict=True):
        assert carried @ turned.information @ carried == pytest.approx(before @ found.information @ before, rel=1e-6)
    small = 1e-6 * np.array(motion)
    after = turned.T_cam_obj.nudged(small)
    same = after @ turned.T_cam_obj.inverse() @ pose  # the same motion of the camera's space
    told = np.concatenate((small[:3], same.translation_m - pose.translation_m))
    assert told @ found.information @ told == pytest.approx(small @ turned.information @ small, rel=1e-3, abs=1e-16)


NOT_GRAMMAR = ("", "z", "z:", ":90", "w:90", "z:7", "z:0", "z:-90", "z:360", "z:400", "z:0.5", "z:nan", "z:infinity")
NOT_GRAMMAR += ("0/0/0:90", "1/2:90", "a/b/c:90", "z:90;x:90", "z:90,")


@pytest.mark.parametrize("text", NOT_GRAMMAR)
def test_what_does_not_follow_the_grammar_is_refused_with_the_grammar(text: str) -> None:
    with pytest.raises(ConfigError, match=r"AXIS:ANGLE.*z:inf or x:180,y:180") as caught:
        parse_symmetry(text)
    assert repr(text) in str(caught.value)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("z:72,x:90", "more than 360"),
        ("z:1,x:180", "more than 360"),
        ("z:180,0.1/1/0.3:90", "more than 360"),
        ("z:inf,x:90", "moves the axis"),
        ("z:inf,1/0/1:180", "moves the axis"),
        ("z:inf,x:inf", "two axes of any angle"),
    ],
)
def test_turns_that_no_object_has_are_refused(text: str, complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        parse_symmetry(text)


def homogeneous_mm(turn: Floats, about_m: Floats) -> list[float]:
    return Pose(turn, 1000 * (about_m - turn @ about_m)).matrix.ravel().tolist()


def test_bop_s_turns_come_in_metres_about_the_point_that_stays() -> None:
    turns = parse_symmetry("x:180,y:180").turns[1:]
    entry = {"diameter": 100, "symmetries_discrete": [homogeneous_mm(turn, ORIGIN_M) for turn in turns]}
    symmetry = from_models_info(entry)
    assert np.allclose(symmetry.turns, [np.eye(3), *turns])
    assert np.allclose(symmetry.origin_m, ORIGIN_M)
    assert symmetry.axis is None


def test_bop_s_free_axis_comes_in_metres_and_may_have_ends_that_swap() -> None:
    free = [{"axis": [0, 0, 2], "offset": [10, -20, 99]}]
    symmetry = from_models_info({"symmetries_continuous": free})
    assert symmetry.axis is not None
    assert np.allclose(symmetry.axis, [0, 0, 1])
    assert np.allclose(symmetry.origin_m[:2], [0.01, -0.02])
    assert len(symmetry.turns) == 1
    swap = homogeneous_mm(about(np.array([1.0, 0, 0]), np.pi), np.array([0.01, -0.02, 0.007]))
    both = from_models_info({"symmetries_continuous": free, "symmetries_discrete": [swap]})
    assert np.allclose(both.origin_m, [0.01, -0.02, 0.007])
    assert len(both.turns) == 2


def test_bop_s_entry_without_symmetries_has_none() -> None:
    assert from_models_info({"diameter": 100}).trivial
    assert from_models_info({"symmetries_discrete": [], "symmetries_continuous": []}).trivial


@pytest.mark.parametrize(
    ("entry", "complaint"),
    [
        ({"symmetries_discrete": [[1, 2, 3]]}, "cannot be read"),
        ({"symmetries_discrete": [np.diag([1.0, 1, -1, 1]).ravel().tolist()]}, "cannot be read.*not a rotation"),
        ({"symmetries_discrete": 5}, "cannot be read"),
        ({"symmetries_continuous": [{"axis": [0, 0, 1]}]}, "cannot be read.*offset"),
        ({"symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, float("nan"), 0]}]}, "cannot be read.*finite"),
        ({"symmetries_continuous": [{"axis": [0, 0, 0], "offset": [0, 0, 0]}]}, "cannot be read.*direction"),
        ({"symmetries_continuous": [{"axis": a, "offset": [0, 0, 0]} for a in ([0, 0, 1], [0, 1, 0])]}, "two axes"),
        (
            {"symmetries_discrete": [[1, 0, 0, 50, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]]},
            "no point stays .* 50.0 mm",
        ),
    ],
)
def test_an_entry_that_is_no_symmetry_is_refused(entry: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ConfigError, match=rf"models_info\.json: .*{complaint}"):
        from_models_info(entry)


@pytest.mark.parametrize("text", [*DECLARED, *FREE])
def test_what_is_packed_is_unpacked_to_the_bit(text: str) -> None:
    packed = parse_symmetry(text, ORIGIN_M).packed()
    assert Symmetry.unpacked(packed).packed() == packed


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("none", "none"),
        ("x:180,y:180", "4 turns look the same"),
        ("z:inf", r"any turn about (0.00, 0.00, 1.00) looks the same"),
        ("z:inf,x:180", r"any turn about (0.00, 0.00, 1.00) looks the same, and its ends may be swapped"),
    ],
)
def test_a_symmetry_says_what_it_is(text: str, words: str) -> None:
    assert str(parse_symmetry(text)) == words
