"""What is drawn into a frame: lines where box, axes and outline are, and captions that say the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from tracker.frame import Frame
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.overlay import (
    EDGES,
    ESTIMATE,
    STATES,
    TRUTH,
    Picture,
    Shape,
    box_corners,
    draw_overlay,
    draw_poses,
    outline,
)
from tracker.result import TrackResult, TrackState

CAMERA = Intrinsics(300.0, 310.0, 158.0, 121.5, 320, 240)
TEXT_ROWS = 2 * 12  # at this size: the frame, and one object
T_CAM_OBJ = Pose.exp((0.4, -0.5, 0.3, 0.0, 0.0, 0.0)).nudged(np.array([0, 0, 0, 0.02, 0.04, 0.6]))
HALF_M = np.array((0.05, 0.08, 0.03))
SHAPES = {"thing": Shape(box_corners(np.array([-HALF_M, HALF_M])), np.zeros((1, 3)), 0.001)}  # with no outline to see


def plain(gray: int = 0, index: int = 0, camera: Intrinsics = CAMERA) -> Frame:
    size = (camera.height, camera.width)
    return Frame(np.full((*size, 3), gray, np.uint8), np.ones(size, np.float32), camera, index, {}, index)


def result(pose: Pose | None, reason: str = "", state: TrackState | None = None) -> TrackResult:
    state = state or (TrackState.LOST if pose is None else TrackState.TRACKING)
    confidence = 0.0 if pose is None else 0.87
    return TrackResult(0, "thing", pose, state, confidence, None, reason, pose, None, {"total": 1.0})


def lines_of(
    frame: Frame, results: Sequence[TrackResult], shapes: Mapping[str, Shape], truth: Mapping[str, Pose]
) -> Picture:
    """The frame with lines, without captions."""
    picture = frame.rgb.copy()
    draw_poses(picture, frame.intrinsics, results, shapes, truth)
    return picture


def solid_box(step_m: float = 0.003) -> Shape:
    """The surface of the box."""
    axes = [np.arange(-h, h + step_m / 2, step_m) for h in HALF_M]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return Shape.of(points[(np.abs(points) > HALF_M - step_m / 2).any(axis=1)])


def drawn(picture: Picture, frame: Frame) -> npt.NDArray[np.bool_]:
    """(H, W) where the picture differs from the frame, below the lines of text at the top."""
    changed = (picture != frame.rgb).any(axis=2)
    changed[:TEXT_ROWS] = False
    return changed


def along_edges(T_cam_obj: Pose, corners: Floats) -> Floats:
    """(12, 50, 2) pixels along the projected edges of a box."""
    ends = CAMERA.project(T_cam_obj @ corners)
    share = np.linspace(0, 1, 50)[:, None]
    return np.stack([ends[i] * (1 - share) + ends[j] * share for i, j in EDGES])


def distance_px(pixels: Floats, marked: npt.NDArray[np.bool_]) -> Floats:
    """(...) from each pixel (x, y) to the nearest marked one."""
    to_marked = cv2.distanceTransform((~marked).astype(np.uint8), cv2.DIST_L2, 5)
    columns, rows = np.moveaxis(pixels.round().astype(int), -1, 0)
    return np.asarray(to_marked[rows, columns], float)


def test_corners_of_a_box_are_told_by_bits() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3))
    corners = box_corners(points)
    for k in range(8):
        for axis in range(3):
            expected = points[:, axis].max() if k >> axis & 1 else points[:, axis].min()
            assert corners[k, axis] == expected
    assert len(EDGES) == 12
    assert all(np.count_nonzero(corners[i] != corners[j]) == 1 for i, j in EDGES)


@pytest.mark.parametrize("as_truth", [False, True])
def test_the_box_is_drawn_along_its_projected_edges_and_nowhere_else(as_truth: bool) -> None:
    frame = plain()
    truth: Mapping[str, Pose] = {"thing": T_CAM_OBJ} if as_truth else {}
    picture = lines_of(frame, [] if as_truth else [result(T_CAM_OBJ)], SHAPES, truth)
    colour = TRUTH if as_truth else ESTIMATE
    edges = along_edges(T_CAM_OBJ, SHAPES["thing"].corners)
    marked = np.asarray((np.abs(picture.astype(int) - colour) < 40).all(axis=2), bool)
    covered = distance_px(edges, marked) < 1.5
    assert covered.mean(axis=1).min() > 0.8  # the axes lie over a piece of an edge
    near = np.zeros(marked.shape, bool)
    columns, rows = edges.reshape(-1, 2).round().astype(int).T
    near[rows, columns] = True
    if not as_truth:
        axes = CAMERA.project(T_CAM_OBJ @ np.vstack((np.zeros((1, 3)), 0.3 * 0.16 * np.eye(3))))
        share = np.linspace(0, 1, 100)[:, None]
        for end in axes[1:]:
            columns, rows = (axes[0] * (1 - share) + end * share).round().astype(int).T
            near[rows, columns] = True
    painted = np.argwhere(drawn(picture, frame))[:, ::-1].astype(float)
    assert distance_px(painted, near).max() < 4


def test_the_axes_are_red_green_and_blue_along_x_y_and_z() -> None:
    picture = lines_of(plain(), [result(T_CAM_OBJ)], SHAPES, {}).astype(int)
    ends = CAMERA.project(T_CAM_OBJ @ (0.3 * 0.16 * np.eye(3)))
    for channel, (x, y) in enumerate(ends.round().astype(int)):
        patch = picture[y - 2 : y + 3, x - 2 : x + 3].reshape(-1, 3)
        strongest = patch[np.argmax(patch[:, channel] - patch.sum(axis=1) / 3)]
        assert strongest.argmax() == channel


def test_nothing_behind_the_camera_is_drawn() -> None:
    frame = plain(90)
    behind = Pose(T_CAM_OBJ.rotation, T_CAM_OBJ.translation_m * (1, 1, -1))
    picture = lines_of(frame, [result(behind)], SHAPES, {"thing": behind})
    assert not drawn(picture, frame).any()


def test_of_a_box_around_the_camera_only_the_edges_in_front_are_drawn() -> None:
    frame = plain()
    corners = box_corners(np.array([(-1.0, -1, -1), (1, 1, 1)]))
    room = {"thing": Shape(corners, corners, 2.0)}
    T_cam_room = Pose(np.eye(3), np.array([0.0, 0, 0.9]))
    picture = lines_of(frame, [], room, {"thing": T_cam_room})
    far = CAMERA.project(T_cam_room @ corners[4:])
    assert drawn(picture, frame).any()
    columns = np.flatnonzero(drawn(picture, frame).any(axis=0))
    assert columns.min() >= max(far[:, 0].min() - 2, 0)
    assert columns.max() <= min(far[:, 0].max() + 2, 319)


@pytest.mark.parametrize("x_m", [50.0, -1e6])
def test_an_object_far_beside_the_picture_does_no_harm(x_m: float) -> None:
    frame = plain()
    beside = Pose(np.eye(3), np.array([x_m, 0, 0.5]))
    assert not drawn(draw_overlay(frame, [result(beside)], SHAPES, {}), frame).any()


def test_a_lost_object_has_no_box_but_a_line_that_says_why() -> None:
    frame = plain(90)
    lost = draw_overlay(frame, [result(None, "out of view: the mask is empty")], SHAPES, {})
    assert not drawn(lost, frame).any()
    other = draw_overlay(frame, [result(None, "no depth within the mask")], SHAPES, {})
    assert (lost[:TEXT_ROWS] != frame.rgb[:TEXT_ROWS]).any()
    assert (lost[:TEXT_ROWS] != other[:TEXT_ROWS]).any()


def test_every_object_without_a_pose_has_a_line_of_its_own() -> None:
    frame = plain(90)
    one = draw_overlay(frame, [result(None, "first")], SHAPES, {})
    two = draw_overlay(frame, [result(None, "first"), result(None, "second")], SHAPES, {})
    last_row = [int(np.flatnonzero((p > 120).any(axis=(1, 2))).max()) for p in (one, two)]
    assert last_row[1] > last_row[0] + 5


def test_a_reason_that_is_too_long_for_the_picture_is_cut_short() -> None:
    frame = plain(90)
    long = draw_overlay(frame, [result(None, "a long reason " * 20)], SHAPES, {})
    assert (long[TEXT_ROWS:] == 90).all()
    assert (long[12:TEXT_ROWS, -8:] < 90).any()  # its ground reaches to the edge


def marked_with(picture: Picture, colour: tuple[int, int, int]) -> npt.NDArray[np.bool_]:
    """(H, W)."""
    return np.asarray((np.abs(picture.astype(int) - colour) < 12).all(axis=2), bool)


@pytest.mark.parametrize("state", [TrackState.INITIALISING, TrackState.LOST])
def test_the_colour_of_a_caption_tells_the_state(state: TrackState) -> None:
    picture = draw_overlay(plain(), [result(None, "why", state)], SHAPES, {})
    assert [s for s in TrackState if marked_with(picture, STATES[s]).sum() > 20] == [state]


def test_captions_of_objects_at_one_place_do_not_cover_each_other() -> None:
    frame = plain(90)
    names = [f"thing_{k}" for k in range(4)]
    shapes = dict.fromkeys(names, SHAPES["thing"])
    results = [replace(result(T_CAM_OBJ), object_id=name) for name in names]
    with_lines = lines_of(frame, results, shapes, {})
    captions = draw_overlay(frame, results, shapes, {})
    swatches = marked_with(captions, STATES[TrackState.TRACKING]) & ~marked_with(
        with_lines, STATES[TrackState.TRACKING]
    )
    count, _, stats, _ = cv2.connectedComponentsWithStats(swatches.astype(np.uint8))
    assert count - 1 == 4
    assert np.ptp(stats[1:, cv2.CC_STAT_AREA]) <= 2  # each is whole


def test_the_colours_are_explained_where_there_is_a_truth() -> None:
    lines = lines_of(plain(90), [], SHAPES, {"thing": T_CAM_OBJ})
    picture = draw_overlay(plain(90), [], SHAPES, {"thing": T_CAM_OBJ})
    assert marked_with(picture, TRUTH)[-12:].sum() > marked_with(lines, TRUTH)[-12:].sum() + 20
    assert not marked_with(draw_overlay(plain(90), [], SHAPES, {}), TRUTH).any()


def test_the_outline_runs_around_what_the_points_show() -> None:
    shape = solid_box()
    lines = outline(shape, T_CAM_OBJ, CAMERA)
    hull = cv2.convexHull(np.asarray(CAMERA.project(T_CAM_OBJ @ shape.corners), np.float32))
    assert len(lines) == 1
    off_px = [abs(cv2.pointPolygonTest(hull, tuple(map(float, p)), True)) for p in lines[0][:, 0]]
    assert max(off_px) < 3
    assert abs(cv2.contourArea(lines[0]) / cv2.contourArea(hull) - 1) < 0.05


def test_the_outline_has_the_holes_of_an_object() -> None:
    angle_rad = np.linspace(0, 2 * np.pi, 150, endpoint=False)
    radius_m = np.arange(0.05, 0.0801, 0.003)
    ring = np.stack(np.broadcast_arrays(
        radius_m[:, None] * np.cos(angle_rad), radius_m[:, None] * np.sin(angle_rad), 0.0
    ), axis=-1).reshape(-1, 3)  # fmt: skip
    lines = outline(Shape.of(ring), Pose(np.eye(3), np.array((0.0, 0, 0.6))), CAMERA)
    reach_px = sorted(float(np.sqrt(cv2.contourArea(line) / np.pi)) for line in lines)
    assert reach_px == pytest.approx([0.05 * 305 / 0.6, 0.08 * 305 / 0.6], abs=2)


@pytest.mark.parametrize("z_m", [-0.5, 0.02, 0.1])
def test_of_an_object_that_is_too_near_or_behind_there_is_no_outline(z_m: float) -> None:
    assert outline(solid_box(0.01), Pose(np.eye(3), np.array((0.0, 0, z_m))), CAMERA) == []


def test_the_frame_is_not_painted_on() -> None:
    frame = plain(90)
    draw_overlay(frame, [result(T_CAM_OBJ)], SHAPES, {"thing": T_CAM_OBJ})
    assert (frame.rgb == 90).all()
