"""Pictures of what the tracker does: a box and axes on every frame, in colours that tell the state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from tracker.concept import ConceptModel
from tracker.errors import OutputError
from tracker.frame import Frame
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.result import TrackResult, TrackState

Picture = npt.NDArray[np.uint8]

# RGB, told apart by colour-blind readers too (Okabe and Ito, Color Universal Design, 2008)
ESTIMATE, TRUTH, TEXT, WARNING = (213, 94, 0), (0, 158, 115), (255, 255, 255), (255, 190, 80)
AXES = ((230, 60, 60), (60, 200, 60), (80, 120, 255))
EDGES = [(i, j) for i in range(8) for j in range(i + 1, 8) if (i ^ j).bit_count() == 1]
FALLBACK_RATE_HZ = 30.0


class Viewer(Protocol):
    """Gets every frame with its results, and the true poses where there are any."""

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None: ...

    def close(self) -> None: ...


class NullViewer:
    """Shows nothing."""

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        pass

    def close(self) -> None:
        pass


class Viewers:
    """Several as one; none shows nothing."""

    def __init__(self, viewers: Sequence[Viewer]) -> None:
        self._viewers = tuple(viewers)

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        for viewer in self._viewers:
            viewer.show(frame, results, truth)

    def close(self) -> None:
        with ExitStack() as stack:  # each of them, whatever another raises
            for viewer in reversed(self._viewers):
                stack.callback(viewer.close)


class OverlayVideo:
    """Writes an mp4 of the frames with the poses drawn in: estimates orange, truth green; a line an object.

    Raises OutputError where no video can be written.
    """

    def __init__(self, path: Path, models: Sequence[ConceptModel], rate_hz: float = FALLBACK_RATE_HZ) -> None:
        self._path, self._rate_hz = path, rate_hz
        self._boxes = {model.object_id: box_corners(model.points) for model in models}
        self._video: cv2.VideoWriter | None = None

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        picture = draw_overlay(frame, results, self._boxes, truth)
        if self._video is None:
            size = (picture.shape[1], picture.shape[0])
            # MPEG-4 part 2 is the one codec that every OpenCV wheel can write without a licence question
            self._video = cv2.VideoWriter(str(self._path), cv2.VideoWriter.fourcc(*"mp4v"), self._rate_hz, size)
            if not self._video.isOpened():
                raise OutputError(f"{self._path}: this OpenCV cannot write mp4 videos")
        self._video.write(np.ascontiguousarray(picture[:, :, ::-1]))

    def close(self) -> None:
        if self._video is not None:
            self._video.release()


def box_corners(points: Floats) -> Floats:
    """(8, 3) corners of the box of points (N, 3): corner k is on the upper side of axis a if bit a of k is set."""
    low, high = points.min(axis=0), points.max(axis=0)
    bits = np.array([[k >> a & 1 for a in range(3)] for k in range(8)])
    return np.where(bits == 1, high, low)


def draw_overlay(
    frame: Frame, results: Sequence[TrackResult], boxes: Mapping[str, Floats], truth: Mapping[str, Pose]
) -> Picture:
    """(H, W, 3) uint8 RGB, the frame with boxes, axes and a line of text an object."""
    picture = np.ascontiguousarray(frame.rgb.copy())
    for object_id, T_cam_obj in truth.items():
        draw_box(picture, frame.intrinsics, T_cam_obj, boxes[object_id], TRUTH, 1)
    strip = picture[: _line_height(picture) * len(results) + 8]
    strip[:] = strip // 2  # text needs a ground
    for row, result in enumerate(results):
        corners = boxes[result.object_id]
        if result.pose is not None:
            draw_box(picture, frame.intrinsics, result.pose, corners, ESTIMATE, 2)
            _draw_axes(picture, frame.intrinsics, result.pose, 0.3 * float(np.ptp(corners, axis=0).max()))
        _write_line(picture, row, result)
    return picture


def draw_box(
    picture: Picture, camera: Intrinsics, T_cam_obj: Pose, corners: Floats, colour: tuple[int, int, int], width: int
) -> None:
    """The twelve edges of a box into an RGB picture of the camera. corners: (8, 3) as `box_corners` orders them."""
    points_cam = T_cam_obj @ corners
    for i, j in EDGES:
        _draw_line(picture, camera, points_cam[[i, j]], colour, width)


def _draw_axes(picture: Picture, camera: Intrinsics, T_cam_obj: Pose, length_m: float) -> None:
    ends = T_cam_obj @ np.vstack((np.zeros(3), length_m * np.eye(3)))
    for axis, colour in enumerate(AXES):
        _draw_line(picture, camera, ends[[0, axis + 1]], colour, 2)


def _draw_line(
    picture: Picture, camera: Intrinsics, ends_cam: Floats, colour: tuple[int, int, int], width: int
) -> None:
    if (ends_cam[:, 2] < 0.01).any():  # behind the camera there is nothing to draw
        return
    # four more bits of position than pixels, so that lines do not jitter
    (x0, y0), (x1, y1) = np.clip(camera.project(ends_cam), -1e4, 1e4).round(2) * 16
    cv2.line(picture, (int(x0), int(y0)), (int(x1), int(y1)), colour, width, cv2.LINE_AA, 4)


def _write_line(picture: Picture, row: int, result: TrackResult) -> None:
    tracking = result.state is TrackState.TRACKING
    detail = f"{result.confidence:.2f}" if tracking else result.reason
    text = f"{result.object_id}: {result.state.value} {detail}"
    height = _line_height(picture)
    place = (8, height * (row + 1))
    colour = TEXT if tracking else WARNING
    cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, height / 40, colour, 1, cv2.LINE_AA)


def _line_height(picture: Picture) -> int:
    return max(12, picture.shape[1] // 36)
