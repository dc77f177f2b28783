"""Pictures of what the tracker does: lines where the box is, and a video that can be read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from tracker.concept import ConceptModel
from tracker.errors import OutputError
from tracker.frame import Frame
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.result import TrackResult, TrackState
from tracker.viewer import EDGES, ESTIMATE, TRUTH, NullViewer, OverlayVideo, Picture, Viewers, box_corners, draw_overlay

CAMERA = Intrinsics(300.0, 310.0, 158.0, 121.5, 320, 240)
TEXT_ROWS = 30
T_CAM_OBJ = Pose.exp((0.4, -0.5, 0.3, 0.0, 0.0, 0.0)).nudged(np.array([0, 0, 0, 0.02, 0.04, 0.6]))
BOXES = {"thing": box_corners(np.array([(-0.05, -0.08, -0.03), (0.05, 0.08, 0.03)]))}


def plain(gray: int = 0, index: int = 0, camera: Intrinsics = CAMERA) -> Frame:
    size = (camera.height, camera.width)
    return Frame(np.full((*size, 3), gray, np.uint8), np.ones(size, np.float32), camera, index, {}, index)


def result(pose: Pose | None, reason: str = "", state: TrackState | None = None) -> TrackResult:
    state = state or (TrackState.LOST if pose is None else TrackState.TRACKING)
    confidence = 0.0 if pose is None else 0.87
    return TrackResult(0, "thing", pose, state, confidence, None, reason, pose, None, {"total": 1.0})


def model_of(points: Floats) -> ConceptModel:
    ones, nothing = np.ones(len(points), np.float32), np.zeros((len(points), 3), np.float32)
    return ConceptModel(
        "thing", points, points, nothing, nothing[:, :1], ones.astype(np.int32), ones, np.eye(3)[:1], 0.2, ("c",),
        "none", "none",
    )  # fmt: skip


def drawn(picture: Picture, frame: Frame) -> npt.NDArray[np.bool_]:
    """(H, W) where the picture differs from the frame, below the lines of text."""
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
    picture = draw_overlay(frame, [] if as_truth else [result(T_CAM_OBJ)], BOXES, truth)
    colour = TRUTH if as_truth else ESTIMATE
    edges = along_edges(T_CAM_OBJ, BOXES["thing"])
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
    picture = draw_overlay(plain(), [result(T_CAM_OBJ)], BOXES, {}).astype(int)
    ends = CAMERA.project(T_CAM_OBJ @ (0.3 * 0.16 * np.eye(3)))
    for channel, (x, y) in enumerate(ends.round().astype(int)):
        patch = picture[y - 2 : y + 3, x - 2 : x + 3].reshape(-1, 3)
        strongest = patch[np.argmax(patch[:, channel] - patch.sum(axis=1) / 3)]
        assert strongest.argmax() == channel


def test_nothing_behind_the_camera_is_drawn() -> None:
    frame = plain(90)
    behind = Pose(T_CAM_OBJ.rotation, T_CAM_OBJ.translation_m * (1, 1, -1))
    picture = draw_overlay(frame, [result(behind)], BOXES, {"thing": behind})
    assert not drawn(picture, frame).any()


def test_of_a_box_around_the_camera_only_the_edges_in_front_are_drawn() -> None:
    frame = plain()
    room = {"thing": box_corners(np.array([(-1.0, -1, -1), (1, 1, 1)]))}
    T_cam_room = Pose(np.eye(3), np.array([0.0, 0, 0.9]))
    picture = draw_overlay(frame, [], room, {"thing": T_cam_room})
    far = CAMERA.project(T_cam_room @ room["thing"][4:])
    assert drawn(picture, frame).any()
    columns = np.flatnonzero(drawn(picture, frame).any(axis=0))
    assert columns.min() >= max(far[:, 0].min() - 2, 0)
    assert columns.max() <= min(far[:, 0].max() + 2, 319)


@pytest.mark.parametrize("x_m", [50.0, -1e6])
def test_an_object_far_beside_the_picture_does_no_harm(x_m: float) -> None:
    frame = plain()
    beside = Pose(np.eye(3), np.array([x_m, 0, 0.5]))
    assert not drawn(draw_overlay(frame, [result(beside)], BOXES, {}), frame).any()


def test_a_lost_object_has_no_box_but_a_line_that_says_why() -> None:
    frame = plain(90)
    lost = draw_overlay(frame, [result(None, "out of view: the mask is empty")], BOXES, {})
    assert not drawn(lost, frame).any()
    other = draw_overlay(frame, [result(None, "no depth within the mask")], BOXES, {})
    assert (lost[:TEXT_ROWS] != frame.rgb[:TEXT_ROWS]).any()
    assert (lost[:TEXT_ROWS] != other[:TEXT_ROWS]).any()


def test_every_object_has_a_line_of_its_own() -> None:
    frame = plain(90)
    one = draw_overlay(frame, [result(None, "first")], BOXES, {})
    two = draw_overlay(frame, [result(None, "first"), result(None, "second")], BOXES, {})
    last_row = [int(np.flatnonzero((p > 120).any(axis=(1, 2))).max()) for p in (one, two)]
    assert last_row[1] > last_row[0] + 5


def test_the_frame_is_not_painted_on() -> None:
    frame = plain(90)
    draw_overlay(frame, [result(T_CAM_OBJ)], BOXES, {"thing": T_CAM_OBJ})
    assert (frame.rgb == 90).all()


@pytest.mark.parametrize("camera", [CAMERA, Intrinsics(150.0, 150.0, 80.0, 60.5, 161, 122)])
def test_the_video_can_be_read_back_frame_by_frame(camera: Intrinsics, tmp_path: Path) -> None:
    video = OverlayVideo(tmp_path / "a.mp4", [model_of(BOXES["thing"])], rate_hz=15)
    for index in range(6):
        frame = plain(index=index, camera=camera)
        frame.rgb[:] = (200, 30 * index, 20)  # what is red here must not be blue there
        video.show(frame, [result(T_CAM_OBJ)], {})
    video.close()
    reader = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    assert reader.get(cv2.CAP_PROP_FPS) == pytest.approx(15)
    pictures = []
    while True:
        alive, bgr = reader.read()
        if not alive:
            break
        pictures.append(bgr[:, :, ::-1].astype(int))
    assert len(pictures) == 6
    for index, picture in enumerate(pictures):
        assert picture.shape == (camera.height // 2 * 2, camera.width // 2 * 2, 3)  # the codec knows no odd sizes
        assert np.median(picture[TEXT_ROWS:], axis=(0, 1)) == pytest.approx((200, 30 * index, 20), abs=12)
    assert len(np.unique((np.abs(pictures[0] - (200, 0, 20)) > 40).any(axis=2))) == 2  # and the box is in it


def test_a_video_of_no_frames_is_no_file(tmp_path: Path) -> None:
    OverlayVideo(tmp_path / "a.mp4", [model_of(BOXES["thing"])]).close()
    assert list(tmp_path.iterdir()) == []


def test_a_video_that_cannot_be_written_is_an_error(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    video = OverlayVideo(tmp_path / "absent" / "a.mp4", [model_of(BOXES["thing"])])
    with pytest.raises(OutputError, match="cannot write"):
        video.show(plain(), [], {})
    video.close()
    capfd.readouterr()  # what the codec says of it


def test_no_viewer_is_a_viewer() -> None:
    viewer = NullViewer()
    viewer.show(plain(), [result(T_CAM_OBJ)], {})
    viewer.close()


class Noting:
    """Takes down what it is told, and cannot be closed when it is told so."""

    def __init__(self, told: list[str], name: str, fails: bool = False) -> None:
        self._told, self._name, self._fails = told, name, fails

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        self._told.append(f"{self._name} {frame.index} {len(results)} {len(truth)}")

    def close(self) -> None:
        self._told.append(f"{self._name} closed")
        if self._fails:
            raise OutputError(self._name)


def test_several_viewers_are_shown_the_same_and_closed_all_whatever_one_raises() -> None:
    told: list[str] = []
    several = Viewers([Noting(told, "a", fails=True), Noting(told, "b")])
    several.show(plain(index=3), [result(T_CAM_OBJ)], {"thing": T_CAM_OBJ})
    with pytest.raises(OutputError, match="a"):
        several.close()
    assert told == ["a 3 1 1", "b 3 1 1", "a closed", "b closed"]
    Viewers([]).show(plain(), [], {})
    Viewers([]).close()
