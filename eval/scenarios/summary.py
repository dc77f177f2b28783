"""The runs of a scenario as one row of numbers, JSON-ready."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eval.scenarios.criteria import (
    ASTRAY_AT_MOST,
    Delay,
    false_tracks,
    finding_delays,
    found_share,
    longest_astray,
    losing_delays,
)
from eval.scenarios.frame_log import FrameLog
from eval.scenarios.run import RunLog


@dataclass(frozen=True, slots=True)
class ScenarioSummary:
    """Shares are of the runs to which they apply, in [0, 1]; None where there is none.

    runs: that could be run. refused: of whose object no model could be made. lost_in_time: there is no pose within 3
    frames of losing sight. never_astray: at no time more than 3 frames in a row with a pose more than 5 cm off.
    back_in_time: tracked again within 5 frames of half the object being in sight. false_tracks, false_tracks_worst:
    frames with a pose while the object is out of sight, of all runs and of the worst. back_frames_median,
    back_frames_worst: frames until it is tracked again, over all returns; infinite where that never comes. found: share
    of the frames with half of the object in sight in which it is tracked, at most 5 cm off. error_m, error_deg: means
    over the frames in which it is tracked and in sight.
    """

    scenario: str
    runs: int
    refused: int
    lost_in_time: float | None
    never_astray: float | None
    back_in_time: float | None
    false_tracks: int
    false_tracks_worst: int
    back_frames_median: float | None
    back_frames_worst: float | None
    found: float | None
    error_m: float | None
    error_deg: float | None


def summarise(scenario: str, logs: Sequence[RunLog]) -> ScenarioSummary:
    """Of the runs of one scenario."""
    runs = [log.frames for log in logs if not log.refused]
    losing, finding = [losing_delays(frames) for frames in runs], [finding_delays(frames) for frames in runs]
    back = [np.inf if delay.frames is None else delay.frames for delays in finding for delay in delays]
    false = [false_tracks(frames) for frames in runs]
    found = [share for frames in runs if (share := found_share(frames)) is not None]
    seen = [frame for frames in runs for frame in frames if frame.tracking and frame.in_sight]
    return ScenarioSummary(
        scenario=scenario,
        runs=len(runs),
        refused=len(logs) - len(runs),
        lost_in_time=_share_in_time(losing),
        never_astray=_mean([longest_astray(frames) <= ASTRAY_AT_MOST for frames in runs]),
        back_in_time=_share_in_time(finding),
        false_tracks=sum(false),
        false_tracks_worst=max(false, default=0),
        back_frames_median=float(np.median(back)) if back else None,
        back_frames_worst=max(back, default=None),
        found=_mean(found),
        error_m=_mean([frame.error_m for frame in seen if frame.error_m is not None]),
        error_deg=_mean([frame.error_deg for frame in seen if frame.error_deg is not None]),
    )


def pooled_frames(logs: Sequence[RunLog]) -> list[FrameLog]:
    return [frame for log in logs for frame in log.frames]


def _share_in_time(delays_of_runs: Sequence[Sequence[Delay]]) -> float | None:
    """Of the runs with such an event, those in which every one is answered in time."""
    return _mean([all(delay.in_time for delay in delays) for delays in delays_of_runs if delays])


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None
