"""What a model keeps of its reference frames, and what it refuses to take for one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tracker.frame import PosedFrame
from tracker.geometry import Pose
from tracker.reference_views import packed, unpacked
from tracker.view import bounding_box

AHEAD = Pose(np.eye(3), np.array([0.01, -0.005, 0.35]))


@pytest.fixture(scope="module")
def ball(globe: Callable[..., PosedFrame]) -> PosedFrame:
    return globe(AHEAD)


def test_what_is_within_the_box_comes_back_and_the_rest_is_empty(ball: PosedFrame) -> None:
    (again,) = unpacked(*packed([ball]), ball.object_id)
    box = bounding_box(ball.mask)
    assert box is not None
    place = np.s_[box.y0 : box.y1, box.x0 : box.x1]
    assert np.array_equal(again.mask, ball.mask)
    assert np.array_equal(again.frame.rgb[place], ball.frame.rgb[place])
    assert np.abs(again.frame.depth_m[place] - ball.frame.depth_m[place]).max() < 1e-5
    assert np.array_equal(again.frame.depth_m[place] == 0, ball.frame.depth_m[place] == 0)
    assert again.frame.rgb.sum() == ball.frame.rgb[place].sum()
    assert again.frame.intrinsics == ball.frame.intrinsics
    assert np.allclose(again.T_cam_obj.matrix, ball.T_cam_obj.matrix)
    assert again.object_id == ball.object_id


def test_a_mask_at_the_border_and_of_one_pixel_are_kept(globe: Callable[..., PosedFrame]) -> None:
    corner = globe(AHEAD)
    mask = np.zeros_like(corner.mask)
    mask[-1, -1] = True
    (again,) = unpacked(*packed([PosedFrame(corner.frame, corner.object_id, AHEAD, mask)]), corner.object_id)
    assert np.array_equal(again.mask, mask)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("x", 10_000),
        ("y", -5),
        ("camera", [300, 300, 160, 120]),
        ("camera", [300, 300, 160, 120, 1_000_000, 1_000_000]),
        ("camera", [1, 1, 1, 1, 320, 240]),
        ("depth_unit_m", "thumb"),
        ("depth_unit_m", 1.0),
        ("T_cam_obj", [[1, 0], [0, 1]]),
        ("T_cam_obj", None),
    ],
)
def test_a_view_that_does_not_fit_together_is_refused(key: str, value: Any, ball: PosedFrame) -> None:
    arrays, (header,) = packed([ball])
    with pytest.raises(ValueError, match="damaged"):
        unpacked(arrays, [{**header, key: value}], ball.object_id)


def test_a_header_that_is_no_header_is_refused(ball: PosedFrame) -> None:
    arrays, _ = packed([ball])
    for header in (None, [], {}, "x"):
        with pytest.raises(ValueError, match="damaged"):
            unpacked(arrays, [header], ball.object_id)
