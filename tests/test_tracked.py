"""What is kept of a run: poses, counts and times, of one scene or of several."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eval.datasets.synthetic import open_synthetic
from eval.summary import TrackingCounts
from eval.tracked import Tracked
from tracker.geometry import Pose
from tracker.result import TrackResult, TrackState

BOX = "tea_box"
HERE, FILTERED = Pose(np.eye(3), np.array([0.0, 0.0, 0.5])), Pose(np.eye(3), np.array([0.0, 0.0, 0.6]))
LOST = TrackResult(
    stamp_ns=0, object_id=BOX, pose=None, state=TrackState.LOST, confidence=0.0, covariance=None, reason="out of view",
    raw_pose=None, grounds=None, timings_ms={"total": 20.0},
)  # fmt: skip
FOUND = replace(LOST, pose=FILTERED, raw_pose=HERE, state=TrackState.TRACKING, confidence=0.9)


def kept(*frames: tuple[TrackResult, bool], poses: str = "filtered") -> Tracked:
    tracked, dataset = Tracked(), open_synthetic(f"turn?size=160x120&frames=6&object={BOX}")
    for index, (result, seen) in enumerate(frames):
        tracked.add(dataset, 1, index, [result], [seen], "raw" if poses == "raw" else "filtered")
    return tracked


def test_a_pose_is_an_estimate_and_what_is_lost_or_false_is_counted() -> None:
    tracked = kept((FOUND, True), (LOST, True), (FOUND, False))
    assert tracked.counts == {BOX: TrackingCounts(frames=3, lost=1, false_tracks=1)}
    assert [estimate.image_id for estimate in tracked.estimates] == [0, 2]
    assert [estimate.time_s for estimate in tracked.estimates] == [0.02, 0.02]
    assert len(tracked.timings_ms) == len(tracked.records) == 3


@pytest.mark.parametrize(("poses", "pose"), [("filtered", FILTERED), ("raw", HERE)])
def test_those_poses_count_that_are_asked_for(poses: str, pose: Pose) -> None:
    (estimate,) = kept((FOUND, True), poses=poses).estimates
    assert estimate.T_cam_obj is pose


def test_scenes_are_joined_in_their_order_and_counts_are_summed() -> None:
    one, other = kept((FOUND, True)), kept((LOST, True), (FOUND, True))
    one.reference_frames.add((1, BOX, 4))
    other.refused["2/mug"] = "too small"
    whole = Tracked.joined((one, other))
    assert whole.counts == {BOX: TrackingCounts(frames=3, lost=1, false_tracks=0)}
    assert whole.estimates == one.estimates + other.estimates
    assert whole.reference_frames == {(1, BOX, 4)}
    assert whole.refused == {"2/mug": "too small"}


def test_latency_is_the_median_of_whole_steps_and_of_stages_where_they_ran() -> None:
    timings = [{"total": float(k), "matching": 2.0 * k} for k in range(1, 101)]
    timings[6]["registration"], timings[7]["registration"] = 30.0, 50.0
    latency = Tracked(timings_ms=timings).latency_ms()
    assert latency == {
        "median": 50.5,
        "p95": pytest.approx(95.05),
        "stages": {"matching": 101.0, "registration": 40.0},
    }
    assert Tracked().latency_ms() == {}
