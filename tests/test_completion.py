"""A model grows by what the tracker is sure of, by nothing else, and has a way back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reference.completion import WATCHED, Completion, Growth
from reference.onboard import onboard
from tracker.concept import ConceptModel
from tracker.errors import ConfigError, ModelError
from tracker.frame import Frame, PosedFrame
from tracker.geometry import Pose
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult
from tracker.saliency import SaliencyBackend
from tracker.sources.synthetic import SyntheticScene, open_scene
from tracker.symmetry import about

BOX = "tea_box"


@pytest.fixture(scope="module")
def scene() -> SyntheticScene:
    """A box turns by 114 degrees."""
    return open_scene(f"turn?object={BOX}&size=320x240")


@pytest.fixture(scope="module")
def one_sided(scene: SyntheticScene, attributes: SaliencyBackend) -> ConceptModel:
    frame = scene[0]
    return onboard([PosedFrame(frame, BOX, scene.sightings(BOX)[0].T_cam_obj, frame.masks[BOX])], attributes)


@pytest.fixture(scope="module")
def followed(scene: SyntheticScene, one_sided: ConceptModel) -> list[tuple[Frame, TrackResult]]:
    tracker = ObjectTracker(one_sided)
    return [(scene[index], tracker.step(scene[index])[0]) for index in range(0, 54, 3)]


def grown(
    completion: Completion, followed: list[tuple[Frame, TrackResult]]
) -> tuple[int, ConceptModel] | tuple[None, None]:
    """At which of the frames, and how."""
    for k, (frame, result) in enumerate(followed):
        model = completion.consider(frame, result)
        if model is not None:
            return k, model
    return None, None


def test_a_side_that_comes_into_view_joins_and_is_tracked_by_what_joined(
    scene: SyntheticScene, one_sided: ConceptModel, attributes: SaliencyBackend
) -> None:
    tracker, completion = ObjectTracker(one_sided), Completion(one_sided, attributes)
    poses = []
    for index in range(0, 90, 3):
        (result,) = tracker.step(scene[index])
        model = completion.consider(scene[index], result)
        if model is not None:
            tracker.exchange(model)
        poses.append(result.pose)
    assert 3 <= len(completion.model.references) <= 7
    assert len(completion.model) > 1.3 * len(one_sided)
    truth = scene.sightings(BOX)[87].T_cam_obj
    assert poses[-1] is not None
    assert poses[-1].distance_to_m(truth) < 0.003
    assert np.degrees(poses[-1].angle_to_rad(truth)) < 3
    for reference in completion.model.references:
        there = scene.sightings(BOX)[reference.frame.index].T_cam_obj
        assert reference.T_cam_obj.distance_to_m(there) < 0.003


def test_views_are_apart_and_no_more_than_asked_for(
    one_sided: ConceptModel, attributes: SaliencyBackend, followed: list[tuple[Frame, TrackResult]]
) -> None:
    completion = Completion(one_sided, attributes)
    k, model = grown(completion, followed)
    assert k is not None
    assert k >= 5
    assert model is not None
    first, second = model.view_directions
    assert np.degrees(np.arccos(first @ second)) > 20
    assert grown(Completion(one_sided, attributes, growth=Growth(views=1)), followed) == (None, None)


def test_what_is_not_sure_teaches_nothing(
    one_sided: ConceptModel, attributes: SaliencyBackend, followed: list[tuple[Frame, TrackResult]]
) -> None:
    unsure = [(frame, replace(result, confidence=0.85)) for frame, result in followed]
    lost = [(frame, replace(result, pose=None, raw_pose=None, mask=None)) for frame, result in followed]
    for results in (unsure, lost):
        completion = Completion(one_sided, attributes)
        assert grown(completion, results) == (None, None)
        assert completion.refused == ()


def test_a_wrong_pose_contradicts_and_is_refused_with_the_reason(
    one_sided: ConceptModel, attributes: SaliencyBackend, followed: list[tuple[Frame, TrackResult]]
) -> None:
    frame, result = followed[-1]
    assert result.raw_pose is not None
    turned = result.raw_pose @ Pose(about(np.array([0.0, 0.0, 1.0]), 0.5), np.zeros(3))
    completion = Completion(one_sided, attributes)
    assert completion.consider(frame, replace(result, raw_pose=turned)) is None
    (reason,) = completion.refused
    assert f"frame {frame.index}" in reason
    assert completion.model is one_sided


@pytest.mark.parametrize(("again_deg", "refusals"), [(20, 1), (2, 2)])
def test_what_was_refused_is_tried_again_from_as_far_as_asked_for(
    again_deg: float,
    refusals: int,
    one_sided: ConceptModel,
    attributes: SaliencyBackend,
    followed: list[tuple[Frame, TrackResult]],
) -> None:
    """Two wrong poses, 4 degrees apart."""
    completion = Completion(one_sided, attributes, growth=Growth(again_rad=np.radians(again_deg)))
    for frame, result in followed[-2:]:
        assert result.raw_pose is not None
        turned = result.raw_pose @ Pose(about(np.array([0.0, 0.0, 1.0]), 0.5), np.zeros(3))
        assert completion.consider(frame, replace(result, raw_pose=turned)) is None
    assert len(completion.refused) == refusals


def test_where_poses_are_less_sure_afterwards_the_frame_is_taken_out_again(
    one_sided: ConceptModel, attributes: SaliencyBackend, followed: list[tuple[Frame, TrackResult]]
) -> None:
    for fallen, kept in ((0.5, False), (0.0, True)):
        completion = Completion(one_sided, attributes)
        k, model = grown(completion, followed)
        assert k is not None
        frame, result = followed[k]
        after = replace(result, confidence=result.confidence - fallen)
        said = [completion.consider(frame, after) for _ in range(WATCHED)]
        assert said[:-1] == [None] * (WATCHED - 1)
        assert (completion.model is model) == kept
        assert (said[-1] is one_sided) != kept
        assert len(completion.refused) == (0 if kept else 1)


def test_only_a_model_of_the_same_object_and_backend_is_exchanged(one_sided: ConceptModel) -> None:
    tracker = ObjectTracker(one_sided)
    with pytest.raises(ConfigError, match="no model of object 'cup'"):
        tracker.exchange(replace(one_sided, object_id="cup"))
    with pytest.raises(ModelError, match="another"):
        tracker.exchange(replace(one_sided, fingerprint="another"))
