"""Models of frames whose poses nobody knows: the object frame, poses that are found, and frames that do not belong."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from reference import onboard_unposed, read_unposed_frames
from reference.growing import MOST_DENIED, GrowingModel, Registration
from reference.onboard import onboard, surface_of
from tracker.cloud import CloudConfig
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import OnboardingError
from tracker.frame import Frame, Mask, PosedFrame
from tracker.geometry import Pose
from tracker.pipeline import ObjectTracker
from tracker.saliency import SaliencyBackend
from tracker.sources.synthetic import SyntheticScene, open_scene
from tracker.view import ViewConfig

Given = list[tuple[Frame, Mask]]


@pytest.fixture(scope="module")
def mug_scene() -> SyntheticScene:
    return open_scene("turn?size=320x240&object=mug")


def given(scene: SyntheticScene, object_id: str, *indices: int) -> Given:
    frames = [scene[index] for index in indices]
    return [(frame, frame.masks[object_id]) for frame in frames]


@pytest.fixture(scope="module")
def can_given(can_scene: SyntheticScene) -> Given:
    return given(can_scene, "soup_can", 44, 60, 52)


@pytest.fixture(scope="module")
def can_unposed(can_given: Given, attributes: SaliencyBackend) -> ConceptModel:
    return onboard_unposed(can_given, "soup_can", attributes)


def assert_found(model: ConceptModel, scene: SyntheticScene) -> None:
    """Poses of the references, relative to the first one's, as they are in truth."""
    truth = {s.index: s.T_cam_obj for s in scene.sightings(model.object_id)}
    first = model.references[0]
    T_true_obj = truth[first.frame.index].inverse() @ first.T_cam_obj
    for reference in model.references[1:]:
        expected = truth[reference.frame.index] @ T_true_obj
        assert reference.T_cam_obj.distance_to_m(expected) < 0.003
        assert np.degrees(reference.T_cam_obj.angle_to_rad(expected)) < 3


def registration(backend: SaliencyBackend, least_confidence: float = 0.98) -> Registration:
    return Registration(backend, TrackerConfig(prior=False), None, None, least_confidence)


def posed(scene: SyntheticScene, object_id: str, index: int, motion: tuple[float, ...] = (0.0,) * 6) -> PosedFrame:
    """At its true pose, or moved from it."""
    frame, pose = scene[index], scene.sightings(object_id)[index].T_cam_obj
    return PosedFrame(frame, object_id, pose.nudged(np.array(motion)), frame.masks[object_id])


# One frame


def test_in_the_one_frame_the_object_is_at_its_centre_with_the_camera_s_axes(
    can_given: Given, attributes: SaliencyBackend
) -> None:
    (frame, mask), *_ = can_given
    model = onboard_unposed(can_given[:1], "soup_can", attributes)
    (reference,) = model.references
    points_cam = surface_of(PosedFrame(frame, "soup_can", Pose.identity(), mask), ViewConfig(), CloudConfig())
    assert np.array_equal(reference.T_cam_obj.rotation, np.eye(3))
    assert np.allclose(reference.T_cam_obj.translation_m, points_cam.mean(axis=0))
    assert np.linalg.norm(model.points.mean(axis=0)) < 0.01
    assert model.notes["object_frame"] == "centre of what the first reference frame shows, camera axes"
    (result,) = ObjectTracker(model, TrackerConfig(prior=False), attributes).step(frame)
    assert result.pose is not None
    assert result.pose.distance_to_m(reference.T_cam_obj) < 0.001
    assert np.degrees(result.pose.angle_to_rad(reference.T_cam_obj)) < 1


def test_one_frame_makes_the_model_that_it_makes_with_its_pose_known(
    can_scene: SyntheticScene, can_given: Given, attributes: SaliencyBackend
) -> None:
    reference = posed(can_scene, "soup_can", 44)
    known = onboard([reference], attributes)
    told = onboard_unposed(can_given[:1], "soup_can", attributes, T_cam_obj=reference.T_cam_obj)
    assert np.array_equal(told.points, known.points)
    assert np.array_equal(told.saliency, known.saliency)
    assert told.notes["object_frame"] == "as given in the first reference frame"


# Several frames


