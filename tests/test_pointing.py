"""Boxes and clicks in the pixels of a frame."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.errors import ConfigError
from tracker.frame import Frame
from tracker.geometry import Intrinsics
from tracker.pointing import Click, clicked_m, measured_in, parse_pointer, parse_pointers
from tracker.view import Box

CAMERA = Intrinsics(50.0, 50.0, 31.5, 23.5, 64, 48)


def frame_of(depth_m: np.ndarray) -> Frame:
    return Frame(np.zeros((48, 64, 3), np.uint8), depth_m.astype(np.float32), CAMERA, 0)


def test_what_is_written_is_a_click_or_a_box() -> None:
    assert parse_pointer("320,240") == Click(320, 240)
    assert parse_pointer("1, 2, 30, 40") == Box(1, 2, 30, 40)


@pytest.mark.parametrize("text", ["", "1", "1,2,3", "a,b", "1.5,2", "10,10,10,20", "10,20,30,5"])
def test_what_points_nowhere_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="points nowhere"):
        parse_pointer(text)


def test_an_object_has_a_name_unless_it_is_the_only_one() -> None:
    assert parse_pointers(["3,4"], ["mug"]) == {"mug": Click(3, 4)}
    assert parse_pointers(["mug=3,4", "a=b=1,2,3,4"], ["mug", "a=b"]) == {"mug": Click(3, 4), "a=b": Box(1, 2, 3, 4)}
    with pytest.raises(ConfigError, match=r"of which object.* mug, can"):
        parse_pointers(["3,4"], ["mug", "can"])


def test_a_box_holds_its_pixels_that_have_depth() -> None:
    depth_m = np.ones((48, 64))
    depth_m[10, 20] = 0
    mask = measured_in(Box(20, 10, 24, 13), frame_of(depth_m))
    assert mask.sum() == 4 * 3 - 1
    assert mask[10:13, 20:24].sum() == 11


def test_a_box_may_reach_beyond_the_picture() -> None:
    frame = frame_of(np.ones((48, 64)))
    assert measured_in(Box(-5, -5, 2, 3), frame).sum() == 2 * 3
    assert not measured_in(Box(-9, -9, -2, -1), frame).any()
    assert not measured_in(Box(70, 0, 90, 20), frame).any()


def test_a_click_meets_the_surface() -> None:
    frame = frame_of(np.full((48, 64), 0.5))
    place_m = clicked_m(Click(40, 20), frame)
    assert place_m is not None
    assert place_m == pytest.approx([(40 - 31.5) / 50 * 0.5, (20 - 23.5) / 50 * 0.5, 0.5])


def test_a_click_into_a_hole_meets_what_is_around_it() -> None:
    depth_m = np.full((48, 64), 0.5)
    depth_m[19:22, 39:42] = 0
    place_m = clicked_m(Click(40, 20), frame_of(depth_m))
    assert place_m is not None
    assert place_m[2] == pytest.approx(0.5)


@pytest.mark.parametrize("click", [Click(40, 20), Click(-20, 5), Click(500, 500)])
def test_a_click_on_nothing_that_was_measured_meets_nothing(click: Click) -> None:
    depth_m = np.full((48, 64), 0.5)
    depth_m[10:30, 30:50] = 0
    assert clicked_m(click, frame_of(depth_m)) is None
