"""Reference frames vouch for each other's points, deny them, or keep silent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from reference.cross_check import MASK_SLACK_PX, Votes, cross_check, others_than
from tracker.frame import PosedFrame
from tracker.geometry import Floats, Pose

AHEAD = Pose(np.eye(3), np.array([0.0, 0.0, 0.4]))
SLACK_M = 0.005
FRONT = np.array([[0.0, 0, -0.05]])  # of the ball, as the camera sees it


@pytest.fixture
def ball(globe: Callable[..., PosedFrame]) -> PosedFrame:
    return globe(AHEAD)


def votes(points_obj: Floats, *others: PosedFrame) -> list[tuple[int, int]]:
    """(confirmed, denied) of every point."""
    found = cross_check(points_obj, others, SLACK_M)
    return list(zip(found.confirmed.tolist(), found.denied.tolist(), strict=True))


def with_depth(ball: PosedFrame, depth_m: Floats) -> PosedFrame:
    return replace(ball, frame=replace(ball.frame, depth_m=depth_m.astype(np.float32)))


def test_a_surface_within_the_mask_is_confirmed_up_to_the_slack(ball: PosedFrame) -> None:
    along_m = np.array([[0, 0, 0], [0, 0, 0.0045], [0, 0, -0.0045]])
    assert votes(FRONT + along_m, ball) == [(1, 0)] * 3


def test_a_point_in_the_air_before_the_surface_is_denied(ball: PosedFrame) -> None:
    assert votes(FRONT - [0, 0, 0.0055], ball) == [(0, 1)]
    beside_the_ball = np.array([[0.1, 0, 0]])
    assert votes(beside_the_ball, ball) == [(0, 1)]


def test_of_a_point_behind_the_surface_nothing_is_said(ball: PosedFrame) -> None:
    assert votes(np.array([[0, 0, 0.05], [0, 0, 0], [0.2, 0, 0.5]]), ball) == [(0, 0)] * 3


def test_where_depth_is_missing_or_the_picture_ends_nothing_is_said(ball: PosedFrame) -> None:
    blind = with_depth(ball, np.where(ball.mask, 0, ball.frame.depth_m))
    assert votes(FRONT, blind) == [(0, 0)]
    assert votes(np.array([[0.9, 0, 0], [0, -0.9, 0], [0, 0, -0.4], [0, 0, -1.0]]), ball) == [(0, 0)] * 4


def test_a_surface_clearly_beside_the_mask_is_denied_and_one_at_its_ragged_edge_is_not(ball: PosedFrame) -> None:
    row = ball.mask[119]
    edge = int(np.flatnonzero(row)[-1])
    flat = with_depth(ball, np.full(ball.mask.shape, 0.35))
    columns = np.array([edge, edge + 1, edge + MASK_SLACK_PX, edge + MASK_SLACK_PX + 1])
    points_cam = ball.frame.intrinsics.unproject(columns, np.full(4, 119), np.full(4, 0.35))
    assert votes(AHEAD.inverse() @ points_cam, flat) == [(1, 0), (0, 0), (0, 0), (0, 1)]


def test_votes_of_several_frames_add_up_and_a_tie_keeps_the_point(ball: PosedFrame) -> None:
    far = with_depth(ball, np.full(ball.mask.shape, 0.7))
    assert votes(FRONT, ball, ball, far) == [(2, 1)]
    assert votes(FRONT) == [(0, 0)]
    many = Votes(np.array([0, 1, 1, 2, 0]), np.array([0, 1, 2, 1, 1]))
    assert many.kept.tolist() == [True, True, False, True, False]


def test_frames_of_a_ball_from_all_sides_deny_no_point_of_it(
    globe: Callable[..., PosedFrame],
) -> None:
    outwards = np.random.default_rng(0).normal(size=(500, 3))
    surface = 0.05 * outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
    turns = [Pose.exp([*(k * np.array([0.4, 1.1, 0.2])), 0, 0, 0]) for k in range(5)]
    others = [globe(AHEAD @ turn) for turn in turns]
    found = cross_check(surface, others, SLACK_M)
    towards = np.stack([other.T_cam_obj.inverse().translation_m for other in others]) / 0.4
    beyond_outline = (
        surface @ towards.T / 0.05 - 0.05 / 0.4
    )  # a camera sees of a ball what is more than this towards it
    assert not found.denied.any()
    assert (
        np.abs(found.confirmed - (beyond_outline > 0).sum(axis=1)) <= (np.abs(beyond_outline) < 0.2).sum(axis=1)
    ).all()


def test_the_votes_do_not_depend_on_the_object_s_axes(ball: PosedFrame) -> None:
    points = np.random.default_rng(0).uniform(-0.08, 0.08, (300, 3))
    G = Pose.exp([0.5, -1.0, 0.3, 0.2, 0.1, -0.4])
    moved = replace(ball, T_cam_obj=ball.T_cam_obj @ G.inverse())
    assert votes(G @ points, moved) == votes(points, ball)


def test_the_others_are_all_but_one(ball: PosedFrame) -> None:
    frames = [ball, replace(ball, object_id="b"), replace(ball, object_id="c")]
    assert [frame.object_id for frame in others_than(frames, 1)] == ["globe", "c"]
    assert others_than(frames[:1], 0) == []