def test_frames_of_a_can_are_joined_where_they_belong(can_unposed: ConceptModel, can_scene: SyntheticScene) -> None:
    assert {reference.frame.index for reference in can_unposed.references} == {44, 52, 60}
    assert_found(can_unposed, can_scene)
    assert can_unposed.notes["left_out"] == []
    assert can_unposed.notes == json.loads(json.dumps(can_unposed.notes))
    assert len(can_unposed.notes["reference_frames"]) == 3


def test_frames_of_a_mug_are_joined_where_they_belong(mug_scene: SyntheticScene, attributes: SaliencyBackend) -> None:
    model = onboard_unposed(given(mug_scene, "mug", 44, 52), "mug", attributes)
    assert len(model.references) == 2
    assert_found(model, mug_scene)


def test_the_order_of_the_others_and_their_stamps_do_not_matter(
    can_given: Given, can_unposed: ConceptModel, attributes: SaliencyBackend
) -> None:
    first, *others = can_given
    mixed = [first, *((replace(frame, stamp_ns=7), mask) for frame, mask in reversed(others))]
    again = onboard_unposed(mixed, "soup_can", attributes)
    assert [f.frame.index for f in again.references] == [f.frame.index for f in can_unposed.references]
    assert np.array_equal(again.points, can_unposed.points)


def test_the_model_moves_with_the_object_s_axes(can_given: Given, attributes: SaliencyBackend) -> None:
    G = Pose.exp([0.5, -1.2, 2.0, 0.03, -0.01, 0.02])
    start = Pose(np.eye(3), np.array([0, 0, 0.6]))
    pair = can_given[:1] + can_given[2:]
    here, moved = (onboard_unposed(pair, "soup_can", attributes, T_cam_obj=T) for T in (start, start @ G.inverse()))
    for a, b in zip(here.references, moved.references, strict=True):
        assert b.T_cam_obj.distance_to_m(a.T_cam_obj @ G.inverse()) < 0.0005
        assert np.degrees(b.T_cam_obj.angle_to_rad(a.T_cam_obj @ G.inverse())) < 0.5
    middles = (G @ here.points.mean(axis=0, keepdims=True), moved.points.mean(axis=0, keepdims=True))
    assert np.linalg.norm(middles[0] - middles[1]) < 0.001


# Frames that do not belong


def test_a_frame_of_another_object_is_left_out_and_named(
    can_given: Given, mug_scene: SyntheticScene, attributes: SaliencyBackend, caplog: pytest.LogCaptureFixture
) -> None:
    strange = given(mug_scene, "mug", 50)
    with caplog.at_level(logging.WARNING):
        model = onboard_unposed([*can_given[:1], *strange, *can_given[2:]], "soup_can", attributes)
    assert [reference.frame.index for reference in model.references] == [44, 52]
    (left_out,) = model.notes["left_out"]
    assert left_out.startswith("frame 50 of synthetic:turn?size=320x240&object=mug: ")
    assert f"left out {left_out}" in caplog.text


def test_several_frames_of_which_none_joins_make_no_model(
    can_given: Given, mug_scene: SyntheticScene, attributes: SaliencyBackend
) -> None:
    frame, mask = can_given[1]
    others = [*given(mug_scene, "mug", 50), (frame, np.zeros_like(mask))]
    with pytest.raises(OnboardingError, match=r"no frame could be joined to frame 44 .*frame 50 .*mask is empty"):
        onboard_unposed([can_given[0], *others], "soup_can", attributes)


def test_a_first_frame_that_shows_nothing_is_refused(can_given: Given, attributes: SaliencyBackend) -> None:
    frame, mask = can_given[0]
    with pytest.raises(OnboardingError, match="the mask is empty"):
        onboard_unposed([(frame, np.zeros_like(mask)), *can_given[1:]], "soup_can", attributes)
    with pytest.raises(OnboardingError, match="at least one reference frame"):
        onboard_unposed([], "soup_can", attributes)


