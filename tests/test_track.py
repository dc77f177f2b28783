"""The carried mask: pointed out once, an object is followed, known to be lost, and found again; never made up."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest

from reference.onboard import onboard, read_reference_frames
from tracker import belief, track
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError
from tracker.first_masks import FirstMasks
from tracker.found import Look
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.pipeline import ObjectTracker
from tracker.pointing import Click, Pointer
from tracker.result import TrackResult, TrackState
from tracker.saliency import SaliencyBackend
from tracker.sources.synthetic import SyntheticScene, open_scene
from tracker.view import Box, bounding_box

CARRIED = TrackerConfig(masks="carried")
CAN = "soup_can"


def bare(frame: Frame) -> Frame:
    """Without masks."""
    return replace(frame, masks={})


def carried(model: ConceptModel, frames: Iterable[Frame]) -> list[TrackResult]:
    """Pointed out in the first frame where it can be seen, and never again."""
    tracker, first = ObjectTracker(model, CARRIED), FirstMasks()
    return [tracker.step(first(frame))[0] for frame in frames]


def assert_near(pose: Pose | None, truth: Pose) -> None:
    assert pose is not None
    assert pose.distance_to_m(truth) < 0.004
    assert np.degrees(pose.angle_to_rad(truth)) < 4


def test_a_can_is_followed_by_its_first_mask_alone(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    for frame, result in zip(can_frames, carried(can_model, can_frames), strict=True):
        assert result.state is TrackState.TRACKING, result.reason
        assert_near(result.pose, can_scene.sightings(CAN)[frame.index].T_cam_obj)


@pytest.mark.parametrize("prior", [True, False])
def test_a_rival_is_compared_in_the_next_frame_where_there_is_a_prior(
    prior: bool, can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracker = ObjectTracker(can_model, TrackerConfig(prior=prior))
    tracker.step(can_frames[0])
    turned = can_truth.nudged(np.array((0.0, 0.6, 0, 0, 0, 0)))
    monkeypatch.setattr("tracker.track.rival", lambda *_: turned)
    tracker.step(can_frames[1])
    monkeypatch.undo()
    (result,) = tracker.step(can_frames[2])
    assert result.pose is not None
    assert result.pose.distance_to_m(can_truth) < 0.05
    starts = [look.start for look in tracker.attempt(CAN).looks if isinstance(look, Look)]
    assert len([start for start in starts if start is not None]) == (2 if prior else 0)


def test_what_is_followed_may_be_doubtful_for_three_frames(
    can_model: ConceptModel, can_frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    tracker, first = ObjectTracker(can_model, CARRIED), FirstMasks()
    still = [replace(can_frames[0], index=k, stamp_ns=k * 33_000_000) for k in range(6)]
    assert tracker.step(first(still[0]))[0].pose is not None
    monkeypatch.setattr(belief, "_speaks_against", lambda _: "it is something else")
    results = [tracker.step(first(frame))[0] for frame in still[1:]]
    assert [result.state for result in results] == [TrackState.TRACKING] * 3 + [TrackState.LOST] * 2
    assert results[3].reason == "poor fit: it is something else"


@pytest.fixture(scope="module")
def leaving() -> SyntheticScene:
    """A parcel hides the can; later the camera turns away and comes back."""
    return open_scene("leave?size=320x240")


@pytest.fixture(scope="module")
def left(leaving: SyntheticScene, attributes: SaliencyBackend) -> list[TrackResult]:
    return carried(onboard(read_reference_frames(leaving, CAN, 3), attributes), leaving)


def test_there_is_no_pose_of_what_is_hidden_or_out_of_view(leaving: SyntheticScene, left: list[TrackResult]) -> None:
    seen = {s.index for s in leaving.sightings(CAN) if s.visible_px > 0}
    false_tracks = [r for k, r in enumerate(left) if k not in seen and r.pose is not None]
    assert len(seen) < len(left) - 20
    assert len(false_tracks) <= 3
    for k, result in enumerate(left):
        assert (result.pose is None) == (result.state is not TrackState.TRACKING), k


def test_the_reason_says_what_became_of_it(leaving: SyntheticScene, left: list[TrackResult]) -> None:
    gone = [s.index for s in leaving.sightings(CAN) if s.visible_px == 0]
    first, second = (part for part in np.split(gone, np.flatnonzero(np.diff(gone) > 1) + 1))
    for stretch, word in ((first, "hidden"), (second, "out of view")):
        reasons = [left[k].reason for k in stretch[2:-2]]
        assert sum(word in reason for reason in reasons) > 0.6 * len(reasons), reasons


def test_what_was_hidden_and_what_was_out_of_view_is_found_again(
    leaving: SyntheticScene, left: list[TrackResult]
) -> None:
    truths = {s.index: s for s in leaving.sightings(CAN)}
    shown = [k for k, s in truths.items() if s.visible_fraction > 0.9]
    tracking = [k for k in shown if left[k].state is TrackState.TRACKING]
    assert len(tracking) > 0.85 * len(shown)
    assert left[-1].state is TrackState.TRACKING
    for k in tracking:
        pose = left[k].pose
        assert pose is not None
        assert pose.distance_to_m(truths[k].T_cam_obj) < 0.01


def test_one_that_was_taken_away_is_lost_and_says_so(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    gone = []
    for frame in can_frames[2:6]:
        mask = frame.masks[CAN]
        depth_m = np.where(mask, np.float32(frame.depth_m[~mask].max()), frame.depth_m)
        gone.append(
            bare(replace(frame, depth_m=depth_m, rgb=np.where(mask[:, :, None], 90, frame.rgb).astype(np.uint8)))
        )
    results = carried(can_model, [*can_frames[:2], *gone])
    assert [r.state for r in results[:2]] == [TrackState.TRACKING] * 2
    for result in results[2:]:
        assert result.state is TrackState.LOST
        assert result.pose is None
        assert result.reason


def test_without_any_mask_it_is_found_in_the_whole_picture_and_confirmed_by_a_second_frame(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    tracker = ObjectTracker(can_model, CARRIED)
    results = [tracker.step(bare(frame))[0] for frame in can_frames[:8]]
    first = next(k for k, r in enumerate(results) if r.state is TrackState.TRACKING)
    assert first >= 1
    assert "confirm" in results[first - 1].reason
    assert results[first - 1].state is TrackState.INITIALISING
    assert_near(results[first].pose, can_scene.sightings(CAN)[can_frames[first].index].T_cam_obj)


def test_a_mask_that_a_frame_gives_overrules_what_is_carried(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    tracker = ObjectTracker(can_model, CARRIED)
    assert tracker.step(can_frames[0])[0].state is TrackState.TRACKING
    nothing = replace(can_frames[1], masks={CAN: np.zeros_like(can_frames[1].masks[CAN])})
    said = tracker.step(nothing)[0]
    assert (said.pose, said.state) == (None, TrackState.LOST)
    assert "out of view" in said.reason
    assert tracker.step(can_frames[2])[0].state is TrackState.TRACKING


def test_masks_are_carried_by_a_prior() -> None:
    with pytest.raises(ValueError, match="masks=carried needs prior=true"):
        TrackerConfig(masks="carried", prior=False)


def middle_of(mask: np.ndarray) -> Click:
    rows, columns = np.nonzero(mask)
    k = int(np.argmin(np.hypot(rows - rows.mean(), columns - columns.mean())))
    return Click(int(columns[k]), int(rows[k]))


def grown(mask: np.ndarray) -> Box:
    """Around it, as a hand draws it."""
    box = bounding_box(mask)
    assert box is not None
    return Box(box.x0 - 9, box.y0 - 6, box.x1 + 5, box.y1 + 8)


@pytest.mark.parametrize("pointed", [middle_of, grown])
def test_a_click_or_a_box_on_the_first_frame_will_do(
    pointed: Callable[[np.ndarray], Pointer],
    can_scene: SyntheticScene,
    can_model: ConceptModel,
    can_frames: list[Frame],
) -> None:
    tracker = ObjectTracker(can_model, CARRIED)
    tracker.point_out(CAN, pointed(can_frames[0].masks[CAN]))
    for frame in can_frames[:3]:
        (result,) = tracker.step(bare(frame))
        assert result.state is TrackState.TRACKING, result.reason
        assert_near(result.pose, can_scene.sightings(CAN)[frame.index].T_cam_obj)


def test_what_is_pointed_out_elsewhere_is_not_believed_to_be_where_it_was(
    can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    """The user's word counts, and where nothing like the object is, nothing is made up."""
    tracker = ObjectTracker(can_model, CARRIED)
    assert tracker.step(can_frames[0])[0].state is TrackState.TRACKING
    tracker.point_out(CAN, Click(2, 2))
    (result,) = tracker.step(bare(can_frames[1]))
    assert (result.state, result.pose) == (TrackState.INITIALISING, None)
    tracker.point_out(CAN, middle_of(can_frames[2].masks[CAN]))
    assert tracker.step(bare(can_frames[2]))[0].state is TrackState.TRACKING


