"""Overlays of the worst frames: what was estimated beside what is true, cut out around the object."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from eval.answers import best_estimates
from eval.bop_results import Estimate
from eval.datasets import Dataset
from eval.instances import InstanceError
from eval.worst_frames import worst_instances
from tracker.errors import FrameError, TrackerError
from tracker.frame import Frame
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.overlay import Picture, box_corners, draw_box

log = logging.getLogger(__name__)

ESTIMATE, TRUTH = (215, 30, 30), (60, 220, 90)  # RGB, a dark red and a light green: not hue alone tells them apart
SIZE = (320, 240)  # pixels of a cutout
LARGEST_BYTES = 25_000
MARGIN = 1.3  # of the box around both poses
FARTHEST = 3.0  # an estimate is followed up to so many sizes of the object; farther off, the cutout would show nothing


@dataclass(frozen=True, slots=True)
class WorstFrame:
    """row: the instance and its errors. jpeg: its cutout, None where it could not be made, and then `why_not`."""

    row: InstanceError
    score: float
    jpeg: bytes | None
    why_not: str = ""


def worst_frames(
    dataset: Dataset, rows: Sequence[InstanceError], estimates: Iterable[Estimate]
) -> tuple[WorstFrame, ...]:
    """The worst instances that have a pose, each with its cutout. Reads only the images of these.

    An image that cannot be read is no reason to have no report: its entry says why it has no picture.
    """
    best, _ = best_estimates(estimates)
    worst = worst_instances(rows)
    targets = {
        (scene_id, t.object_id, t.image_id): t
        for scene_id in {row.scene_id for row in worst}
        for t in dataset.targets(scene_id)
    }
    found = []
    for row in worst:
        answer = best.get((row.scene_id, row.image_id, dataset.number(row.object_id)))
        if answer is None:  # of a query of several pairs, nobody says which pose the row is of
            continue
        target = targets[row.scene_id, row.object_id, row.image_id]
        try:
            frame = dataset.scene(row.scene_id)[target.index]
            corners = box_corners(dataset.model(row.object_id).points_m)
            cutout = draw_cutout(frame, answer.T_cam_obj, target.T_cam_obj, corners)
            found.append(WorstFrame(row, answer.score, jpeg(cutout)))
        except TrackerError as error:
            log.warning("no picture of scene %d, image %d: %s", row.scene_id, row.image_id, error)
            found.append(WorstFrame(row, answer.score, None, str(error)))
    return tuple(found)


def draw_cutout(frame: Frame, estimated: Pose, truth: Pose, corners: Floats) -> Picture:
    """(240, 320, 3) uint8 RGB around the object: the true pose's box green, the estimate's red.

    corners: (8, 3) of the object's box, as `tracker.overlay.box_corners` has them. Raises FrameError where the true
    pose is behind the camera.
    """
    camera = frame.intrinsics
    left, top, scale = _window(_pixels(camera, truth, corners), _pixels(camera, estimated, corners))
    width, height = SIZE
    shift = np.array([[scale, 0, -scale * left], [0, scale, -scale * top]])
    picture = np.asarray(cv2.warpAffine(frame.rgb, shift, SIZE, borderValue=(90, 90, 90)), np.uint8)
    centre = scale * (camera.cx - left), scale * (camera.cy - top)
    # drawn after enlarging, so that lines are as sharp in a small object's cutout as in a large one's
    seen = Intrinsics(camera.fx * scale, camera.fy * scale, *centre, width, height)
    draw_box(picture, seen, estimated, corners, ESTIMATE, 2)
    draw_box(picture, seen, truth, corners, TRUTH, 2)
    return picture


def jpeg(picture: Picture, largest_bytes: int = LARGEST_BYTES) -> bytes:
    """Of the best quality that fits."""
    bgr = np.ascontiguousarray(picture[:, :, ::-1])
    encoded = b""
    for quality in (88, 75, 60, 45, 30, 15):
        _, written = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
        encoded = written.tobytes()
        if len(encoded) <= largest_bytes:
            break
    return encoded


def _pixels(camera: Intrinsics, T_cam_obj: Pose, corners: Floats) -> Floats:
    """(N, 2) of the corners before the camera."""
    points_cam = T_cam_obj @ corners
    return camera.project(points_cam[points_cam[:, 2] > 0.01])


def _window(truth: Floats, estimated: Floats) -> tuple[float, float, float]:
    """Left and upper edge in pixels of the image, and pixels of the cutout in one of the image."""
    if not len(truth):
        raise FrameError("the true pose is behind the camera, so there is nothing to cut out")
    low, high = truth.min(axis=0), truth.max(axis=0)
    reach = FARTHEST * (high - low).max()
    near = estimated[(np.abs(estimated - (low + high) / 2) < reach).all(axis=1)]
    both = np.vstack((truth, near))
    low, high = both.min(axis=0), both.max(axis=0)
    size = MARGIN * np.maximum(high - low, 16)
    scale = float(min(SIZE[0] / size[0], SIZE[1] / size[1]))
    left, top = (low + high) / 2 - np.array(SIZE) / scale / 2
    return float(left), float(top), scale
