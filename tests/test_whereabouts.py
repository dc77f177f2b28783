"""What is remembered of places goes along with the camera, and is forgotten when the object is found."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.camera_motion import CameraMotion, Landmarks
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.whereabouts import Whereabouts

HERE = Pose.exp(np.array((0.1, 0.2, -0.1, 0.05, 0.02, 0.7)))
THERE = Pose.exp(np.array((0.0, 0.5, 0.0, -0.1, 0.0, 0.9)))
MOVED = Pose.exp(np.array((0.0, 0.3, 0.1, 0.15, -0.02, 0.01)))  # T_now_last of the camera


class Moved(CameraMotion):
    """A camera of which the motion since the last frame is known, or is not, and maybe that since an earlier one."""

    def __init__(self, motion: Pose | None, straight: Pose | None = None) -> None:
        super().__init__()
        self._motion, self._straight = motion, straight

    def from_last(self) -> Pose | None:
        return self._motion

    def since(self, then: Landmarks | None) -> Pose | None:
        return self._straight if then is not None else None


def assert_expected(where: Whereabouts, camera: CameraMotion, *poses: Pose) -> None:
    assert [p.matrix for p in where.expected(camera)] == [pytest.approx(p.matrix, abs=1e-12) for p in poses]


@pytest.fixture
def seen(can_frames: list[Frame]) -> Whereabouts:
    """Of an object that was found where it is, in a frame that is remembered."""
    where, camera = Whereabouts(), CameraMotion()
    camera.advance(can_frames[0])
    where.found(HERE, camera)
    return where


def test_nothing_is_expected_of_what_was_never_seen() -> None:
    where = Whereabouts()
    assert not where.known
    assert_expected(where, Moved(MOVED))


def test_what_stands_still_is_expected_where_the_camera_s_motion_leaves_it(seen: Whereabouts) -> None:
    assert seen.known
    assert_expected(seen, Moved(MOVED), MOVED @ HERE)
    assert_expected(seen, Moved(None), HERE)


def test_while_it_is_lost_the_camera_s_motions_add_up(seen: Whereabouts) -> None:
    for motion in (MOVED, None, MOVED):
        seen.carry(Moved(motion))
    assert_expected(seen, Moved(None), MOVED @ MOVED @ HERE)


def test_what_passed_in_between_is_forgotten_where_the_picture_is_that_of_then_again(seen: Whereabouts) -> None:
    seen.carry(Moved(MOVED))  # by something large that moved in front of the camera
    assert_expected(seen, Moved(MOVED, Pose.identity()), HERE)
    seen.carry(Moved(MOVED, Pose.identity()))
    assert_expected(seen, Moved(None), HERE)


def test_what_is_suspected_is_expected_first_and_for_one_frame(seen: Whereabouts) -> None:
    seen.carry(Moved(None), THERE)
    assert_expected(seen, Moved(MOVED), MOVED @ THERE, MOVED @ HERE)
    seen.carry(Moved(None))
    assert_expected(seen, Moved(None), HERE)
    seen.found(THERE, Moved(None))
    assert_expected(seen, Moved(None), THERE)


def test_where_somebody_says_that_it_is_it_is_expected() -> None:
    where = Whereabouts()
    where.told(HERE)
    assert_expected(where, Moved(MOVED), MOVED @ HERE)


def test_a_place_that_was_pointed_out_is_the_middle_of_what_the_mask_shows(can_frames: list[Frame]) -> None:
    where, frame, still = Whereabouts(), can_frames[0], Moved(None)
    mask = frame.masks["soup_can"]
    where.point_out(np.zeros_like(mask), frame, still)
    assert where.pointed_out_m(still) is None
    where.point_out(mask, frame, still)
    place_m = where.pointed_out_m(still)
    assert place_m is not None
    column, row = frame.intrinsics.project(place_m[None])[0]
    assert mask[round(row), round(column)]
    assert place_m[2] == pytest.approx(np.median(frame.depth_m[mask & (frame.depth_m > 0)]), abs=0.002)
    where.carry(Moved(MOVED))
    assert where.pointed_out_m(still) == pytest.approx((MOVED @ place_m[None])[0])
    assert not where.known
    where.found(HERE, still)
    assert where.pointed_out_m(still) is None
