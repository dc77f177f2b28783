"""What may come through the door, and what is turned away there by name."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.errors import FrameError
from tracker.frame import Frame, PosedFrame, Provenance
from tracker.geometry import Intrinsics, Pose

CAMERA = Intrinsics(60.0, 60.0, 31.5, 23.5, 64, 48)
INSIDE = np.zeros((48, 64), bool)
INSIDE[10:30, 20:40] = True


def some_frame(**changes: Any) -> Frame:
    parts: dict[str, Any] = {
        "rgb": np.full((48, 64, 3), 90, np.uint8),
        "depth_m": np.full((48, 64), 0.8, np.float32),
        "intrinsics": CAMERA,
        "stamp_ns": 33_333_333,
        "masks": {"mug": INSIDE},
        "index": 7,
        "provenance": Provenance("bop:somewhere:3"),
    }
    return Frame(**(parts | changes))


def depth_with(*values: float) -> np.ndarray:
    """A depth picture at 0.8 m whose first pixels have these values."""
    depth_m = np.full((48, 64), 0.8, np.float32)
    depth_m.ravel()[: len(values)] = values
    return depth_m


def test_a_good_frame_is_kept_as_it_came_and_cannot_be_changed() -> None:
    rgb, depth_m = np.zeros((48, 64, 3), np.uint8), depth_with(0.0)
    frame = some_frame(rgb=rgb, depth_m=depth_m)
    assert frame.rgb is rgb
    assert frame.depth_m is depth_m
    with pytest.raises(FrozenInstanceError):
        frame.stamp_ns = 5  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"rgb": None}, r"rgb is missing \(got NoneType"),
        ({"depth_m": None}, "depth_m is missing"),
        ({"masks": {"mug": None}}, "mask of object 'mug' is missing"),
        ({"rgb": np.zeros((48, 64), np.uint8)}, r"rgb has shape \(48, 64\), expected \(48, 64, 3\)"),
        ({"rgb": np.zeros((48, 64, 4), np.uint8)}, "rgb has shape"),
        ({"rgb": np.zeros((64, 48, 3), np.uint8)}, "rgb has shape"),
        ({"rgb": np.zeros((48, 64, 3), np.float32)}, "rgb has dtype float32, expected uint8"),
        ({"depth_m": np.ones((24, 32), np.float32)}, r"depth_m has shape \(24, 32\), expected \(48, 64\)"),
        ({"depth_m": np.ones((48, 64, 1), np.float32)}, "depth_m has shape"),
        ({"depth_m": np.ones((48, 64))}, "depth_m has dtype float64, expected float32"),
        ({"depth_m": np.full((48, 64), 800, np.uint16)}, "depth_m has dtype uint16, expected float32"),
        ({"masks": {"mug": np.ones((47, 64), bool)}}, "mask of object 'mug' has shape"),
        ({"masks": {"mug": np.ones((48, 64), np.uint8)}}, "mask of object 'mug' has dtype uint8, expected bool"),
        ({"stamp_ns": -1}, "whole number of nanoseconds from 0, got -1"),
        ({"stamp_ns": 0.033}, r"whole number of nanoseconds from 0, got 0\.033"),
        ({"depth_m": depth_with(np.nan)}, "depth_m has 1 values that are not finite"),
        ({"depth_m": depth_with(np.inf, np.nan, -np.inf)}, "depth_m has 3 values that are not finite"),
        ({"depth_m": depth_with(-0.001)}, r"negative values \(least -0\.001\)"),
    ],
)
def test_what_cannot_be_right_is_refused_by_frame_and_name(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(FrameError, match=f"frame 7 of bop:somewhere:3: .*{complaint}"):
        some_frame(**changes)


@given(median_mm=st.integers(21, 20_000), holes=st.floats(0, 0.9))
def test_millimetres_are_never_taken_for_metres(median_mm: int, holes: float) -> None:
    depth = np.full((48, 64), median_mm, np.float32)
    depth.ravel()[: int(holes * depth.size)] = 0
    with pytest.raises(FrameError, match=f"median depth is {median_mm}: this looks like millimetres"):
        some_frame(depth_m=depth)


@given(median_m=st.floats(0.1, 10), far_m=st.floats(21, 65), share=st.floats(0, 0.45))
def test_metres_pass_even_where_a_window_shows_the_far_end_of_the_street(
    median_m: float, far_m: float, share: float
) -> None:
    depth_m = np.full((48, 64), median_m, np.float32)
    depth_m.ravel()[: int(share * depth_m.size)] = far_m
    assert some_frame(depth_m=depth_m).depth_m is depth_m


def test_a_frame_without_any_depth_passes_as_missing_depth_is_no_damage() -> None:
    assert not some_frame(depth_m=np.zeros((48, 64), np.float32)).depth_m.any()


def test_an_object_that_is_not_to_be_seen_has_an_empty_mask_and_an_unknown_one_has_none() -> None:
    frame = some_frame(masks={"mug": np.zeros((48, 64), bool)})
    assert not frame.masks["mug"].any()
    assert "bowl" not in frame.masks
    assert dict(some_frame(masks={}).masks) == {}


@pytest.mark.parametrize("scale", [0.5, 2])
def test_a_camera_of_another_resolution_is_refused(scale: float) -> None:
    other = Intrinsics(60 * scale, 60 * scale, 32 * scale, 24 * scale, 64, 48)
    with pytest.raises(FrameError, match="does K belong to another resolution"):
        some_frame(intrinsics=other)


def test_pictures_of_another_size_than_the_camera_s_are_refused() -> None:
    with pytest.raises(FrameError, match=r"rgb has shape \(48, 64, 3\), expected \(96, 128, 3\)"):
        some_frame(intrinsics=replace(CAMERA, width=128, height=96))


@pytest.mark.parametrize(
    ("mask", "complaint"),
    [
        (INSIDE[:24], r"mask of object 'mug' has shape \(24, 64\), expected \(48, 64\)"),
        (INSIDE.astype(np.uint8), "dtype uint8, expected bool"),
        (None, "is missing"),
    ],
)
def test_a_posed_frame_has_a_mask_of_its_frame_s_size(mask: Any, complaint: str) -> None:
    assert PosedFrame(some_frame(), "mug", Pose.identity(), INSIDE).mask is INSIDE
    with pytest.raises(FrameError, match=f"frame 7 of bop:somewhere:3: .*{complaint}"):
        PosedFrame(some_frame(), "mug", Pose.identity(), mask)
