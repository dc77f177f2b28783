"""A picture of why an object was not found in a frame: where it was looked for, and what was found there instead."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from eval.plates.cutout import corners_of, cut_out, pixels_of
from reference.sheet import FAINT, INK, Picture, Sheet, fitted, line_px
from tracker.config import TrackerConfig
from tracker.found import Attempt, Found, Look
from tracker.frame import Frame
from tracker.overlay import ESTIMATE, Shape, draw_box, outline
from tracker.result import TrackResult

LOOKED, EXPECTED, TRIED = (0, 114, 178), (240, 228, 66), ESTIMATE  # RGB, of Okabe and Ito
COLUMNS, ROWS = 2, 3
MARGIN_PX = 12
SAME_RAD, SAME_SHARE = 0.05, 0.03  # poses nearer than this are shown once


def failure_plate(
    frame: Frame, result: TrackResult, attempt: Attempt, shape: Shape, config: TrackerConfig, width: int
) -> Picture:
    """(H, width, 3) uint8 RGB: on the left the frame with the pixels where the object was looked for and the pose where
    it was expected; on the right the likeliest poses that were tried, with what spoke for each; below, the verdict."""
    line = line_px(width)
    half = (width - 3 * MARGIN_PX) // 2
    cell_width, cell_height = half // COLUMNS, half // COLUMNS * 3 // 4 + line
    top = MARGIN_PX + 2 * line
    below = top + ROWS * cell_height + line
    said = [f"{result.state.value}: {result.reason}", *_asked(result, attempt, config)]
    sheet = Sheet(width, below + (len(said) + 1) * line + MARGIN_PX)
    sheet.write(f"{result.object_id}, frame {frame.index}, {frame.provenance.source}", MARGIN_PX, MARGIN_PX)
    whole = fitted(_where(frame, attempt, shape), half, ROWS * cell_height - 3 * line)
    sheet.put(whole, MARGIN_PX, top)
    row = sheet.write("blue: where it was looked for", MARGIN_PX, top + whole.shape[0] + 4, LOOKED, half)
    if any(isinstance(look, Look) and look.start for look in attempt.looks):
        row = sheet.write("yellow: the pose where it was expected", MARGIN_PX, row, FAINT, half)
    left = 2 * MARGIN_PX + half
    tried = _distinct(attempt.tried, float(np.ptp(shape.corners, axis=0).max()))
    if not tried:
        sheet.write("no pose was found to judge", left, top, FAINT)
    for k, found in enumerate(tried[: COLUMNS * ROWS]):
        x, y = left + k % COLUMNS * cell_width, top + k // COLUMNS * cell_height
        sheet.put(_candidate(frame, found, shape, cell_width - 6, cell_height - line - 4), x, y)
        evidence = found.hypothesis.evidence
        text = f"{found.confidence:.0%} likely, score {evidence.score:.2f}, by {found.hypothesis.origin}"
        if width < 1000:
            text = f"{found.confidence:.0%}, score {evidence.score:.2f}"
        sheet.write(text, x, y + cell_height - line - 2, INK, 2 * width)
    for text in said:
        below = sheet.write(text, MARGIN_PX, below)
    return sheet.rgb


def _asked(result: TrackResult, attempt: Attempt, config: TrackerConfig) -> list[str]:
    """What it takes to be believed, and why there was nowhere to look."""
    asked = [f"a pose has to be {config.believe:.0%} likely"]
    if config.masks == "carried":
        first = f"{config.regain:.0%} where it was lost, {config.sure:.0%} where nothing was expected"
        asked = [f"{asked[0]} where it is followed, {first}"]
    reasons = dict.fromkeys(look for look in attempt.looks if isinstance(look, str) and look != result.reason)
    return asked + [f"also: {reason}" for reason in reasons]


def _where(frame: Frame, attempt: Attempt, shape: Shape) -> Picture:
    picture = frame.rgb.copy()
    looks = [look for look in attempt.looks if isinstance(look, Look)]
    masks = [look.mask for look in looks] or [found.hypothesis.view.mask for found in attempt.tried]
    for mask in masks[:1]:
        picture[mask] = (picture[mask] * 0.6 + np.array(LOOKED) * 0.4).astype(np.uint8)
    for mask in masks:
        lines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        cv2.drawContours(picture, lines, -1, LOOKED, 2, cv2.LINE_AA)
    starts = [look.start for look in looks if look.start is not None]
    for k, start in enumerate(starts):
        draw_box(picture, frame.intrinsics, start, shape.corners, EXPECTED, 1 if k else 2)
    return picture


def _candidate(frame: Frame, found: Found, shape: Shape, width: int, height: int) -> Picture:
    pose = found.hypothesis.refined.T_cam_obj
    around = np.vstack((corners_of(found.hypothesis.view.mask), pixels_of(pose, shape.corners, frame.intrinsics)))
    cutout = cut_out(frame, around, width, height)
    lines, _ = cv2.findContours(found.hypothesis.view.mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    for line in lines:
        cv2.polylines(
            cutout.rgb,
            [np.rint(cutout.at(np.asarray(line[:, 0], float))).astype(np.int32)],
            True,
            LOOKED,
            1,
            cv2.LINE_AA,
        )
    cv2.polylines(cutout.rgb, outline(shape, pose, cutout.camera), True, TRIED, 1, cv2.LINE_AA)
    draw_box(cutout.rgb, cutout.camera, pose, shape.corners, TRIED, 2)
    return cutout.rgb


def _distinct(tried: Sequence[Found], size_m: float) -> list[Found]:
    """The likeliest first, each pose once."""
    kept: list[Found] = []
    for found in sorted(tried, key=lambda found: (-found.confidence, -found.score)):
        pose = found.hypothesis.refined.T_cam_obj
        others = (other.hypothesis.refined.T_cam_obj for other in kept)
        if not any(pose.angle_to_rad(o) < SAME_RAD and pose.distance_to_m(o) < SAME_SHARE * size_m for o in others):
            kept.append(found)
    return kept
