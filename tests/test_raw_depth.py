"""Stored depth and what its scale means: every convention, and what is refused by name."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tracker.errors import SourceError
from tracker.sources.raw_depth import CONVENTIONS, metres_per_unit, raw_to_metres


# What is stored and stated for a distance of 0.75 m.
@pytest.mark.parametrize(
    ("convention", "scale", "stored"),
    [
        ("realsense", 0.001, 750),
        ("realsense", 0.0001, 7_500),  # D405
        ("realsense", 0.00025, 3_000),  # L515
        ("open3d", 1_000, 750),
        ("open3d", 4_000, 3_000),
        ("orbbec", 1.0, 750),
        ("orbbec", 0.25, 3_000),
        ("bop", 1.0, 750),
        ("bop", 0.1, 7_500),
        ("ycb-video", 10_000, 7_500),
        ("ycb-video", None, 7_500),
        ("tum", 5_000, 3_750),
        ("tum", None, 3_750),
        ("16UC1", None, 750),
        ("mono16", None, 750),
        ("32FC1", None, 0.75),
        ("millimetres", None, 750),
    ],
)
def test_what_every_convention_stores_for_three_quarters_of_a_metre(
    convention: str, scale: float | None, stored: float
) -> None:
    unit_m = metres_per_unit(convention, "here", scale)
    raw = np.full((3, 4), stored, np.float32 if convention == "32FC1" else np.uint16)
    assert raw_to_metres(raw, unit_m, "here") == pytest.approx(0.75, rel=1e-6)


@pytest.mark.parametrize("scale", [0.0, -0.001, float("nan"), float("inf")])
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_scale_that_is_no_length_is_refused_with_the_source_and_the_formula(convention: str, scale: float) -> None:
    with pytest.raises(SourceError, match=r"^cam 7: the depth scale must be positive, got .* depth is raw [*/]"):
        metres_per_unit(convention, "cam 7", scale)


def test_a_scale_that_has_to_be_stated_and_a_convention_that_there_is_not() -> None:
    with pytest.raises(SourceError, match=r"cam 7: the depth scale is missing; depth is raw \* scale \(realsense\)"):
        metres_per_unit("realsense", "cam 7")
    with pytest.raises(SourceError, match="cam 7: no depth convention is called 'kinect'; there is realsense, open3d"):
        metres_per_unit("kinect", "cam 7", 1.0)
    with pytest.raises(SourceError, match="must be positive, got inf metres per unit"):
        metres_per_unit("tum", "cam 7", 5e-324)


def test_what_the_user_says_counts_whatever_the_source_states() -> None:
    assert metres_per_unit("realsense", "cam 7", 0.0, override=0.0001) == 0.0001
    assert metres_per_unit("32FC1", "cam 7", override=0.001) == 0.001
    with pytest.raises(SourceError, match="cam 7: the depth scale must be positive, got 0 metres per unit"):
        metres_per_unit("realsense", "cam 7", 0.001, override=0.0)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_metres_are_a_copy_and_nothing_stays_nothing(dtype: npt.DTypeLike) -> None:
    raw = np.array([[0, 1, 200], [3, 0, 5]], dtype)
    depth_m = raw_to_metres(raw, 1.0, "here")
    raw[:] = 9
    assert depth_m.dtype == np.float32
    assert depth_m.tolist() == [[0, 1, 200], [3, 0, 5]]


def test_what_is_no_distance_is_no_depth() -> None:
    raw = np.array([[np.nan, np.inf, -np.inf, -0.5, -0.0, 0.5]], np.float32)
    assert raw_to_metres(raw, 1.0, "here").tolist() == [[0, 0, 0, 0, 0, 0.5]]


@pytest.mark.parametrize(
    "raw", [np.ones((4, 4, 3), np.uint8), np.ones(4, np.uint16), np.ones((4, 4)), np.ones((4, 4), np.int16)]
)
def test_another_picture_is_not_depth(raw: npt.NDArray) -> None:
    with pytest.raises(SourceError, match=rf"cam 7: a depth picture has one channel .*, got {raw.dtype}"):
        raw_to_metres(raw, 0.001, "cam 7")
    with pytest.raises(SourceError, match="cam 7: the depth scale must be positive"):
        raw_to_metres(np.ones((4, 4), np.uint16), 0.0, "cam 7")