@pytest.mark.parametrize("motion", [(0.25, 0, 0.25, 0, 0, 0), (0, 0, 0, 0.02, 0, 0), (0, 0, 0, 0, 0, 0.02)])
def test_surfaces_at_a_wrong_pose_contradict_each_other(
    motion: tuple[float, ...], mug_scene: SyntheticScene, attributes: SaliencyBackend
) -> None:
    first, right = posed(mug_scene, "mug", 44), posed(mug_scene, "mug", 56)
    wrong = posed(mug_scene, "mug", 56, motion)
    judge = registration(attributes)
    assert judge.surface_denied(first, right, 0.13) < MOST_DENIED / 5
    assert judge.surface_denied(first, wrong, 0.13) > MOST_DENIED
    assert judge.surface_denied(wrong, first, 0.13) == judge.surface_denied(first, wrong, 0.13)


def test_a_frame_that_is_placed_wrongly_but_surely_does_not_join(
    mug_scene: SyntheticScene, attributes: SaliencyBackend, monkeypatch: pytest.MonkeyPatch
) -> None:
    growing = GrowingModel(registration(attributes), posed(mug_scene, "mug", 44))
    before = growing.model
    wrong = posed(mug_scene, "mug", 52, (0.25, 0, 0.25, 0, 0, 0)).T_cam_obj
    monkeypatch.setattr(Registration, "sure", lambda self, result: wrong)  # noqa: ARG005
    growing.take([posed(mug_scene, "mug", 52)])
    assert growing.model is before
    assert "contradict" in growing.left_out[0]


def test_a_frame_that_is_painted_otherwise_does_not_join(
    can_scene: SyntheticScene, attributes: SaliencyBackend, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Surfaces do not contradict each other, but the model of both does not look like the first one any more."""
    growing = GrowingModel(registration(attributes), posed(can_scene, "soup_can", 44))
    right = posed(can_scene, "soup_can", 52)
    frame = replace(right.frame, rgb=np.ascontiguousarray(right.frame.rgb[..., [2, 1, 0]]))
    monkeypatch.setattr(Registration, "sure", lambda self, result: right.T_cam_obj)  # noqa: ARG005
    growing.take([replace(right, frame=frame)])
    assert len(growing.frames) == 1
    assert "with it, frame 44" in growing.left_out[0]


def test_where_a_chain_meets_a_contradicting_frame_goes(mug_scene: SyntheticScene, attributes: SaliencyBackend) -> None:
    growing = GrowingModel(registration(attributes), posed(mug_scene, "mug", 44))
    growing.frames += [posed(mug_scene, "mug", 52), posed(mug_scene, "mug", 48, (0, 0.35, 0, 0, 0, 0))]
    growing.settle()
    assert [frame.frame.index for frame in growing.frames] == [44, 52]
    assert growing.left_out[0].endswith("the other frames place it elsewhere than where it joined them")
    assert len(growing.model.references) == 2


# Which frames of a recording


class Recording:
    """Frames of which some show a piece of something."""

    name = "a recording"

    def __init__(self, frame: Frame, shown: list[bool]) -> None:
        self._frame, self._shown = frame, shown

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __len__(self) -> int:
        return len(self._shown)

    def __getitem__(self, index: int) -> Frame:
        mask = np.zeros(self._frame.depth_m.shape, bool)
        mask[:20, :20] = self._shown[index]
        return replace(self._frame, index=index, masks={"thing": mask})


@pytest.mark.parametrize(
    ("shown", "views", "chosen"),
    [
        ([True] * 9, 1, [4]),
        ([True] * 9, 3, [1, 4, 7]),
        ([True] * 3, 5, [0, 1, 2]),
        ([False] * 4 + [True] * 4, 2, [5]),
        ([True] + [False] * 7, 1, [0]),
    ],
)
def test_frames_are_spread_over_the_recording_where_the_object_is_seen(
    shown: list[bool], views: int, chosen: list[int], globe: Callable[..., PosedFrame]
) -> None:
    frame = globe(Pose(np.eye(3), np.array([0, 0, 0.35]))).frame
    read = read_unposed_frames(Recording(frame, shown), "thing", views)
    assert [frame.index for frame, _ in read] == chosen
    assert all(mask.sum() == 400 for _, mask in read)


def test_a_recording_without_the_object_is_refused_with_what_it_has() -> None:
    with pytest.raises(OnboardingError, match=r"mask of object 'mug' with 400 pixels.*masks of soup_can"):
        read_unposed_frames(open_scene("turn?size=320x240&object=soup_can&frames=2"), "mug", 2)
