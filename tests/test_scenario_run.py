"""One run of a scenario, with what it says of every frame."""

from __future__ import annotations

import pytest

from eval.scenarios.criteria import false_tracks, losing_delays
from eval.scenarios.run import SCENARIOS, RunLog, ScenarioRun, run_scenario
from tracker.config import TrackerConfig
from tracker.errors import SourceError
from tracker.sources.synthetic.scenes import SCENES

CARRIED = TrackerConfig(masks="carried")


@pytest.fixture(scope="module")
def log() -> RunLog:
    return run_scenario(ScenarioRun("blind", 5, "200x150", 2, CARRIED))


def test_it_is_tracked_with_its_errors_evidence_and_covariance(log: RunLog) -> None:
    assert (log.scenario, log.seed, log.object_id, log.refused) == ("blind", 5, "bowl", "")
    assert [frame.index for frame in log.frames] == list(range(SCENES["blind"].frames))
    start = log.frames[:20]
    assert sum(frame.right for frame in start) >= 18
    posed = next(frame for frame in start if frame.tracking)
    assert posed.error_deg is not None
    assert posed.error_deg < 10  # of a bowl that looks the same from all around
    assert posed.evidence is not None
    assert {"score", "surface", "colour", "seen_through", "outside", "hidden", "explained"} <= set(posed.evidence)
    assert posed.sigma_rad is not None
    assert posed.sigma_m is not None
    assert (len(posed.sigma_rad), len(posed.sigma_m)) == (3, 3)
    assert max(posed.sigma_m) < 0.01
    assert not any(frame.jumped for frame in log.frames)
    assert all(frame.tracking_ms > 0 and frame.rendering_ms > 0 for frame in log.frames)


def test_frames_without_depth_are_out_of_sight_though_the_object_is_there(log: RunLog) -> None:
    blind = [frame for frame in log.frames if not frame.has_depth]
    assert len(blind) == 10
    assert min(frame.visible for frame in blind) > 0.9
    assert [delay.index for delay in losing_delays(log.frames)] == [blind[0].index]
    assert false_tracks(log.frames) == sum(frame.tracking for frame in blind)
    for frame in log.frames:
        assert (frame.error_m is None) == (not frame.tracking)


def test_an_object_of_which_no_model_can_be_made_is_refused_with_the_reason() -> None:
    refused = run_scenario(ScenarioRun("hand", 2, "64x64", 2, CARRIED))
    assert refused.frames == ()
    assert "pixels" in refused.refused


def test_scenarios_are_scenes_and_what_is_none_is_refused() -> None:
    assert set(SCENARIOS) <= set(SCENES)
    with pytest.raises(SourceError, match="kitchen"):
        run_scenario(ScenarioRun("kitchen", 0, "320x240", 2, CARRIED))
