"""The tracker on rendered scenes: near the truth or, in a word, lost; never a pose that nothing speaks for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
import torch

from reference.onboard import onboard, read_reference_frames
from tracker.concept import ConceptModel
from tracker.confidence import confidence
from tracker.config import TrackerConfig
from tracker.declared_symmetry import parse_symmetry
from tracker.errors import ConfigError, FrameError, LateFrameError, ModelError
from tracker.first_masks import FirstMasks
from tracker.frame import Frame, Mask
from tracker.geometry import Pose
from tracker.in_order import InOrder
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult, TrackState
from tracker.saliency import SaliencyBackend
from tracker.sources.synthetic import SyntheticScene, open_scene

CAN = "soup_can"
WITHOUT_PRIOR = TrackerConfig(prior=False)


def tracked(model: ConceptModel, frames: Iterable[Frame], config: TrackerConfig | None = None) -> list[TrackResult]:
    """Results of one object."""
    tracker = ObjectTracker(model, config)
    return [tracker.step(frame)[0] for frame in frames]


def errors(pose: Pose | None, truth: Pose) -> tuple[float, float]:
    """Millimetres and degrees."""
    assert pose is not None
    return 1000 * pose.distance_to_m(truth), float(np.degrees(pose.angle_to_rad(truth)))


def assert_near(results: Sequence[TrackResult], frames: Sequence[Frame], scene: SyntheticScene) -> None:
    for frame, result in zip(frames, results, strict=True):
        truth = scene.sightings(result.object_id)[frame.index].T_cam_obj
        assert result.state is TrackState.TRACKING, result.reason
        for pose in (result.pose, result.raw_pose):
            millimetres, degrees = errors(pose, truth)
            assert millimetres < 3
            assert degrees < 4


def assert_same(one: Sequence[TrackResult], other: Sequence[TrackResult]) -> None:
    """Bit for bit, but for the times that they took."""
    for a, b in zip(one, other, strict=True):
        assert (a.stamp_ns, a.object_id, a.state, a.confidence) == (b.stamp_ns, b.object_id, b.state, b.confidence)
        assert (a.reason, a.evidence) == (b.reason, b.evidence)
        for pose, as_pose in ((a.pose, b.pose), (a.raw_pose, b.raw_pose)):
            assert (pose is None) == (as_pose is None)
            if pose and as_pose:
                assert np.array_equal(pose.matrix, as_pose.matrix)


def with_mask(frame: Frame, mask: Mask, object_id: str = CAN) -> Frame:
    return replace(frame, masks={**frame.masks, object_id: mask})


def no_mask(frame: Frame) -> Frame:
    return replace(frame, masks={})


def empty_mask(frame: Frame) -> Frame:
    return with_mask(frame, np.zeros_like(frame.masks[CAN]))


def no_depth(frame: Frame) -> Frame:
    return replace(frame, depth_m=np.where(frame.masks[CAN], 0, frame.depth_m).astype(np.float32))


def few_pixels(frame: Frame) -> Frame:
    rows, columns = np.nonzero(frame.masks[CAN])
    mask = np.zeros_like(frame.masks[CAN])
    middle = (int(np.median(rows)), int(np.median(columns)))
    mask[middle[0] - 2 : middle[0] + 3, middle[1] - 2 : middle[1] + 3] = True
    return with_mask(frame, mask)


def no_surface(frame: Frame) -> Frame:
    """Depth that is nothing but noise of some centimetres."""
    noise_m = np.random.default_rng(frame.index).uniform(-0.06, 0.06, frame.depth_m.shape)
    noisy = np.where(frame.masks[CAN], np.maximum(frame.depth_m + noise_m, 0), frame.depth_m)
    return replace(frame, depth_m=noisy.astype(np.float32))


FAILURES: list[tuple[Callable[[Frame], Frame], str]] = [
    (no_mask, "no mask of object 'soup_can'"),
    (empty_mask, "out of view"),
    (no_depth, "no depth"),
    (few_pixels, "too little to see"),
    (no_surface, "poor fit"),
]


def test_a_can_that_turns_and_travels_is_followed_to_millimetres_and_degrees(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    results = tracked(can_model, can_frames)
    assert_near(results, can_frames, can_scene)
    assert [r.stamp_ns for r in results] == [f.stamp_ns for f in can_frames]
    assert {r.object_id for r in results} == {CAN}


def test_after_the_first_frame_the_object_is_found_where_it_is_expected(
    can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    first, *others = tracked(can_model, can_frames)
    assert first.reason == "found by search"
    assert {r.reason for r in others} <= {"found by prediction", "found by concepts"}


def test_without_a_prior_every_frame_is_tracked_as_if_it_were_the_only_one(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    frames = can_frames[::4]
    results = tracked(can_model, frames, WITHOUT_PRIOR)
    assert_near(results, frames, can_scene)
    assert {r.reason for r in results} == {"found by search"}
    assert_same(results, [tracked(can_model, [frame], WITHOUT_PRIOR)[0] for frame in frames])
    assert all(r.pose is r.raw_pose for r in results)


def test_two_objects_are_tracked_at_once_and_each_as_if_alone(
    table_scene: SyntheticScene, table_models: dict[str, ConceptModel]
) -> None:
    frames = [table_scene[index] for index in range(2, 6)]
    models = list(table_models.values())
    tracker = ObjectTracker(models)
    steps = [tracker.step(frame) for frame in frames]
    assert [[r.object_id for r in step] for step in steps] == [list(table_models)] * 4
    for k, model in enumerate(models):
        together = [step[k] for step in steps]
        assert_near(together, frames, table_scene)
        assert_same(together, tracked(model, frames))


def test_the_loss_of_one_object_leaves_the_other_alone(
    table_scene: SyntheticScene, table_models: dict[str, ConceptModel]
) -> None:
    frames = [table_scene[index] for index in range(2, 5)]
    frames[1] = with_mask(frames[1], np.zeros_like(frames[1].masks["mug"]), "mug")
    tracker = ObjectTracker([table_models["mug"], table_models["tea_box"]])
    steps = [tracker.step(frame) for frame in frames]
    assert [mug.state for mug, _ in steps] == [TrackState.TRACKING, TrackState.LOST, TrackState.TRACKING]
    assert_same([box for _, box in steps], tracked(table_models["tea_box"], frames))


@pytest.mark.parametrize(("spoil", "reason"), FAILURES)
def test_where_there_is_nothing_to_go_by_there_is_no_pose_but_a_reason_and_tracking_recovers(
    spoil: Callable[[Frame], Frame],
    reason: str,
    can_scene: SyntheticScene,
    can_model: ConceptModel,
    can_frames: list[Frame],
) -> None:
    frames = can_frames[:6]
    spoiled = [spoil(f) if k in (0, 3, 4) else f for k, f in enumerate(frames)]
    results = tracked(can_model, spoiled)
    initialising, lost, tracking = TrackState.INITIALISING, TrackState.LOST, TrackState.TRACKING
    assert [r.state for r in results] == [initialising, tracking, tracking, lost, lost, tracking]
    for k in (0, 3, 4):
        result = results[k]
        assert reason in result.reason
        assert (result.pose, result.raw_pose, result.covariance, result.evidence) == (None,) * 4
        assert result.confidence == 0
        assert (result.stamp_ns, result.object_id) == (frames[k].stamp_ns, CAN)
    good = [1, 2, 5]
    assert_near([results[k] for k in good], [frames[k] for k in good], can_scene)


def test_a_can_hidden_by_a_parcel_is_lost_and_found_again(attributes: SaliencyBackend) -> None:
    scene = open_scene("leave?size=320x240")
    model = onboard(read_reference_frames(scene, CAN, 2), attributes)
    pixels = [s.visible_px for s in scene.sightings(CAN)]
    hidden = pixels.index(0)
    back = next(k for k in range(hidden, len(pixels)) if pixels[k] > 0.95 * pixels[0])
    frames = [scene[index] for index in (0, 1, hidden, hidden + 1, back, back + 1)]
    results = tracked(model, frames)
    assert [r.pose is None for r in results] == [False, False, True, True, False, False]
    seen = [0, 1, 4, 5]
    assert_near([results[k] for k in seen], [frames[k] for k in seen], scene)


def test_an_object_that_jumps_is_found_where_it_is_at_once(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    """From one frame to the next the can is eight centimetres elsewhere and turned by fifty degrees."""
    far = can_scene[60]
    jumped = replace(far, stamp_ns=can_frames[2].stamp_ns)
    results = tracked(can_model, [*can_frames[:2], jumped])
    assert can_scene.sightings(CAN)[60].T_cam_obj.distance_to_m(can_scene.sightings(CAN)[21].T_cam_obj) > 0.08
    assert_near(results, [*can_frames[:2], jumped], can_scene)


def test_a_can_is_looked_for_where_it_is_said_to_be_first(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    tracker = ObjectTracker(can_model)
    roughly = can_truth.nudged(np.array([0.05, 0.05, 0, 0.004, 0, 0.004]))
    tracker.place(CAN, roughly, can_frames[0].stamp_ns)
    results = [tracker.step(frame)[0] for frame in can_frames[:3]]
    assert_near(results, can_frames[:3], can_scene)
    assert {r.reason for r in results} <= {"found by prediction", "found by concepts"}


def test_a_can_that_is_not_where_it_is_said_to_be_is_found_nevertheless(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    tracker = ObjectTracker(can_model)
    tracker.place(CAN, can_truth.nudged(np.array([1.5, 0, 0, 0.2, 0, 0.3])), can_frames[0].stamp_ns)
    results = [tracker.step(frame)[0] for frame in can_frames[:2]]
    assert results[0].reason == "found by search"
    assert_near(results, can_frames[:2], can_scene)


def test_to_say_where_an_object_is_says_nothing_of_whether_it_is_seen(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    tracker = ObjectTracker(can_model)
    tracker.place(CAN, can_truth, can_frames[0].stamp_ns)
    (hidden,) = tracker.step(empty_mask(can_frames[0]))
    assert (hidden.pose, hidden.state) == (None, TrackState.INITIALISING)


def test_an_object_is_placed_by_a_name_and_at_a_time_that_there_is(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    tracker = ObjectTracker(can_model)
    tracker.step(empty_mask(can_frames[1]))
    with pytest.raises(ConfigError, match="no model of object 'mug'; there are soup_can"):
        tracker.place("mug", can_truth, can_frames[1].stamp_ns)
    for stamp_ns in (can_frames[0].stamp_ns, -1, 0.5):
        with pytest.raises(
            FrameError, match=f"'soup_can' is of {stamp_ns} ns: .*last frame's {can_frames[1].stamp_ns}"
        ):
            tracker.place(CAN, can_truth, stamp_ns)  # pyright: ignore[reportArgumentType]
    tracker.place(CAN, can_truth, can_frames[3].stamp_ns)
    with pytest.raises(FrameError, match=f"not after the pose that was told, {can_frames[3].stamp_ns} ns"):
        tracker.step(can_frames[2])
    assert tracker.step(can_frames[3])[0].pose is not None
    with pytest.raises(ConfigError, match="with prior off"):
        ObjectTracker(can_model, WITHOUT_PRIOR).place(CAN, can_truth, 0)


@pytest.mark.parametrize("back_ns", [0, 1, 20_000_000])
def test_a_stamp_that_does_not_advance_is_refused_and_nothing_is_lost(
    back_ns: int, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    undisturbed = tracked(can_model, can_frames[:4])
    tracker = ObjectTracker(can_model)
    results = [tracker.step(frame)[0] for frame in can_frames[:3]]
    late = replace(can_frames[3], stamp_ns=can_frames[2].stamp_ns - back_ns)
    with pytest.raises(
        LateFrameError, match=f"frame 23 .*{late.stamp_ns} ns is not after .*{can_frames[2].stamp_ns} ns"
    ):
        tracker.step(late)
    assert_same([*results, tracker.step(can_frames[3])[0]], undisturbed)


@pytest.mark.parametrize("masks", ["given", "carried"])
def test_a_stream_with_dropped_repeated_and_swapped_frames_gives_the_poses_of_those_that_came_in_time(
    masks: Literal["given", "carried"], can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    arriving = [can_frames[k] for k in (0, 1, 1, 3, 2, 4, 0, 9, 8)]  # 5 to 7 are dropped
    arriving[4] = empty_mask(arriving[4])
    ordered, first = InOrder(arriving), FirstMasks()
    found = tracked(can_model, map(first, ordered) if masks == "carried" else ordered, TrackerConfig(masks=masks))
    assert ordered.refused == 4
    in_time, first = [can_frames[k] for k in (0, 1, 3, 4, 9)], FirstMasks()
    alone = tracked(can_model, map(first, in_time) if masks == "carried" else in_time, TrackerConfig(masks=masks))
    assert_same(found, alone)
    assert all(result.pose for result in found)


def test_the_same_frames_give_the_same_poses(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    one, other = tracked(can_model, can_frames[:5]), tracked(can_model, can_frames[:5])
    assert_same(one, other)
    for a, b in zip(one, other, strict=True):
        assert a.covariance is not None
        assert b.covariance is not None
        assert np.array_equal(a.covariance, b.covariance)


def test_one_thread_or_two_give_the_same_poses(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    before, found = torch.get_num_threads(), []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            found.append(tracked(can_model, can_frames[:2], TrackerConfig(prior=False)))
    finally:
        torch.set_num_threads(before)
    for one, two in zip(*found, strict=True):
        assert one.pose is not None
        assert two.pose is not None
        assert np.allclose(one.pose.matrix, two.pose.matrix, rtol=0, atol=1e-6)


def test_another_seed_of_the_search_finds_the_same_can(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    for seed in (1, 2):
        frames = can_frames[:1]
        assert_near(tracked(can_model, frames, TrackerConfig(prior=False, seed=seed)), frames, can_scene)


def test_a_frame_is_read_and_not_written(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    frame = can_frames[0]
    before = (frame.rgb.copy(), frame.depth_m.copy(), frame.masks[CAN].copy())
    tracked(can_model, can_frames[:1])
    for array, copy in zip((frame.rgb, frame.depth_m, frame.masks[CAN]), before, strict=True):
        assert np.array_equal(array, copy)


def test_a_result_carries_its_evidence(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    for result in tracked(can_model, can_frames[:3]):
        assert result.evidence is not None
        assert result.grounds is not None
        assert result.confidence == confidence(result.grounds)
        assert 0.5 < result.confidence <= 1
        assert result.covariance is not None
        assert result.covariance.shape == (6, 6)
        assert np.linalg.eigvalsh(result.covariance).min() > 0
        stages = {stage: ms for stage, ms in result.timings_ms.items() if stage != "total"}
        assert {"view", "refinement", "verification", "filter"} <= set(stages)
        assert 0 <= sum(stages.values()) <= result.timings_ms["total"]


def test_what_is_not_believed_is_not_reported(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    """The confidence that is asked for decides, whatever was found."""
    (result,) = tracked(can_model, can_frames[:1])
    assert result.grounds is not None
    of_itself = confidence(replace(result.grounds, told_apart=1.0))  # whatever else fits there, turned otherwise
    for believe, state in ((of_itself, TrackState.TRACKING), (1.0, TrackState.INITIALISING)):
        (again,) = tracked(can_model, can_frames[:1], TrackerConfig(believe=believe))
        assert again.state is state
    assert f"is right at {of_itself:.0%}" in again.reason


def test_an_object_is_found_by_its_own_mask_alone(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    others = {f"thing {k}": np.roll(can_frames[0].masks[CAN], 40 * k, axis=1) for k in (1, 2)}
    crowded = replace(can_frames[0], masks={**others, **can_frames[0].masks})
    assert_same(tracked(can_model, [crowded]), tracked(can_model, can_frames[:1]))


@pytest.mark.parametrize("corner", [(0, 160), (30, 160), (120, 0), (150, 200)])
def test_the_wall_and_the_table_are_not_taken_for_a_can(
    corner: tuple[int, int], can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    mask = np.zeros_like(can_frames[0].masks[CAN])
    mask[corner[0] : corner[0] + 60, corner[1] : corner[1] + 50] = True
    (result,) = tracked(can_model, [with_mask(can_frames[0], mask & ~can_frames[0].masks[CAN])])
    assert result.pose is None


def test_models_of_one_object_or_none_at_all_are_refused(can_model: ConceptModel) -> None:
    with pytest.raises(ConfigError, match="two models are of one object: soup_can, soup_can"):
        ObjectTracker([can_model, replace(can_model, notes={})])
    with pytest.raises(ConfigError, match="at least one model"):
        ObjectTracker([])


def test_a_model_of_another_backend_is_refused_with_what_to_do(
    can_model: ConceptModel, attributes: SaliencyBackend
) -> None:
    foreign = replace(can_model, backend="siglip2", fingerprint="siglip2-0123", labels=("lid", "label"))
    with pytest.raises(ModelError, match=r"'soup_can' was made by backend siglip2 .*python -m reference"):
        ObjectTracker(foreign, backend=attributes)
    older = replace(can_model, fingerprint="attributes-0123")
    with pytest.raises(ModelError, match="attributes-0123"):
        ObjectTracker(older)
    with pytest.raises(ModelError, match="attributes-0123"):
        ObjectTracker([can_model, replace(older, object_id="mug")])


def test_a_model_of_a_backend_that_does_not_exist_is_refused(can_model: ConceptModel) -> None:
    with pytest.raises(ConfigError, match="no saliency backend 'tea leaves'; expected one of attributes"):
        ObjectTracker(replace(can_model, backend="tea leaves"))


def test_a_bowl_that_turns_before_the_camera_does_not_jump_between_its_equivalents(attributes: SaliencyBackend) -> None:
    """Between frames the pose turns as far as the bowl did, about its axis as far as it likes, and little farther."""
    scene = open_scene("turn?size=320x240&object=bowl")
    model = onboard(read_reference_frames(scene, "bowl", 2), attributes)
    frames = [scene[index] for index in range(20, 32)]
    results = tracked(model, frames)
    truths = [scene.sightings("bowl")[frame.index].T_cam_obj for frame in frames]
    any_turn = parse_symmetry("z:inf")
    for (before, after), (was, is_now) in zip(pairwise(results), pairwise(truths), strict=True):
        assert before.pose is not None
        assert after.pose is not None
        assert after.raw_pose is not None
        for pose in (after.pose, after.raw_pose):
            assert np.degrees(before.pose.angle_to_rad(pose) - was.angle_to_rad(is_now)) < 10
            millimetres, degrees = errors(any_turn.nearest(pose, is_now), is_now)
            assert millimetres < 3
            assert degrees < 4


def test_of_poses_that_a_symmetry_makes_one_the_nearest_to_the_prediction_is_reported(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    """Whatever it is said to be: told that a can may be turned by any angle, it never turns it without need."""
    results = tracked(replace(can_model, symmetry=parse_symmetry("z:inf")), can_frames)
    truth = [can_scene.sightings(CAN)[frame.index].T_cam_obj for frame in can_frames]
    told = [result.pose for result in results if result.pose]
    assert len(told) == len(can_frames)
    needed = parse_symmetry("z:inf").nearest(truth[-1], truth[0]).angle_to_rad(truth[0])
    assert told[0].angle_to_rad(told[-1]) < needed + np.radians(3) < truth[0].angle_to_rad(truth[-1]) - np.radians(3)


def test_what_the_concepts_were_asked_of_last_is_kept(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    tracker = ObjectTracker(can_model, TrackerConfig(concepts_every=3))
    assert tracker.last_answer(CAN) is None
    asked = []
    for frame in can_frames[:8]:
        (result,) = tracker.step(frame)
        answer = tracker.last_answer(CAN)
        assert answer is not None
        view, saliency = answer
        assert saliency.labels == can_model.labels
        assert saliency.box == view.box
        assert (view.frame is frame) == ("saliency" in result.timings_ms)
        asked.append(view.frame.index)
    assert 1 < len(set(asked)) < 8
    assert tracker.last_answer("mug") is None


@pytest.mark.parametrize("prior", [True, False])
def test_frames_are_kept_to_hold_a_pose_by_where_there_is_a_prior_alone(
    prior: bool, can_model: ConceptModel, can_frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    kept: list[Pose] = []
    monkeypatch.setattr("tracker.rest.Rest.found", lambda _, refined, camera: kept.append(refined.T_cam_obj))  # noqa: ARG005
    tracker = ObjectTracker(can_model, TrackerConfig(prior=prior))
    for frame in can_frames[:3]:
        (result,) = tracker.step(frame)
        assert result.pose is not None
    assert len(kept) == (3 if prior else 0)
