"""Loop 1 of an evaluation: what the tracker said is kept as it was, and what it saw is counted."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from typing import Literal

import numpy as np
import pytest

from eval.datasets.synthetic import SyntheticDataset, open_synthetic
from eval.predict import track_dataset
from eval.protocol import Protocol
from eval.score import TrackingCounts
from eval.tracked import Tracked
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, FrameError, SourceError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult, TrackState
from tracker.saliency import SaliencyBackend
from tracker.sources import Sighting
from tracker.sources.synthetic import ObjectShape, SyntheticScene, open_scene

BOX = "tea_box"
SMALL = f"turn?size=160x120&frames=6&object={BOX}"


@pytest.fixture(scope="module")
def protocol(attributes: SaliencyBackend) -> Protocol:
    return Protocol(attributes, TrackerConfig(), views=1)


@pytest.fixture(scope="module")
def tracked(protocol: Protocol) -> Tracked:
    return track_dataset(open_synthetic(SMALL), protocol)


@cache
def small_scene() -> SyntheticScene:
    return open_scene(SMALL)


@dataclass(frozen=True)
class Edited:
    """The small scene, with some frames and some sightings changed."""

    frame: Callable[[Frame], Frame] = lambda frame: frame
    sighting: Callable[[Sighting], Sighting] = lambda sighting: sighting
    name: str = "edited"
    object_ids: tuple[str, ...] = (BOX,)
    read: list[int] = field(default_factory=list)

    def __len__(self) -> int:
        return len(small_scene())

    def __getitem__(self, index: int) -> Frame:
        return self.frame(small_scene()[index])

    def __iter__(self) -> Iterator[Frame]:
        for index in range(len(self)):
            self.read.append(index)
            yield self[index]

    def sightings(self, object_id: str) -> Sequence[Sighting]:
        return [self.sighting(s) for s in small_scene().sightings(object_id)]

    def shape(self, object_id: str) -> ObjectShape:
        return small_scene().shape(object_id)


def hidden_in(*indices: int) -> Callable[[Frame], Frame]:
    def hide(frame: Frame) -> Frame:
        if frame.index not in indices:
            return frame
        return replace(frame, masks={BOX: np.zeros_like(frame.masks[BOX])})

    return hide


def test_every_step_leaves_a_record_that_json_can_hold(protocol: Protocol) -> None:
    tracked = track_dataset(SyntheticDataset(Edited(hidden_in(3))), protocol)
    assert [(r.scene_id, r.image_id, r.object_id) for r in tracked.records] == [(1, k, BOX) for k in range(6)]
    assert len(tracked.records) == len(tracked.timings_ms)
    states = [r.state for r in tracked.records]
    assert states[3] == "lost"
    assert states.count("tracking") == 5
    scores = {e.image_id: e.score for e in tracked.estimates}
    assert [r.confidence for r in tracked.records] == [scores.get(k, 0.0) for k in range(6)]
    assert tracked.records[3].reason
    assert json.loads(json.dumps([asdict(r) for r in tracked.records])) == [asdict(r) for r in tracked.records]


def test_every_frame_is_tracked_in_order_and_every_pose_is_kept(tracked: Tracked) -> None:
    assert [e.image_id for e in tracked.estimates] == list(range(6))
    assert {(e.scene_id, e.object_id) for e in tracked.estimates} == {(1, 1)}
    truth = small_scene().sightings(BOX)
    for estimate in tracked.estimates:
        assert estimate.T_cam_obj.distance_to_m(truth[estimate.image_id].T_cam_obj) < 0.003
        assert 0 < estimate.score <= 1
        assert estimate.time_s > 0
    assert tracked.counts == {BOX: TrackingCounts(frames=6, lost=0, false_tracks=0)}
    assert len(tracked.timings_ms) == 6


def test_the_frames_that_models_were_made_of_are_told(tracked: Tracked) -> None:
    ((scene_id, object_id, image_id),) = tracked.reference_frames
    assert (scene_id, object_id) == (1, BOX)
    assert image_id in range(6)


def test_the_poses_are_those_of_a_tracker_that_gets_the_frames_and_nothing_else(
    tracked: Tracked, protocol: Protocol
) -> None:
    models: list[ConceptModel] = []
    again = track_dataset(open_synthetic(SMALL), protocol, viewer=lambda _, made: models.extend(made) or Silent())
    tracker = ObjectTracker(models)
    for frame, estimate, repeated in zip(small_scene(), tracked.estimates, again.estimates, strict=True):
        pose = tracker.step(frame)[0].pose
        assert pose is not None
        assert np.array_equal(pose.matrix, estimate.T_cam_obj.matrix)
        assert np.array_equal(pose.matrix, repeated.T_cam_obj.matrix)


def test_raw_poses_are_kept_where_they_are_asked_for(tracked: Tracked, protocol: Protocol) -> None:
    shown = Silent()
    raw = track_dataset(open_synthetic(SMALL), replace(protocol, poses="raw"), viewer=lambda *_: shown)
    assert len(raw.estimates) == len(shown.results) == 6
    for estimate, result in zip(raw.estimates, shown.results, strict=True):
        assert estimate.T_cam_obj is result.raw_pose
    assert any(
        not np.array_equal(r.T_cam_obj.matrix, f.T_cam_obj.matrix)
        for r, f in zip(raw.estimates, tracked.estimates, strict=True)
    )


def test_smoothed_poses_are_of_the_same_frames_and_not_the_same(tracked: Tracked, protocol: Protocol) -> None:
    smoothed = track_dataset(open_synthetic(SMALL), replace(protocol, smooth="offline"))
    assert [e.image_id for e in smoothed.estimates] == [e.image_id for e in tracked.estimates]
    assert smoothed.records == tracked.records
    apart_m = [
        a.T_cam_obj.distance_to_m(b.T_cam_obj) for a, b in zip(tracked.estimates, smoothed.estimates, strict=True)
    ]
    assert apart_m[-1] == 0
    assert 1e-6 < max(apart_m) < 0.005
    with pytest.raises(ConfigError, match=r"--smooth offline .* --poses filtered"):
        replace(protocol, smooth="offline", poses="raw")


def test_a_lost_frame_has_no_row_and_is_counted(tracked: Tracked, protocol: Protocol) -> None:
    ((_, _, reference),) = tracked.reference_frames
    lost = [index for index in (1, 3, 4) if index != reference]
    source = Edited(hidden_in(*lost))
    with_gaps = track_dataset(SyntheticDataset(source), protocol)
    assert [e.image_id for e in with_gaps.estimates] == [index for index in range(6) if index not in lost]
    assert with_gaps.counts == {BOX: TrackingCounts(frames=6, lost=len(lost), false_tracks=0)}
    assert source.read == list(range(6))


def test_frames_before_the_object_was_first_seen_are_not_lost_ones(tracked: Tracked, protocol: Protocol) -> None:
    ((_, _, reference),) = tracked.reference_frames
    assert reference > 0
    late = track_dataset(SyntheticDataset(Edited(hidden_in(0))), protocol)
    assert [e.image_id for e in late.estimates] == [1, 2, 3, 4, 5]
    assert late.counts == {BOX: TrackingCounts(frames=6, lost=0, false_tracks=0)}


def test_a_pose_where_no_pixel_can_be_seen_is_a_false_track(protocol: Protocol) -> None:
    def unseen(sighting: Sighting) -> Sighting:
        return replace(sighting, visible_px=0, visible_fraction=0.0) if sighting.index in (1, 4) else sighting

    tracked = track_dataset(SyntheticDataset(Edited(sighting=unseen)), protocol)
    assert tracked.counts == {BOX: TrackingCounts(frames=6, lost=0, false_tracks=2)}
    assert len(tracked.estimates) == 6


def test_an_object_of_which_no_model_can_be_made_is_told_and_the_others_are_tracked(protocol: Protocol) -> None:
    """In a picture this small only the cereal box is large enough."""
    tracked = track_dataset(open_synthetic("tabletop?size=96x72&frames=2"), protocol)
    assert set(tracked.counts) == {"cereal_box"}
    assert set(tracked.refused) == {f"1/{name}" for name in ("tea_box", "soup_can", "mug", "clamp", "bowl")}
    assert all("pixels" in reason or "points" in reason for reason in tracked.refused.values())
    assert {object_id for _, object_id, _ in tracked.reference_frames} == {"cereal_box"}


def test_all_objects_of_an_image_share_its_time(protocol: Protocol) -> None:
    """BOP's rule: the time is of the image, not of the object."""
    shown = Silent()
    tracked = track_dataset(
        open_synthetic("tabletop?size=320x240&frames=2"), protocol, object_ids=("mug", "cereal_box"),
        viewer=lambda *_: shown,
    )  # fmt: skip
    assert set(tracked.counts) == {"mug", "cereal_box"}
    for image_id in (0, 1):
        times_s = {e.time_s for e in tracked.estimates if e.image_id == image_id}
        spent_ms = [r.timings_ms["total"] for r in shown.results[2 * image_id : 2 * image_id + 2]]
        assert times_s == {sum(spent_ms) / 1000}


