"""The runs as a table for a terminal, and as JSON with every frame."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from eval.environment import environment
from eval.scenarios.confidence import ConfidenceQuality
from eval.scenarios.run import RunLog
from eval.scenarios.summary import ScenarioSummary, pooled_frames
from tracker.whole_file import write_whole

LEGEND = (
    "Percent of the runs. lost: no pose within 3 frames of losing sight of the object. firm: never more than 3 frames "
    "in a row with a pose over 5 cm off. back: tracked again within 5 frames of half of it being in sight. false: "
    "frames with a pose while it is out of sight, of all runs (of the worst). wait: frames until it is tracked again, "
    "median and worst; inf: not before the end. found: percent of the frames with half of it in sight in which it is "
    "tracked within 5 cm. mm, deg: mean error while it is tracked and in sight. -: does not happen in this scenario."
)
HEADINGS = ("scenario", "runs", "lost", "firm", "back", "false", "wait", "found", "mm", "deg")


def table(summaries: Sequence[ScenarioSummary], title: str) -> Table:
    out = Table(title=title, caption=LEGEND, caption_justify="left", box=SIMPLE_HEAD, padding=(0, 0), pad_edge=False)
    for heading in HEADINGS:
        out.add_column(heading, justify="left" if heading == "scenario" else "right", no_wrap=True)
    for each in summaries:
        out.add_row(*row(each))
    return out


def row(each: ScenarioSummary) -> list[str]:
    wait = "-" if each.back_frames_median is None else f"{each.back_frames_median:g}, {each.back_frames_worst:g}"
    return [
        each.scenario,
        str(each.runs),
        *(_percent(share) for share in (each.lost_in_time, each.never_astray, each.back_in_time)),
        f"{each.false_tracks} ({each.false_tracks_worst})",
        wait,
        _percent(each.found),
        "-" if each.error_m is None else f"{1000 * each.error_m:.1f}",
        "-" if each.error_deg is None else f"{each.error_deg:.1f}",
    ]


def confidence_line(quality: ConfidenceQuality) -> str:
    area = "no" if quality.auroc is None else f"{quality.auroc:.3f}"
    calibration = "no" if quality.reliability is None else f"{quality.reliability.calibration_error:.3f}"
    return (
        f"confidence: {quality.poses} poses, {quality.bad} of them bad (over 2 cm or 10 degrees, or out of sight); "
        f"{area} AUROC, {calibration} expected calibration error"
    )


def cost_line(logs: Sequence[RunLog]) -> str:
    frames = pooled_frames(logs)
    if not frames:
        return "no frame was tracked"
    rendering, tracking = (np.array([getattr(f, f"{what}_ms") for f in frames]) for what in ("rendering", "tracking"))
    return (
        f"a frame: rendering median {np.median(rendering):.0f} ms, mean {rendering.mean():.0f}; tracking median "
        f"{np.median(tracking):.0f} ms, p95 {np.percentile(tracking, 95):.0f}"
    )


def write_runs(
    path: Path,
    protocol: Mapping[str, object],
    summaries: Sequence[ScenarioSummary],
    quality: ConfidenceQuality,
    logs: Sequence[RunLog],
) -> None:
    """Everything as JSON, whole or not at all; what is infinite or no number is null. Raises OutputError."""
    content = {
        "protocol": dict(protocol),
        "scenarios": [asdict(each) for each in summaries],
        "confidence": asdict(quality),
        "environment": environment(),
        "runs": [asdict(log) for log in logs],
    }
    write_whole(path, json.dumps(_finite(content), allow_nan=False) + "\n")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f}%"
