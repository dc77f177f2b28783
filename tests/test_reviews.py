"""Two rates: concepts come late, from a worker, and do no harm and some good where the object is by then."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import pytest

from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError
from tracker.first_masks import FirstMasks
from tracker.frame import Frame
from tracker.pipeline import ObjectTracker
from tracker.pointing import Click
from tracker.result import TrackResult, TrackState
from tracker.saliency import Query, Saliency
from tracker.saliency.attributes import Attributes
from tracker.search import Hypothesis, Search
from tracker.sources.synthetic import SyntheticScene

CAN = "soup_can"
CARRIED = TrackerConfig(masks="carried")
T = TypeVar("T")


class Later(Executor):
    """Does what it was given when it is told to."""

    def __init__(self) -> None:
        self.given: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        future: Future[T] = Future()
        self.given.append((future, lambda: fn(*args, **kwargs)))
        return future

    def work(self) -> None:
        for future, what in self.given:
            try:
                future.set_result(what())
            except ConfigError as error:
                future.set_exception(error)
        self.given = []


def assert_near(result: TrackResult, scene: SyntheticScene, frame: Frame) -> None:
    truth = scene.sightings(result.object_id)[frame.index].T_cam_obj
    assert result.state is TrackState.TRACKING, result.reason
    assert result.pose is not None
    assert result.pose.distance_to_m(truth) < 0.004
    assert np.degrees(result.pose.angle_to_rad(truth)) < 4


@pytest.mark.parametrize("masks", ["given", "carried"])
def test_an_object_is_found_once_its_concepts_are_there_and_followed_without_them(
    masks: str, can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    worker, first = Later(), FirstMasks()
    tracker = ObjectTracker(can_model, TrackerConfig.model_validate({"masks": masks}), worker=worker)
    frames = can_frames if masks == "given" else [first(frame) for frame in can_frames]
    for frame in frames[:4]:
        (result,) = tracker.step(frame)
        assert (result.state, result.reason) == (TrackState.INITIALISING, "its concepts are not known yet")
    assert len(worker.given) == 1
    assert tracker.frames_without_concepts == 3
    results = []
    for frame in frames[4:]:  # what the first frame said, six degrees ago, then what the fifth one did
        if frame.index % 4 == 0:
            worker.work()
        results += tracker.step(frame)
    assert {result.state for result in results} == {TrackState.TRACKING}
    assert_near(results[-1], can_scene, frames[-1])


def test_a_worker_that_keeps_up_changes_next_to_nothing(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    worker = Later()
    tracker = ObjectTracker(can_model, TrackerConfig(concepts_every=3), worker=worker)
    for frame in can_frames:
        (result,) = tracker.step(frame)
        worker.work()
        if frame is not can_frames[0]:
            assert_near(result, can_scene, frame)
    assert tracker.frames_without_concepts == 0


def test_what_fits_otherwise_lowers_the_confidence_once_it_is_known(
    can_model: ConceptModel, can_frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    worker = Later()
    tracker = ObjectTracker(can_model, TrackerConfig(concepts_every=3), worker=worker)
    said = []
    for frame in can_frames[:6]:
        said += tracker.step(frame)
        worker.work()
        monkeypatch.setattr("tracker.looking.told_apart", lambda *_: 0.4)
    assert said[1].grounds is not None
    assert said[1].grounds.told_apart == 1.0
    assert said[-1].grounds is not None
    assert said[-1].grounds.told_apart == 0.4


def test_every_turn_is_tried_later_too_while_it_has_rivals(
    can_model: ConceptModel, can_frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    worker, asked = Later(), []

    def turned(*_: object, every: bool) -> list[Hypothesis]:
        asked.append(every)
        return []

    monkeypatch.setattr(Search, "turned", turned)
    monkeypatch.setattr("tracker.looking.told_apart", lambda *_: 0.4)
    tracker = ObjectTracker(can_model, TrackerConfig(concepts_every=1), worker=worker)
    for frame in can_frames[:4]:
        tracker.step(frame)
        worker.work()
    assert asked[0]  # of a search
    assert asked[-1]


def test_a_wrong_pose_is_put_right_by_what_is_known_later(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    """Told half a turn away, surface alone holds on to that; the label is what the concepts know."""
    worker = Later()
    tracker = ObjectTracker(can_model, TrackerConfig(believe=0.0), worker=worker)
    truth = can_scene.sightings(CAN)[can_frames[0].index].T_cam_obj
    turned = replace(truth, rotation=truth.rotation @ np.diag((-1.0, -1.0, 1.0)))
    tracker.place(CAN, turned, 0)
    (result,) = tracker.step(can_frames[0])
    assert result.pose is not None
    assert result.pose.angle_to_rad(truth) > 1
    worker.work()
    (result,) = tracker.step(can_frames[1])
    assert_near(result, can_scene, can_frames[1])


def test_what_was_seen_before_somebody_pointed_elsewhere_says_nothing(
    can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    worker, bare = Later(), [replace(frame, masks={}) for frame in can_frames]
    tracker = ObjectTracker(can_model, CARRIED, worker=worker)
    tracker.step(can_frames[0])
    worker.work()
    tracker.point_out(CAN, Click(2, 2))
    for frame in bare[1:4]:
        (result,) = tracker.step(frame)
        assert result.pose is None


class Broken(Attributes):
    """Fails."""

    def __call__(self, queries: Sequence[Query]) -> list[Saliency]:
        raise ConfigError(f"{len(queries)} pictures are too many")


def test_what_fails_in_the_worker_is_raised_in_the_next_step(can_model: ConceptModel, can_frames: list[Frame]) -> None:
    worker = Later()
    tracker = ObjectTracker(can_model, CARRIED, Broken(), worker)
    tracker.step(can_frames[0])
    worker.work()
    with pytest.raises(ConfigError, match="1 pictures are too many"):
        tracker.step(can_frames[1])
    (result,) = tracker.step(can_frames[2])  # once: the next one is asked anew
    assert result.reason == "its concepts are not known yet"
