"""What stands still is where the camera's motion leaves it, and that holds a pose that the picture leaves unsure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.camera_motion import CameraMotion, Landmarks
from tracker.frame import Frame
from tracker.geometry import Floats, Pose
from tracker.refinement import Refined
from tracker.rest import BIAS, Rest, Resting
from tracker.symmetry import Symmetry

POSE = Pose.exp(np.array((0.1, 0.2, -0.1, 0.05, 0.02, 0.7)))
MOVED = Pose.exp(np.array((0.0, 0.3, 0.1, 0.15, -0.02, 0.01)))  # of the camera, in every step
PLAIN = Symmetry.generated([], np.zeros(3))
HALF = Symmetry.generated([np.diag((-1.0, -1.0, 1.0))], np.zeros(3))
small = st.floats(-0.01, 0.01)


def refined(pose: Pose, sigma_rad: float = 0.002, sigma_m: float = 0.0002) -> Refined:
    information = np.diag([sigma_rad**-2] * 3 + [sigma_m**-2] * 3)
    return Refined(pose, information, np.zeros((0, 6)), 0.001, 500)


def resting(pose: Pose, sigma_rad: float = 0.02, sigma_m: float = 0.002) -> Resting:
    return Resting(pose, np.diag([sigma_rad**2] * 3 + [sigma_m**2] * 3))


class Moves(CameraMotion):
    """A camera of which the motion is known, or is lost."""

    def __init__(self, frame: Frame) -> None:
        super().__init__()
        self._frame, self._poses = frame, {}
        self.T_now_world: Pose | None = Pose.identity()
        self.step(Pose.identity())

    def step(self, T_now_last: Pose) -> None:
        self.advance(self._frame)
        assert self.T_now_world is not None
        self.T_now_world = T_now_last @ self.T_now_world
        self._poses[self.now] = self.T_now_world

    def since(self, then: Landmarks | None) -> Pose | None:
        return None if self.T_now_world is None else self.T_now_world @ self._poses[then].inverse()


@pytest.fixture
def camera(can_frames: list[Frame]) -> Moves:
    return Moves(can_frames[0])


def followed(camera: Moves, *moves: Pose, sigmas_rad: tuple[float, ...] = ()) -> Rest:
    """In a world in which it moves so between the frames; the camera moves too."""
    rest, T_world_obj = Rest(), POSE
    for move, sigma_rad in zip(moves, sigmas_rad or [0.002] * len(moves), strict=True):
        camera.step(MOVED)
        T_world_obj = move @ T_world_obj
        assert camera.T_now_world is not None
        rest.found(refined(camera.T_now_world @ T_world_obj, sigma_rad), camera)
    return rest


STILL = Pose.identity()


def camera_pose(camera: Moves) -> Pose:
    assert camera.T_now_world is not None
    return camera.T_now_world


def test_it_is_where_the_camera_s_motion_leaves_it_about_as_surely_as_it_was(camera: Moves) -> None:
    rest = followed(camera, STILL, STILL)
    camera.step(MOVED)
    found = rest.now(camera, None, PLAIN)
    assert found is not None
    assert camera.T_now_world is not None
    assert found.T_cam_obj.matrix == pytest.approx((camera.T_now_world @ POSE).matrix, abs=1e-9)
    sigmas = np.sqrt(np.diag(found.covariance))
    assert (sigmas > [BIAS * 0.002] * 3 + [BIAS * 0.0002] * 3).all()
    assert (sigmas < [0.03] * 3 + [0.003] * 3).all()


def test_of_the_last_frames_the_surest_counts(camera: Moves) -> None:
    off = Pose.exp(np.array((0.01, 0, 0, 0, 0, 0)))
    rest = followed(camera, STILL, off, off.inverse(), sigmas_rad=(0.02, 0.002, 0.02))
    found = rest.now(camera, None, PLAIN)
    assert found is not None
    assert camera.T_now_world is not None
    assert found.T_cam_obj.matrix == pytest.approx((camera.T_now_world @ off @ POSE).matrix, abs=1e-9)


def test_nothing_is_known_of_what_was_seen_once_moves_or_was_seen_by_a_camera_that_is_lost(camera: Moves) -> None:
    assert Rest().now(camera, None, PLAIN) is None
    assert followed(camera, STILL).now(camera, None, PLAIN) is None
    turned, shifted = (Pose.exp(np.array(six)) for six in ((0.15, 0, 0, 0, 0, 0), (0, 0, 0, 0.015, 0, 0)))
    for move in (turned, shifted):
        assert followed(camera, STILL, move).now(camera, None, PLAIN) is None
    slowly = Pose.exp(np.array((0, 0.015, 0, 0, 0, 0)))  # 26 degrees a second
    assert followed(camera, *[slowly] * 10, sigmas_rad=(0.001, *[0.002] * 9)).now(camera, None, PLAIN) is None
    rest = followed(camera, STILL, STILL)
    camera.T_now_world = None
    assert rest.now(camera, None, PLAIN) is None


def test_what_is_seen_where_it_was_need_not_be_looked_for_in_a_frame_more(camera: Moves) -> None:
    """Turned by half a turn it is seen as it was, too. What is seen elsewhere may still be still: it may be hidden."""
    moving = followed(camera, STILL, Pose.exp(np.array((0.15, 0, 0, 0, 0, 0))), STILL, sigmas_rad=(0.001, 0.002, 0.002))
    assert moving.now(camera, None, HALF) is None
    there = moving.now(camera, refined(camera_pose(camera) @ POSE, 0.02), HALF)
    assert there is not None
    half = Pose(np.diag((-1.0, -1.0, 1.0)), np.zeros(3))
    assert moving.now(camera, refined(there.T_cam_obj @ half, 0.02), HALF) is not None
    assert moving.now(camera, refined(there.T_cam_obj @ half, 0.02), PLAIN) is None
    still = followed(camera, STILL, STILL)
    aside = refined(camera_pose(camera) @ POSE.nudged(np.array((0, 0.5, 0, 0, 0, 0))), 0.02)
    assert still.now(camera, aside, PLAIN) is not None


@given(turn=st.tuples(small, small, small), surer=st.floats(0.25, 4))
def test_what_is_seen_and_that_it_stands_still_count_by_how_sure_they_are(
    turn: tuple[float, float, float], surer: float
) -> None:
    apart = np.array((*turn, 0, 0, 0))
    seen = refined(POSE.nudged(apart), 0.02 / BIAS, 0.002 / BIAS)
    held = Resting(POSE, resting(POSE).covariance * surer).held(seen, PLAIN)
    least = 0.01**2  # beside noise
    weight = surer * 0.02**2 / (surer * 0.02**2 + 0.02**2 + least)
    assert held.T_cam_obj.angle_to_rad(POSE.nudged(weight * apart)) < 1e-4
    assert held.aligned == seen.aligned
    assert (np.linalg.eigvalsh(held.information) > np.linalg.eigvalsh(seen.information) * 0.5).all()


@pytest.mark.parametrize("seen", [None, refined(POSE.nudged(np.array((0.4, 0, 0, 0, 0, 0))))])
def test_where_the_picture_says_nothing_or_something_else_it_is_where_it_stood(seen: Refined | None) -> None:
    held = resting(POSE).held(seen, PLAIN)
    assert held.T_cam_obj is POSE
    assert held.aligned == 0
    assert np.sqrt(np.diag(np.linalg.inv(held.information))) == pytest.approx([0.02 / BIAS] * 3 + [0.002 / BIAS] * 3)


def test_equivalent_poses_are_held_alike() -> None:
    seen = refined(POSE.nudged(np.array((0.01, 0, 0, 0, 0, 0))), 0.01)
    other = replace(seen, T_cam_obj=seen.T_cam_obj @ Pose(np.diag((-1.0, -1.0, 1.0)), np.zeros(3)))
    one, same = (resting(POSE).held(each, HALF) for each in (seen, other))
    assert one.T_cam_obj.matrix == pytest.approx(same.T_cam_obj.matrix, abs=1e-9)


@given(turn=st.tuples(*[st.floats(-3, 3)] * 3))
def test_it_does_not_depend_on_the_axes_of_the_camera(turn: tuple[float, float, float]) -> None:
    def about(pose: Pose, covariance: Floats) -> tuple[Pose, Floats]:
        both = np.kron(np.eye(2), other.rotation)
        return other @ pose, both @ covariance @ both.T

    other = Pose.exp(np.array((*turn, 0, 0, 0)))
    covariance = np.diag((0.01, 0.02, 0.03, 0.001, 0.002, 0.003)) ** 2
    seen = refined(POSE.nudged(np.array((0.01, -0.01, 0.01, 0.001, 0, 0))), 0.005)
    held = Resting(POSE, covariance).held(seen, PLAIN)
    turned = Resting(*about(POSE, covariance)).held(replace(seen, T_cam_obj=other @ seen.T_cam_obj), PLAIN)
    assert turned.T_cam_obj.matrix == pytest.approx((other @ held.T_cam_obj).matrix, abs=1e-6)
