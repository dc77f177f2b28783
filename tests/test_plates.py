"""Plates of a frame: what was right is told from what was wrong, and what was tried is shown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eval.plates.cutout import corners_of, cut_out
from eval.plates.failure import EXPECTED, LOOKED, TRIED, failure_plate
from eval.plates.matches import INLIER, OUTLIER, match_plate
from reference.sheet import Picture
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import FrameError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.overlay import Shape
from tracker.pipeline import ObjectTracker
from tracker.saliency import SaliencyBackend


def marked(picture: Picture, colour: tuple[int, int, int]) -> int:
    return int((picture == colour).all(axis=2).sum())


def test_a_cutout_and_its_camera_belong_together(can_frames: list[Frame]) -> None:
    frame = can_frames[0]
    name = "soup_can"
    cutout = cut_out(frame, corners_of(frame.masks[name]), 300, 200)
    assert cutout.rgb.shape == (200, 300, 3)
    points_cam = np.array([(0.01, 0.02, 0.6), (-0.05, 0.0, 0.8)])
    pixels = frame.intrinsics.project(points_cam)
    assert np.allclose(cutout.at(pixels), cutout.camera.project(points_cam))
    x, y = np.argwhere(frame.masks[name]).mean(axis=0).round().astype(int)[::-1]
    column, row = cutout.at(np.array([(x, y)], float))[0].round().astype(int)
    assert np.abs(cutout.rgb[row, column].astype(int) - frame.rgb[y, x]).max() < 60


@pytest.mark.parametrize("width", [640, 1200])
def test_most_matches_are_right_at_the_true_pose_and_wrong_elsewhere(
    width: int, can_frames: list[Frame], can_model: ConceptModel, can_truth: Pose, attributes: SaliencyBackend
) -> None:
    frame, name, truth = can_frames[0], can_model.object_id, can_truth
    there = match_plate(frame, frame.masks[name], truth, can_model, attributes, TrackerConfig(), width)
    aside = truth.nudged(np.array([0, 0, 0, 0.05, 0, 0]))
    elsewhere = match_plate(frame, frame.masks[name], aside, can_model, attributes, TrackerConfig(), width)
    assert there.shape[1] == width
    assert marked(there, INLIER) > marked(there, OUTLIER)
    assert marked(elsewhere, INLIER) < marked(elsewhere, OUTLIER)


def test_without_a_reference_view_there_are_no_matches_to_show(
    can_frames: list[Frame], can_model: ConceptModel, attributes: SaliencyBackend
) -> None:
    bare, frame = replace(can_model, references=()), can_frames[0]
    with pytest.raises(FrameError, match="reference"):
        match_plate(frame, frame.masks[bare.object_id], Pose.identity(), bare, attributes, TrackerConfig(), 640)


def test_a_failure_shows_where_it_was_looked_for_and_what_was_tried(
    can_frames: list[Frame], can_model: ConceptModel
) -> None:
    config = TrackerConfig(believe=1.0)  # nothing is sure enough
    tracker = ObjectTracker(can_model, config)
    frame, shape = can_frames[0], Shape.of(can_model.points)
    (result,) = tracker.step(frame)
    attempt = tracker.attempt(can_model.object_id)
    assert result.pose is None
    assert attempt.tried
    picture = failure_plate(frame, result, attempt, shape, config, 900)
    assert marked(picture, LOOKED) > 120
    assert marked(picture, TRIED) > 200
    assert marked(picture, EXPECTED) == 0  # nobody knew where it was
    nothing = failure_plate(frame, result, replace(attempt, tried=()), shape, config, 900)
    assert marked(nothing, TRIED) == 0


def test_what_was_tried_is_of_the_last_frame_alone(can_frames: list[Frame], can_model: ConceptModel) -> None:
    tracker = ObjectTracker(can_model, TrackerConfig(prior=False))
    counts = []
    for frame in can_frames[:3]:
        tracker.step(frame)
        counts.append(len(tracker.attempt(can_model.object_id).tried))
    assert min(counts) > 0
    assert max(counts) < sum(counts) / 2


def test_a_failure_without_anywhere_to_look_says_so(can_frames: list[Frame], can_model: ConceptModel) -> None:
    tracker = ObjectTracker(can_model)
    frame: Frame = replace(can_frames[0], masks={})
    (result,) = tracker.step(frame)
    picture = failure_plate(
        frame, result, tracker.attempt(can_model.object_id), Shape.of(can_model.points), TrackerConfig(), 640
    )
    assert marked(picture, LOOKED) < 100  # the legend alone