@dataclass
class Told:
    """A method that only remembers what it is told, and before which frame."""

    models: Sequence[ConceptModel]
    told: list[tuple[str, int, Pose]] = field(default_factory=list)
    steps: int = 0

    def place(self, object_id: str, T_cam_obj: Pose, stamp_ns: int) -> None:
        self.told.append((object_id, stamp_ns, T_cam_obj))

    def step(self, frame: Frame) -> tuple[TrackResult, ...]:
        assert all(stamp_ns <= frame.stamp_ns for _, stamp_ns, _ in self.told)
        self.steps += 1
        state, spent = TrackState.INITIALISING, {"total": 1.0}
        return tuple(
            TrackResult(frame.stamp_ns, m.object_id, None, state, 0.0, None, "not mine", None, None, spent)
            for m in self.models
        )


@pytest.mark.parametrize(("initialisation", "times"), [("estimated", 0), ("gt", 1)])
def test_a_true_pose_is_told_once_in_the_first_frame_that_shows_the_object_or_never(
    initialisation: Literal["estimated", "gt"], times: int, protocol: Protocol, monkeypatch: pytest.MonkeyPatch
) -> None:
    methods: list[Told] = []

    def opened(name: str, models: Sequence[ConceptModel], *_: object) -> Told:
        assert name == "ours"
        methods.append(Told(models))
        return methods[-1]

    def unseen(sighting: Sighting) -> Sighting:
        return replace(sighting, visible_px=0, visible_fraction=0.0) if sighting.index < 2 else sighting

    monkeypatch.setattr("eval.predict.open_method", opened)
    track_dataset(SyntheticDataset(Edited(sighting=unseen)), replace(protocol, initialisation=initialisation))
    (method,) = methods
    assert method.steps == 6
    assert len(method.told) == times
    for object_id, stamp_ns, T_cam_obj in method.told:
        assert (object_id, stamp_ns) == (BOX, small_scene()[2].stamp_ns)
        assert np.array_equal(T_cam_obj.matrix, small_scene().sightings(BOX)[2].T_cam_obj.matrix)


