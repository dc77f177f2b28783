"""What is remembered of places goes along with the camera, and is forgotten when the object is found."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.camera_motion import CameraMotion
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.whereabouts import Whereabouts

HERE = Pose.exp(np.array((0.1, 0.2, -0.1, 0.05, 0.02, 0.7)))
THERE = Pose.exp(np.array((0.0, 0.5, 0.0, -0.1, 0.0, 0.9)))
MOVED = Pose.exp(np.array((0.0, 0.3, 0.1, 0.15, -0.02, 0.01)))  # T_now_last of the camera


class Moved(CameraMotion):
    """A camera of which the motion is known, or is not."""

    def __init__(self, motion: Pose | None) -> None:
        super().__init__()
        self._known = motion

    def from_last(self) -> Pose | None:
        return self._known


def assert_expected(where: Whereabouts, camera: CameraMotion, *poses: Pose) -> None:
    assert [p.matrix for p in where.expected(camera)] == [pytest.approx(p.matrix, abs=1e-12) for p in poses]


def test_nothing_is_expected_of_what_was_never_seen() -> None:
    where = Whereabouts()
    assert not where.known
    assert_expected(where, Moved(MOVED))


def test_what_stands_still_is_expected_where_the_camera_s_motion_leaves_it() -> None:
    where = Whereabouts()
    where.found(HERE)
    assert_expected(where, Moved(MOVED), MOVED @ HERE)
    assert_expected(where, Moved(None), HERE)


def test_while_it_is_lost_the_camera_s_motions_add_up() -> None:
    where = Whereabouts()
    where.found(HERE)
    for motion in (MOVED, None, MOVED):
        where.carry(Moved(motion))
    assert_expected(where, Moved(None), MOVED @ MOVED @ HERE)


def test_what_is_suspected_is_expected_first_and_for_one_frame() -> None:
    where = Whereabouts()
    where.found(HERE)
    where.carry(Moved(None), THERE)
    assert_expected(where, Moved(MOVED), MOVED @ THERE, MOVED @ HERE)
    where.carry(Moved(None))
    assert_expected(where, Moved(None), HERE)
    where.found(THERE)
    assert_expected(where, Moved(None), THERE)


def test_a_place_that_was_pointed_out_is_the_middle_of_what_the_mask_shows(can_frames: list[Frame]) -> None:
    where, frame = Whereabouts(), can_frames[0]
    mask = frame.masks["soup_can"]
    where.point_out(np.zeros_like(mask), frame)
    assert where.pointed_out_m is None
    where.point_out(mask, frame)
    assert where.pointed_out_m is not None
    (column, row), depth_m = frame.intrinsics.project(where.pointed_out_m[None])[0], where.pointed_out_m[2]
    assert mask[round(row), round(column)]
    assert depth_m == pytest.approx(np.median(frame.depth_m[mask & (frame.depth_m > 0)]), abs=0.002)
    place_m = where.pointed_out_m
    where.carry(Moved(MOVED))
    assert where.pointed_out_m == pytest.approx((MOVED @ place_m[None])[0])
    assert not where.known
    where.found(HERE)
    assert where.pointed_out_m is None
