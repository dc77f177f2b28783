"""An object's part of a frame, pooled to a resolution that is a share of the object's size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from tracker.frame import Frame, Mask, PosedFrame
from tracker.geometry import Intrinsics, Pose
from tracker.view import MARGIN_PX, ObjectView, ViewConfig, bounding_box, view_object

CAMERA = Intrinsics(200.0, 200.0, 79.5, 59.5, 160, 120)
CONFIG = ViewConfig()
AHEAD = Pose(np.eye(3), np.array([0.01, -0.005, 0.35]))


def speckled(seed: int = 0) -> tuple[Frame, Mask]:
    """Random colours at random depths around 0.5 m, an eighth of them missing; a ragged mask."""
    rng = np.random.default_rng(seed)
    depth_m = rng.uniform(0.495, 0.505, (120, 160)).astype(np.float32)
    depth_m[rng.random(depth_m.shape) < 0.125] = 0
    mask = rng.random(depth_m.shape) < 0.9
    mask[:17], mask[95:], mask[:, :30], mask[:, 131:] = False, False, False, False
    return Frame(rng.integers(0, 256, (120, 160, 3), np.uint8), depth_m, CAMERA, 0), mask


def viewed(frame: Frame, mask: Mask, extent_m: float, pixels_across: int = 64) -> ObjectView:
    view = view_object(frame, mask, extent_m, ViewConfig(pixels_across=pixels_across, least_pixels=0))
    assert view is not None
    return view


@given(mask=arrays.arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_the_bounding_box_holds_the_mask_and_touches_it_on_every_side(mask: Mask) -> None:
    box = bounding_box(mask)
    if box is None:
        assert not mask.any()
        return
    inside = mask[box.y0 : box.y1, box.x0 : box.x1]
    assert inside.sum() == mask.sum()
    assert all(side.any() for side in (inside[0], inside[-1], inside[:, 0], inside[:, -1]))


@given(distance_m=st.floats(0.1, 3), focal_px=st.floats(150, 1500), extent_m=st.floats(0.02, 0.4))
def test_the_object_spans_the_configured_pixels_or_as_many_as_there_are(
    distance_m: float, focal_px: float, extent_m: float
) -> None:
    camera = replace(CAMERA, fx=focal_px, fy=focal_px)
    frame = Frame(np.zeros((120, 160, 3), np.uint8), np.full((120, 160), distance_m, np.float32), camera, 0)
    view = viewed(frame, np.ones((120, 160), bool), extent_m)
    in_frame_px = extent_m * focal_px / distance_m
    assert view.pixels_across == pytest.approx(extent_m * view.camera.fx / distance_m, rel=1e-6)
    if in_frame_px <= 64:
        assert view.pixels_across == pytest.approx(in_frame_px, rel=1e-6)
    else:
        assert 64 * 2 / 3 <= view.pixels_across <= 64 * 3 / 2


def test_colour_is_the_mean_of_the_masked_pixels_of_a_block() -> None:
    frame, mask = speckled()
    view = viewed(frame, mask, 0.48)  # three of 200 pixels a metre at 0.5 m
    box = bounding_box(mask)
    assert box is not None
    for row, column in ((0, 0), (7, 20), (25, 33)):
        y, x = box.y0 + 3 * row, box.x0 + 3 * column
        block, inside = frame.rgb[y : y + 3, x : x + 3], mask[y : y + 3, x : x + 3]
        pooled = view.rgb[row + MARGIN_PX, column + MARGIN_PX]
        assert pooled == pytest.approx(block[inside].mean(axis=0), abs=1e-3)
        assert view.inside[row + MARGIN_PX, column + MARGIN_PX] == (inside.sum() > 4)


def test_depth_is_the_mean_of_what_was_measured_and_none_where_almost_nothing_was() -> None:
    frame, mask = speckled()
    depth_m = frame.depth_m.copy()
    depth_m[30:60:2] = 0
    depth_m[30:60, ::2] = 0
    depth_m[60:, 33:36] = 0
    view = viewed(replace(frame, depth_m=depth_m), mask, 0.48)
    box = bounding_box(mask)
    assert box is not None
    counts = set()
    for row in range(26):
        for column in range(33):
            y, x = box.y0 + 3 * row, box.x0 + 3 * column
            block = depth_m[y : y + 3, x : x + 3][mask[y : y + 3, x : x + 3]]
            measured = block[block > 0]
            counts.add(len(measured))
            pooled = view.depth_m[row + MARGIN_PX, column + MARGIN_PX]
            if len(measured) < 3:
                assert pooled == 0
            else:
                near = np.abs(measured - np.sort(measured)[(len(measured) - 1) // 2]) < 0.48 / 64
                assert pooled == pytest.approx(measured[near].mean(), abs=1e-6)
    assert counts >= set(range(10))


@given(edge=st.integers(40, 80))
def test_no_point_hangs_in_the_air_between_a_near_and_a_far_surface(edge: int) -> None:
    frame, mask = speckled()
    depth_m = np.full((120, 160), 0.5, np.float32)
    depth_m[:, edge:] = 0.8
    pooled_m = viewed(replace(frame, depth_m=depth_m), mask, 0.8).depth_m
    assert np.isin(pooled_m.round(5), np.array([0, 0.5, 0.8], np.float32)).all()


@pytest.mark.parametrize("extent_m", [0.1, 0.3, 0.5, 0.9])
def test_the_view_s_camera_sees_every_block_where_the_frame_s_camera_sees_its_centre(extent_m: float) -> None:
    frame, mask = speckled()
    view = viewed(frame, mask, extent_m)
    block = (view.box.x1 - view.box.x0) / view.camera.width
    columns, rows = np.meshgrid(np.arange(view.camera.width), np.arange(view.camera.height))
    points = view.camera.unproject(columns.ravel(), rows.ravel(), np.full(columns.size, 0.5))
    pixels = frame.intrinsics.project(points)
    assert np.allclose(pixels[:, 0], view.box.x0 + (columns.ravel() + 0.5) * block - 0.5)
    assert np.allclose(pixels[:, 1], view.box.y0 + (rows.ravel() + 0.5) * block - 0.5)
    assert view.rgb.shape == (view.camera.height, view.camera.width, 3)
    assert (view.box.y1 - view.box.y0) / view.camera.height == block


@pytest.mark.parametrize("pixels_across", [16, 32, 64, 200])
def test_points_lie_on_the_surface_whatever_the_resolution(
    globe: Callable[..., PosedFrame], pixels_across: int
) -> None:
    ball = globe(AHEAD)
    view = viewed(ball.frame, ball.mask, 0.1, pixels_across)
    points = view.points()
    spacing_m = 0.1 / view.pixels_across
    assert len(points) == view.has_depth.sum() > 0.6 * view.pixels_across**2
    radius_m = np.linalg.norm(points - AHEAD.translation_m, axis=1)
    assert np.abs(np.median(radius_m) - 0.05) < 0.02 * spacing_m + 1e-6
    assert np.abs(radius_m - 0.05).max() < spacing_m


def test_a_margin_is_left_around_the_object_and_all_of_it_is_within() -> None:
    frame, mask = speckled()
    for extent_m in (0.1, 0.3, 0.5, 0.9):
        view = viewed(frame, mask, extent_m)
        for border in (view.inside[:MARGIN_PX], view.inside[-MARGIN_PX:], view.inside[:, :MARGIN_PX]):
            assert not border.any()
        assert not view.inside[:, -MARGIN_PX:].any()
        assert not view.rgb[:MARGIN_PX].any()
        assert not view.depth_m[:, :MARGIN_PX].any()
        block = (view.box.x1 - view.box.x0) // view.camera.width
        rows, columns = np.nonzero(mask)
        rows, columns = (rows - view.box.y0) // block, (columns - view.box.x0) // block
        assert MARGIN_PX == rows.min() == columns.min()
        assert (rows.max(), columns.max()) == (view.camera.height - MARGIN_PX - 1, view.camera.width - MARGIN_PX - 1)


@given(right=st.integers(-30, 29), down=st.integers(-17, 25))
def test_an_object_elsewhere_in_the_picture_looks_the_same(right: int, down: int) -> None:
    frame, mask = speckled()
    there = viewed(frame, mask, 0.48)
    moved = replace(
        frame,
        rgb=np.roll(frame.rgb, (down, right), axis=(0, 1)),
        depth_m=np.roll(frame.depth_m, (down, right), axis=(0, 1)),
    )
    here = viewed(moved, np.roll(mask, (down, right), axis=(0, 1)), 0.48)
    assert np.array_equal(here.rgb, there.rgb)
    assert np.array_equal(here.depth_m, there.depth_m)
    assert np.array_equal(here.inside, there.inside)
    assert (here.box.x0, here.box.y0) == (there.box.x0 + right, there.box.y0 + down)
    shift_m = np.array([right, down]) / 200 * 0.5
    assert np.allclose((here.points() - there.points())[:, :2].mean(axis=0), shift_m, atol=2e-4)


def test_pictures_of_twice_the_resolution_give_the_same_view() -> None:
    frame, mask = speckled()
    coarse = viewed(frame, mask, 0.48)
    double = Intrinsics(400.0, 400.0, 159.5, 119.5, 320, 240)
    fine_frame = Frame(
        frame.rgb.repeat(2, axis=0).repeat(2, axis=1), frame.depth_m.repeat(2, axis=0).repeat(2, axis=1), double, 0
    )
    fine = viewed(fine_frame, mask.repeat(2, axis=0).repeat(2, axis=1), 0.48)
    assert fine.camera == coarse.camera
    assert np.allclose(fine.rgb, coarse.rgb, atol=1e-3)
    assert np.allclose(fine.depth_m, coarse.depth_m, atol=1e-6)
    assert np.array_equal(fine.inside, coarse.inside)


def test_the_resolution_does_not_depend_on_how_much_depth_is_missing() -> None:
    frame, mask = speckled()
    holes = np.random.default_rng(1).random(mask.shape) < 0.7
    sparse = viewed(replace(frame, depth_m=np.where(holes, np.float32(0), frame.depth_m)), mask, 0.48)
    assert sparse.camera == viewed(frame, mask, 0.48).camera


def test_pixels_beside_the_mask_change_nothing() -> None:
    frame, mask = speckled()
    other = speckled(1)[0]
    changed = replace(
        frame,
        rgb=np.where(mask[:, :, None], frame.rgb, other.rgb),
        depth_m=np.where(mask, frame.depth_m, np.float32(0.2)),
    )
    one, two = viewed(frame, mask, 0.48), viewed(changed, mask, 0.48)
    assert np.array_equal(one.rgb, two.rgb)
    assert np.array_equal(one.depth_m, two.depth_m)


def test_an_object_in_the_corner_is_viewed_with_a_margin_beyond_the_frame() -> None:
    frame, _ = speckled()
    mask = np.zeros((120, 160), bool)
    mask[:20, 130:] = True
    view = viewed(frame, mask, 0.48)
    assert (view.box.y0, view.box.x0) == (-12, 118)
    assert view.box.x1 > 160
    assert view.inside.sum() == pytest.approx(20 * 30 / 9, rel=0.1)


@pytest.mark.parametrize(("least_pixels", "block"), [(0, 6), (100, 3), (400, 1), (100_000, 1)])
def test_an_object_of_which_little_shows_is_viewed_more_finely(least_pixels: int, block: int) -> None:
    frame, _ = speckled()
    mask = np.zeros((120, 160), bool)
    mask[40:70, 60:90] = True  # 900 pixels, 25 of the nominal ones
    view = view_object(frame, mask, 0.96, ViewConfig(least_pixels=least_pixels))
    assert view is not None
    assert (view.box.x1 - view.box.x0) / view.camera.width == block
    assert view.inside.sum() >= min(least_pixels, 900)


def test_there_is_no_view_of_nothing_nor_of_what_has_no_depth() -> None:
    frame, mask = speckled()
    assert view_object(frame, np.zeros_like(mask), 0.1, CONFIG) is None
    blind = replace(frame, depth_m=np.where(mask, np.float32(0), frame.depth_m))
    assert view_object(blind, mask, 0.1, CONFIG) is None