@pytest.mark.parametrize(("away", "remembered"), [(2, True), (3, False)])
def test_how_it_looked_is_forgotten_where_it_was_long_away(
    away: int, remembered: bool, can_model: ConceptModel, can_frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(track, "SO_LONG", 3)
    tracker, nothing = ObjectTracker(can_model), np.zeros_like(can_frames[0].masks[CAN])
    frames = can_frames[: 3 + away]
    shown = [
        frame if k < 2 or k == 2 + away else replace(frame, masks={CAN: nothing}) for k, frame in enumerate(frames)
    ]
    assert [tracker.step(frame)[0] for frame in shown][-1].state is TrackState.TRACKING
    assert all((found.usual is not None) == remembered for found in tracker.attempt(CAN).tried)


def test_how_it_looked_is_forgotten_where_somebody_points(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    tracker = ObjectTracker(can_model, CARRIED)
    tracker.step(can_frames[0])
    tracker.point_out(CAN, middle_of(can_frames[1].masks[CAN]))
    tracker.step(bare(can_frames[1]))
    tried = tracker.attempt(CAN).tried
    assert tried
    assert all(found.usual is None for found in tried)


@pytest.mark.parametrize("prior", [True, False])
def test_what_is_mostly_hidden_is_held_by_where_it_stood_where_there_is_a_prior(
    prior: bool, table_scene: SyntheticScene, table_models: dict[str, ConceptModel]
) -> None:
    """Past a camera that is carried around."""
    name = "tea_box"
    tracker = ObjectTracker(table_models[name], TrackerConfig(prior=prior))
    for frame in (table_scene[index] for index in range(10, 15)):
        assert tracker.step(frame)[0].state is TrackState.TRACKING
    frame = table_scene[15]
    mask, depth_m = frame.masks[name], frame.depth_m.copy()
    columns = np.flatnonzero(mask.any(axis=0))
    shown = mask & (np.arange(mask.shape[1]) < columns[0] + len(columns) // 4)
    depth_m[mask & ~shown] *= np.float32(0.7)
    (result,) = tracker.step(replace(frame, masks={name: shown}, depth_m=depth_m))
    assert (result.reason == "found by stillness") == prior
    if prior:
        assert_near(result.pose, table_scene.sightings(name)[15].T_cam_obj)


def test_nobody_points_where_every_frame_has_a_mask(can_model: ConceptModel) -> None:
    with pytest.raises(ConfigError, match="every frame's mask"):
        ObjectTracker(can_model).point_out(CAN, Click(1, 1))
    with pytest.raises(ConfigError, match="no model of object 'mug'"):
        ObjectTracker(can_model, CARRIED).point_out("mug", Click(1, 1))


@pytest.fixture(scope="module")
def twins(attributes: SaliencyBackend) -> tuple[SyntheticScene, list[ConceptModel]]:
    """Two mugs that are alike, and a model for each."""
    alone = open_scene("turn?object=mug&size=320x240&frames=284")
    model = onboard(read_reference_frames(alone, "mug", 4), attributes)
    scene = open_scene("twins?object=mug&size=320x240")
    return scene, [replace(model, object_id=object_id) for object_id in scene.object_ids]


def test_two_of_a_kind_are_found_without_any_mask_and_never_in_one_place(
    twins: tuple[SyntheticScene, list[ConceptModel]],
) -> None:
    scene, models = twins
    tracker = ObjectTracker(models, CARRIED)
    results = [tracker.step(bare(scene[index])) for index in range(10)]
    for step in results:
        poses = [result.pose for result in step if result.pose]
        assert len(poses) < 2 or poses[0].distance_to_m(poses[1]) > 0.1
    assert any("what is seen there is object" in result.reason for step in results for result in step)
    truths = [scene.sightings(object_id)[9].T_cam_obj for object_id in scene.object_ids]
    found = sorted(results[-1], key=lambda result: result.pose.distance_to_m(truths[0]) if result.pose else np.inf)
    for result, truth in zip(found, truths, strict=True):
        assert_near(result.pose, truth)


def test_of_two_of_a_kind_the_one_that_was_pointed_out_is_followed(
    twins: tuple[SyntheticScene, list[ConceptModel]],
) -> None:
    """Also while the other one, which nobody has a model of here, hides half of it."""
    scene, (model, _) = twins
    tracker = ObjectTracker(model, CARRIED)
    tracker.point_out(model.object_id, middle_of(scene[34].masks[model.object_id]))
    for index in range(34, 56, 2):
        (result,) = tracker.step(bare(scene[index]))
        assert_near(result.pose, scene.sightings(model.object_id)[index].T_cam_obj)
    assert min(scene.sightings(model.object_id)[index].visible_fraction for index in range(34, 56, 2)) < 0.6
