"""What is clicked, boxed or nearest on the table is told from what it stands on, by depth alone."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.segment import segment
from tests.conftest import draw_globe
from tracker.errors import OnboardingError
from tracker.frame import Frame, Mask
from tracker.geometry import Intrinsics, Pose
from tracker.pointing import Click
from tracker.sources.synthetic import SyntheticScene, open_scene
from tracker.view import Box, bounding_box

CAMERA = Intrinsics(300.0, 300.0, 159.5, 119.5, 320, 240)


def overlap(a: Mask, b: Mask) -> float:
    """Intersection over union."""
    return float((a & b).sum() / max(int((a | b).sum()), 1))


def clicks(mask: Mask, count: int) -> list[Click]:
    """Pixels well inside."""
    rows, columns = np.nonzero(cv2.erode(mask.astype(np.uint8), np.ones((5, 5))))
    chosen = np.random.default_rng(0).integers(len(rows), size=count)
    return [Click(int(columns[k]), int(rows[k])) for k in chosen]


def around(mask: Mask, margin_px: int = 3) -> Box:
    box = bounding_box(mask)
    assert box is not None
    return Box(box.x0 - margin_px, box.y0 - margin_px, box.x1 + margin_px, box.y1 + margin_px)


def table(rng: np.random.Generator | None = None) -> Frame:
    """An empty one, that slopes away from the camera."""
    rows = np.indices((240, 320))[0]
    rays_y = (rows - CAMERA.cy) / CAMERA.fy
    depth_m = 0.5 / (0.8 * rays_y + 0.6)
    if rng is not None:
        depth_m += rng.normal(0, 0.001, depth_m.shape)
    return Frame(np.full((240, 320, 3), 128, np.uint8), depth_m.astype(np.float32), CAMERA, 0)


@pytest.mark.parametrize("name", ["mug", "soup_can", "clamp"])
def test_a_thing_that_stands_alone_is_found_by_any_click_and_by_a_box(name: str) -> None:
    frame = open_scene(f"turn?size=320x240&object={name}")[0]
    mask = frame.masks[name]
    for there in (*clicks(mask, 3), around(mask), around(mask, 12)):
        assert overlap(segment(frame, there), mask) > 0.8, there


@pytest.mark.parametrize(
    ("name", "index"), [("cereal_box", 0), ("tea_box", 0), ("clamp", 0), ("cereal_box", 45), ("tea_box", 45)]
)
def test_so_it_is_among_others_on_a_table(name: str, index: int, table_scene: SyntheticScene) -> None:
    frame = table_scene[index]
    mask = frame.masks[name]
    for there in (*clicks(mask, 3), around(mask)):
        assert overlap(segment(frame, there), mask) > 0.8, there


@pytest.mark.parametrize(("name", "index"), [("bowl", 0), ("bowl", 45), ("mug", 45)])
def test_a_box_holds_a_hollow_thing_together(name: str, index: int, table_scene: SyntheticScene) -> None:
    frame = table_scene[index]
    assert overlap(segment(frame, around(frame.masks[name])), frame.masks[name]) > 0.8


@pytest.mark.parametrize("name", ["mug", "tea_box", "soup_can"])
def test_where_nothing_is_said_it_is_the_nearest_thing(name: str) -> None:
    frame = open_scene(f"turn?size=320x240&object={name}")[0]
    found = segment(frame)
    assert overlap(found, frame.masks[name]) > 0.8
    assert (segment(replace(frame, masks={})) == found).all()


@settings(max_examples=8)
@given(st.floats(-0.08, 0.08), st.floats(-0.05, 0.05), st.floats(0.3, 0.6), st.integers(0, 99))
def test_wherever_a_ball_is_before_a_wall_it_is_its_own_pixels(x: float, y: float, z: float, pick: int) -> None:
    ball = draw_globe(Pose(np.eye(3), np.array([x, y, z])))
    inner = np.argwhere(cv2.erode(ball.mask.astype(np.uint8), np.ones((9, 9))) > 0)
    row, column = (int(part) for part in inner[pick * len(inner) // 100])
    for there in (Click(column, row), around(ball.mask)):
        assert overlap(segment(ball.frame, there), ball.mask) > 0.9


def test_nothing_on_the_table_is_said_so() -> None:
    empty = table(np.random.default_rng(0))
    with pytest.raises(OnboardingError, match="nothing stands on the plane"):
        segment(empty)
    with pytest.raises(OnboardingError, match="of the picture and hangs together with all around it"):
        segment(empty, Click(160, 120))
    with pytest.raises(OnboardingError, match=r"nothing stands apart in the box 100,100,150,150"):
        segment(empty, Box(100, 100, 150, 150))


def test_where_there_is_no_depth_nothing_is_found() -> None:
    frame = table()
    depth_m = frame.depth_m.copy()
    depth_m[100:140, 100:140] = 0
    holed = replace(frame, depth_m=depth_m)
    with pytest.raises(OnboardingError, match=r"no depth at pixel 120,120"):
        segment(holed, Click(120, 120))
    with pytest.raises(OnboardingError, match=r"no depth in the box 105,105,130,130"):
        segment(holed, Box(105, 105, 130, 130))
    with pytest.raises(OnboardingError, match="0 pixels have depth"):
        segment(replace(frame, depth_m=np.zeros_like(depth_m)))


def test_what_is_the_whole_picture_or_a_wall_is_not_one_thing() -> None:
    rows, columns = np.indices((240, 320))
    bulge_m = 0.5 + 4e-6 * ((rows - 120.0) ** 2 + (columns - 160.0) ** 2)
    close = Frame(np.zeros((240, 320, 3), np.uint8), bulge_m.astype(np.float32), CAMERA, 0)
    with pytest.raises(OnboardingError, match="of the picture"):
        segment(close, Click(160, 120))
    scene = open_scene("turn?size=320x240&object=mug")[0]
    with pytest.raises(OnboardingError, match=r"1\.\d m wide and not one thing"):
        segment(scene, Click(5, 5))
