"""How the camera moved: by what stands still in two frames, once for all objects, and not where nothing says it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tracker import camera_motion
from tracker.camera_motion import CameraMotion
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.registration import Candidate, register_pairs
from tracker.sources.synthetic import SyntheticScene, open_scene


def between(last: Frame, now: Frame) -> Pose | None:
    camera = CameraMotion()
    camera.advance(last)
    camera.advance(now)
    return camera.from_last()


def without_depth(frame: Frame) -> Frame:
    return replace(frame, depth_m=np.zeros_like(frame.depth_m))


def blank(frame: Frame) -> Frame:
    return replace(frame, rgb=np.full_like(frame.rgb, 128))


def assert_carries(scene: SyntheticScene, last: int, now: int) -> None:
    """The objects, none of which moves, from where the camera saw them to where it sees them."""
    T_now_last = between(scene[last], scene[now])
    assert T_now_last is not None
    for object_id in scene.object_ids:
        before, after = (scene.sightings(object_id)[index].T_cam_obj for index in (last, now))
        assert (T_now_last @ before).distance_to_m(after) < 0.003
        assert np.degrees((T_now_last @ before).angle_to_rad(after)) < 0.5


def test_it_is_not_known_before_the_second_frame(table_scene: SyntheticScene) -> None:
    camera = CameraMotion()
    assert camera.from_last() is None
    camera.advance(table_scene[10])
    assert camera.from_last() is None
    camera.advance(table_scene[11])
    assert camera.from_last() is not None


@pytest.mark.parametrize(("last", "now"), [(10, 11), (10, 15), (60, 50)])
def test_it_carries_what_stands_still_from_frame_to_frame(last: int, now: int, table_scene: SyntheticScene) -> None:
    """Also over a jerk of many frames, 15 cm and 13 degrees."""
    before, after = (table_scene.sightings("mug")[index].T_cam_obj for index in (last, now))
    assert before.angle_to_rad(after) > np.radians(0.5)  # otherwise the identity would do
    assert_carries(table_scene, last, now)


def test_it_carries_what_stands_on_shelves() -> None:
    assert_carries(open_scene("shelf?size=320x240"), 30, 36)


def test_there_and_back_is_no_motion(table_scene: SyntheticScene) -> None:
    there, back = (between(table_scene[a], table_scene[b]) for a, b in ((10, 15), (15, 10)))
    assert there is not None
    assert back is not None
    assert (there @ back).distance_to_m(Pose.identity()) < 0.005
    assert np.degrees((there @ back).angle_to_rad(Pose.identity())) < 0.5


def test_a_camera_that_is_still_did_not_move() -> None:
    still = open_scene("still?size=320x240")
    T_now_last = between(still[10], still[15])
    assert T_now_last is not None
    assert T_now_last.distance_to_m(Pose.identity()) < 0.002
    assert np.degrees(T_now_last.angle_to_rad(Pose.identity())) < 0.2


def test_one_object_that_moves_is_not_the_camera(can_scene: SyntheticScene) -> None:
    """The can turns and travels before a camera that is still."""
    T_now_last = between(can_scene[50], can_scene[60])
    assert T_now_last is not None
    moved_m = can_scene.sightings("soup_can")[50].T_cam_obj.distance_to_m(can_scene.sightings("soup_can")[60].T_cam_obj)
    assert T_now_last.distance_to_m(Pose.identity()) < min(0.005, 0.2 * moved_m)


@pytest.mark.parametrize("spoiled", [blank, without_depth])
def test_a_picture_that_says_nothing_gives_no_motion(spoiled: Any, table_scene: SyntheticScene) -> None:
    frames = [table_scene[10], table_scene[11]]
    assert between(spoiled(frames[0]), frames[1]) is None
    assert between(frames[0], spoiled(frames[1])) is None
    assert between(spoiled(frames[0]), spoiled(frames[1])) is None


def test_two_pictures_of_different_places_give_no_motion(can_scene: SyntheticScene) -> None:
    """What is alike by chance does not move alike."""
    shelf = open_scene("shelf?size=320x240")
    assert between(can_scene[20], shelf[30]) is None


def test_it_is_worked_out_once_a_frame_and_only_if_asked(
    table_scene: SyntheticScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def counted(*arguments: Any) -> list[Candidate]:
        asked.append(arguments)
        return register_pairs(*arguments)

    monkeypatch.setattr(camera_motion, "register_pairs", counted)
    camera = CameraMotion()
    for index in (10, 11):
        camera.advance(table_scene[index])
    assert asked == []
    first = camera.from_last()
    assert all(camera.from_last() is first for _ in range(3))
    assert len(asked) == 1
    camera.advance(table_scene[16])
    second = camera.from_last()
    assert camera.from_last() is second
    assert len(asked) == 2
    assert first is not None
    assert second is not None
    assert second.distance_to_m(first) > 0.01


def test_that_it_knows_nothing_is_worked_out_once_too(
    table_scene: SyntheticScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def nothing(*arguments: Any) -> list[Candidate]:
        asked.append(arguments)
        return []

    monkeypatch.setattr(camera_motion, "register_pairs", nothing)
    camera = CameraMotion()
    for index in (10, 11):
        camera.advance(table_scene[index])
    assert [camera.from_last() for _ in range(3)] == [None] * 3
    assert len(asked) == 1


def test_a_frame_that_says_nothing_is_forgotten_after_the_next(table_scene: SyntheticScene) -> None:
    camera = CameraMotion()
    said = []
    for frame in (table_scene[10], blank(table_scene[11]), table_scene[12], table_scene[13]):
        camera.advance(frame)
        said.append(camera.from_last() is not None)
    assert said == [False, False, False, True]


def test_the_same_frames_give_the_same_motion(table_scene: SyntheticScene) -> None:
    one, two = (between(table_scene[10], table_scene[11]) for _ in range(2))
    assert one is not None
    assert two is not None
    assert np.array_equal(one.matrix, two.matrix)
