"""A frame with what the tracker says of it drawn in: boxes, axes, outlines and captions.

Nothing here remembers or writes anything; `tracker.viewer` does.

The colours are those of Okabe and Ito (Color Universal Design, 2008), which colour-blind readers tell apart too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from tracker.concept import ConceptModel
from tracker.frame import Frame
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.result import TrackResult, TrackState

Picture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

ESTIMATE, TRUTH, OUTLINE = (213, 94, 0), (0, 200, 140), (255, 214, 170)  # RGB
STATES = {
    TrackState.TRACKING: (86, 180, 233),
    TrackState.INITIALISING: (240, 228, 66),
    TrackState.LOST: (204, 121, 167),
}
TEXT = (255, 255, 255)
AXES = ((235, 40, 40), (70, 225, 70), (70, 110, 255))  # x, y, z
EDGES = [(i, j) for i in range(8) for j in range(i + 1, 8) if (i ^ j).bit_count() == 1]
NEAREST_M = 0.01  # what is nearer to the camera, or behind it, is not drawn
LARGEST_GAP_PX = 15  # between points of a model that is very near


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """What is drawn of an object. corners: (8, 3) of its box, as `box_corners` orders them. points: (N, 3) of its
    surface. spacing_m: how far they are apart."""

    corners: Floats
    points: Floats
    spacing_m: float

    @classmethod
    def of(cls, points: Floats) -> Shape:
        apart_m = KDTree(points).query(points, k=2)[0][:, 1]
        return cls(box_corners(points), points, float(np.quantile(apart_m[np.isfinite(apart_m)], 0.9)))


def shapes_of(models: Sequence[ConceptModel]) -> dict[str, Shape]:
    """By object, for `draw_overlay`: made once, used for every frame."""
    return {model.object_id: Shape.of(model.points) for model in models}


def box_corners(points: Floats) -> Floats:
    """(8, 3) corners of the box of points (N, 3): corner k is on the upper side of axis a if bit a of k is set."""
    low, high = points.min(axis=0), points.max(axis=0)
    bits = np.array([[k >> a & 1 for a in range(3)] for k in range(8)])
    return np.where(bits == 1, high, low)


def draw_overlay(
    frame: Frame, results: Sequence[TrackResult], shapes: Mapping[str, Shape], truth: Mapping[str, Pose]
) -> Picture:
    """(H, W, 3) uint8 RGB: the frame; estimates orange with outline and axes, the truth green where there is one; at
    each object its name and confidence; why any other is not tracked; and how fast the tracker is."""
    picture = np.ascontiguousarray(frame.rgb.copy())
    draw_poses(picture, frame.intrinsics, results, shapes, truth)
    write_captions(picture, frame, results, shapes, legend=bool(truth))
    return picture


def draw_poses(
    picture: Picture,
    camera: Intrinsics,
    results: Sequence[TrackResult],
    shapes: Mapping[str, Shape],
    truth: Mapping[str, Pose],
) -> None:
    """Into an RGB picture of the camera: lines only."""
    thin, thick = _zoom(picture), 2 * _zoom(picture)
    for result in results:
        if result.pose is not None:
            shape = shapes[result.object_id]
            cv2.polylines(picture, outline(shape, result.pose, camera), True, OUTLINE, thin, cv2.LINE_AA)
            width = thick + thin if result.object_id in truth else thick
            draw_box(picture, camera, result.pose, shape.corners, ESTIMATE, width)
    for object_id, T_cam_obj in truth.items():  # thinner and on top, so that neither hides the other
        if object_id in shapes:
            draw_box(picture, camera, T_cam_obj, shapes[object_id].corners, TRUTH, thin)
    for result in results:
        if result.pose is not None:
            length_m = 0.3 * float(np.ptp(shapes[result.object_id].corners, axis=0).max())
            _draw_axes(picture, camera, result.pose, length_m, thick)


def draw_box(
    picture: Picture, camera: Intrinsics, T_cam_obj: Pose, corners: Floats, colour: Colour, width: int
) -> None:
    """The twelve edges of a box into an RGB picture of the camera. corners: (8, 3) as `box_corners` orders them."""
    points_cam = T_cam_obj @ corners
    _draw_lines(picture, camera, points_cam, [(i, j, colour) for i, j in EDGES], width)


def outline(shape: Shape, T_cam_obj: Pose, camera: Intrinsics) -> list[npt.NDArray[np.int32]]:
    """Closed lines (M, 1, 2) of pixels around where the points show, and around its holes; none where it is not before
    the camera, or so near that its points are far apart."""
    points_cam = T_cam_obj @ shape.points
    if (points_cam[:, 2] < NEAREST_M).any():
        return []
    gap_px = shape.spacing_m * camera.fx / float(np.median(points_cam[:, 2]))
    if gap_px > LARGEST_GAP_PX:
        return []
    edge = int(gap_px) + 3
    at = np.rint(camera.project(points_cam)).astype(np.int64)
    near = ((at >= -edge) & (at < np.array((camera.width, camera.height)) + edge)).all(axis=1)
    if not near.any():
        return []
    origin = at[near].min(axis=0) - edge
    columns, rows = (at[near] - origin).T
    shown = np.zeros((rows.max() + edge + 1, columns.max() + edge + 1), np.uint8)
    shown[rows, columns] = 1
    reach = 2 * int(np.ceil(0.75 * gap_px)) + 1
    shown = cv2.morphologyEx(shown, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach)))
    lines, _ = cv2.findContours(shown, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    least_px = max(4.0 * gap_px, 6.0) ** 2
    return [np.asarray(line + origin, np.int32) for line in lines if cv2.contourArea(line) > least_px]


def write_captions(
    picture: Picture, frame: Frame, results: Sequence[TrackResult], shapes: Mapping[str, Shape], *, legend: bool
) -> None:
    """At each object its name and confidence, at the top a line for each that has no pose, with the reason; above
    these the frame and how long the tracker took; below, what the colours mean if a legend is wanted."""
    writing = _Writing(picture)
    spent_ms = sum(result.timings_ms["total"] for result in results)
    speed = f", {spent_ms:.0f} ms, {1000 / spent_ms:.0f}/s" if spent_ms > 0 else ""
    writing.left(f"frame {frame.index}{speed}", 0, None)
    missing = [result for result in results if result.pose is None]
    for row, result in enumerate(missing, start=1):
        writing.left(f"{result.object_id}: {result.state.value}, {result.reason}", row, STATES[result.state])
    if legend:
        writing.below((("estimate", ESTIMATE), ("truth", TRUTH)))
    for result in results:
        if result.pose is None:
            continue
        corners_cam = result.pose @ shapes[result.object_id].corners
        if (corners_cam[:, 2] >= NEAREST_M).all():
            top = frame.intrinsics.project(corners_cam)
            text = f"{result.object_id} {result.confidence:.2f}"
            writing.at((float(top[:, 0].mean()), float(top[:, 1].min())), text, STATES[result.state])


class _Writing:
    """Text on dark ground, none over another."""

    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self._height, self._width = picture.shape[:2]
        self._line_px = max(12, round(self._width / 40))
        self._scale = self._line_px / 38
        self._taken: list[tuple[int, int, int, int]] = []

    def left(self, text: str, row: int, colour: Colour | None) -> None:
        self._write(text, 0, row * self._line_px, colour)

    def below(self, entries: Sequence[tuple[str, Colour]]) -> None:
        left = 0
        for text, colour in entries:
            left += self._write(text, left, self._height - self._line_px, colour)

    def at(self, place: tuple[float, float], text: str, colour: Colour) -> None:
        """Above a place of the picture, or below what is written there already. Nothing where it is not in view."""
        width = self._extent(text, colour)
        x, y = place
        if not (-width < x < self._width + width and -self._line_px < y < self._height + self._line_px):
            return
        left = int(np.clip(x - width / 2, 0, max(self._width - width, 0)))
        start = int(np.clip(y - self._line_px - 2, 0, self._height - self._line_px))
        for row in range(self._height // self._line_px):
            for top in (start - row * self._line_px, start + row * self._line_px):
                if 0 <= top <= self._height - self._line_px and self._free(left, top, width):
                    self._write(text, left, top, colour)
                    return

    def _free(self, left: int, top: int, width: int) -> bool:
        right, bottom = left + width, top + self._line_px
        return not any(left < r and right > x and top < b and bottom > y for x, y, r, b in self._taken)

    def _extent(self, text: str, colour: Colour | None) -> int:
        written_px = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, self._scale, 1)[0][0]
        return written_px + 8 + (self._line_px if colour else 0)

    def _write(self, text: str, left: int, top: int, colour: Colour | None) -> int:
        """The pixels that it takes, which are no more than there are. colour: of a square before the text."""
        while len(text) > 3 and self._extent(text, colour) > self._width:
            text = f"{text[:-3]}.."
        width, line_px = self._extent(text, colour), self._line_px
        left = max(0, min(left, self._width - width))
        ground = self._picture[top : top + line_px, left : left + width]
        ground[:] = ground // 3
        self._taken.append((left, top, left + width, top + line_px))
        start = left + 4
        if colour:
            side = line_px // 2
            corner = start, top + (line_px - side) // 2
            cv2.rectangle(self._picture, corner, (corner[0] + side, corner[1] + side), colour, -1)
            start += line_px - 2
        place = (start, top + round(0.74 * line_px))
        cv2.putText(self._picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, self._scale, TEXT, 1, cv2.LINE_AA)
        return width


def _draw_axes(picture: Picture, camera: Intrinsics, T_cam_obj: Pose, length_m: float, width: int) -> None:
    ends_cam = T_cam_obj @ np.vstack((np.zeros(3), length_m * np.eye(3)))
    _draw_lines(picture, camera, ends_cam, [(0, axis + 1, colour) for axis, colour in enumerate(AXES)], width)


def _draw_lines(
    picture: Picture, camera: Intrinsics, ends_cam: Floats, lines: Sequence[tuple[int, int, Colour]], width: int
) -> None:
    """lines: from which of the ends (N, 3) to which."""
    before = ends_cam[:, 2] >= NEAREST_M
    in_front = np.where(before[:, None], ends_cam, (0.0, 0.0, 1.0))
    # four more bits of position than pixels, so that lines do not jitter
    ends = np.rint(np.clip(camera.project(in_front), -1e4, 1e4) * 16).astype(int).tolist()
    for i, j, colour in lines:
        if before[i] and before[j]:
            cv2.line(picture, ends[i], ends[j], colour, width, cv2.LINE_AA, 4)


def _zoom(picture: Picture) -> int:
    """Thickness of a thin line."""
    return max(1, round(picture.shape[1] / 800))
