"""What counts as in sight, on the object and right, at the limits."""

from __future__ import annotations

from dataclasses import replace

import pytest

from eval.scenarios.frame_log import FrameLog

GOOD = FrameLog(0, 1.0, True, False, "tracking", 0.8, "found", error_m=0.001, error_deg=1.0)
NONE = FrameLog(0, 1.0, True, False, "lost", 0.0, "gone")


@pytest.mark.parametrize(
    ("change", "in_sight", "half"),
    [
        ({}, True, True),
        ({"visible": 0.5}, True, True),
        ({"visible": 0.499}, True, False),
        ({"visible": 0.05}, True, False),
        ({"visible": 0.049}, False, False),
        ({"has_depth": False}, False, False),
    ],
)
def test_in_sight_is_a_twentieth_with_depth(change: dict, in_sight: bool, half: bool) -> None:
    frame = replace(GOOD, **change)
    assert (frame.in_sight, frame.half_in_sight) == (in_sight, half)


def test_astray_is_beyond_five_centimetres_whether_in_sight_or_not() -> None:
    assert replace(GOOD, error_m=0.0501).astray
    assert not replace(GOOD, error_m=0.05).astray
    assert replace(GOOD, error_m=0.06, visible=0.0).astray
    assert not NONE.astray


def test_on_the_object_is_tracked_in_sight_and_not_astray() -> None:
    assert GOOD.on_object
    assert replace(GOOD, error_m=0.05).on_object
    assert not replace(GOOD, error_m=0.0501).on_object
    assert not replace(GOOD, visible=0.0).on_object
    assert not NONE.on_object


def test_right_is_within_two_centimetres_and_ten_degrees_of_what_can_be_seen() -> None:
    assert GOOD.right
    assert not replace(GOOD, error_m=0.02).right
    assert not replace(GOOD, error_deg=10.0).right
    assert not replace(GOOD, visible=0.049).right
    assert replace(GOOD, has_depth=False).right  # a pose may come from colour alone
    assert not NONE.right