def test_a_peer_is_tracked_as_the_tracker_is(protocol: Protocol) -> None:
    tracked = track_dataset(open_synthetic(SMALL), replace(protocol, method="icp", initialisation="gt"))
    assert [e.image_id for e in tracked.estimates] == list(range(6))
    for estimate in tracked.estimates:
        assert estimate.T_cam_obj.distance_to_m(small_scene().sightings(BOX)[estimate.image_id].T_cam_obj) < 0.003


def test_the_viewer_gets_every_frame_with_its_truth_and_is_closed(protocol: Protocol) -> None:
    shown = Silent()
    track_dataset(open_synthetic(SMALL), protocol, viewer=lambda *_: shown)
    assert shown.frames == list(range(6))
    assert shown.closed == 1
    for truth, sighting in zip(shown.truth, small_scene().sightings(BOX), strict=True):
        assert set(truth) == {BOX}
        assert np.array_equal(truth[BOX].matrix, sighting.T_cam_obj.matrix)


def test_the_viewer_gets_the_truth_of_a_symmetric_object_turned_as_the_estimate_is(protocol: Protocol) -> None:
    shown, bowl = Silent(), open_synthetic("tabletop?size=320x240&frames=8")
    each_alone = replace(protocol, config=TrackerConfig(prior=False))
    track_dataset(bowl, each_alone, object_ids=["bowl"], viewer=lambda *_: shown)
    (axis,) = bowl.model("bowl").symmetries.axes
    off_rad = np.zeros((0, 2))
    for truth, result, sighting in zip(shown.truth, shown.results, bowl.scene(1).sightings("bowl"), strict=True):
        assert result.pose is not None
        assert truth["bowl"].rotation @ axis == pytest.approx(sighting.T_cam_obj.rotation @ axis)
        assert truth["bowl"].distance_to_m(sighting.T_cam_obj) < 1e-9
        off = [pose.angle_to_rad(result.pose) for pose in (truth["bowl"], sighting.T_cam_obj)]
        off_rad = np.vstack((off_rad, off))
    drawn_rad, true_rad = off_rad.max(axis=0)
    assert true_rad > 2 * drawn_rad


def test_the_viewer_is_closed_too_where_a_frame_cannot_be_read(protocol: Protocol) -> None:
    def broken(frame: Frame) -> Frame:
        if frame.index == 5 and shown.frames:
            raise FrameError("frame 5 is broken")
        return frame

    shown = Silent()
    with pytest.raises(FrameError, match="frame 5 is broken"):
        track_dataset(SyntheticDataset(Edited(broken)), protocol, viewer=lambda *_: shown)
    assert shown.frames == [0, 1, 2, 3, 4]
    assert shown.closed == 1


def test_progress_is_told_how_many_frames_there_are(protocol: Protocol) -> None:
    told: list[tuple[int, str]] = []

    def progress(frames: Iterable[Frame], total: int, what: str) -> Iterable[Frame]:
        told.append((total, what))
        return frames

    track_dataset(open_synthetic(SMALL), protocol, progress=progress)
    assert told == [(6, "scene 1")]


def test_a_scene_that_is_not_there_is_an_error(protocol: Protocol) -> None:
    with pytest.raises(SourceError, match="no scene 3; it has 1"):
        track_dataset(open_synthetic(SMALL), protocol, scene_ids=[3])


@dataclass
class Silent:
    """A viewer that remembers."""

    frames: list[int] = field(default_factory=list)
    results: list[TrackResult] = field(default_factory=list)
    truth: list[Mapping[str, Pose]] = field(default_factory=list)
    closed: int = 0

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        self.frames.append(frame.index)
        self.results.extend(results)
        self.truth.append(truth)

    def close(self) -> None:
        self.closed += 1
