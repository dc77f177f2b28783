"""Rows of the table of scenarios, from runs that were written down by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eval.scenarios.confidence import confidence_quality
from eval.scenarios.frame_log import FrameLog
from eval.scenarios.report import HEADINGS, confidence_line, cost_line, row, write_runs
from eval.scenarios.run import RunLog
from eval.scenarios.summary import pooled_frames, summarise

SEEN = FrameLog(0, 1.0, True, False, "tracking", 0.8, "", 0.002, 3.0, rendering_ms=40, tracking_ms=60)
SEEN_LOST = FrameLog(0, 1.0, True, False, "lost", 0.0, "", rendering_ms=40, tracking_ms=60)
HIDDEN, HIDDEN_TRACKED = replace(SEEN_LOST, visible=0.0), replace(SEEN, visible=0.0, error_m=0.5)
FAR = replace(SEEN, error_m=0.2, error_deg=33.0)


def run(*parts: tuple[FrameLog, int]) -> RunLog:
    frames = [frame for frame, count in parts for _ in range(count)]
    return RunLog("hidden", 0, "mug", [replace(frame, index=k) for k, frame in enumerate(frames)])


GOOD = run((SEEN, 4), (HIDDEN, 6), (SEEN_LOST, 2), (SEEN, 8))
BAD = run((SEEN, 4), (HIDDEN_TRACKED, 6), (FAR, 10))
REFUSED = RunLog("hidden", 2, "clamp", (), "too thin")


def test_shares_are_of_runs_and_delays_of_all_returns() -> None:
    found = summarise("hidden", [GOOD, BAD, REFUSED])
    assert (found.scenario, found.runs, found.refused) == ("hidden", 2, 1)
    assert (found.lost_in_time, found.never_astray, found.back_in_time) == (0.5, 0.5, 0.5)
    assert (found.false_tracks, found.false_tracks_worst) == (6, 6)
    assert (found.back_frames_median, found.back_frames_worst) == (np.inf, np.inf)
    assert found.found == pytest.approx((12 / 14 + 4 / 14) / 2)
    assert found.error_m == pytest.approx((16 * 0.002 + 10 * 0.2) / 26)
    assert found.error_deg == pytest.approx((16 * 3 + 10 * 33) / 26)
    assert summarise("hidden", [GOOD]).back_frames_median == 2


def test_what_does_not_happen_is_no_share_of_anything() -> None:
    calm = summarise("lights", [run((SEEN, 5))])
    assert (calm.lost_in_time, calm.back_in_time, calm.back_frames_median) == (None, None, None)
    nothing = summarise("lights", [REFUSED])
    assert (nothing.runs, nothing.never_astray, nothing.found, nothing.error_m) == (0, None, None, None)


def test_rows_have_a_cell_for_every_heading() -> None:
    bad = dict(zip(HEADINGS, row(summarise("hidden", [GOOD, BAD])), strict=True))
    assert bad == {
        "scenario": "hidden", "runs": "2", "lost": "50%", "firm": "50%", "back": "50%", "false": "6 (6)",
        "wait": "inf, inf", "found": "57%", "mm": "78.2", "deg": "14.5",
    }  # fmt: skip
    assert row(summarise("lights", [run((SEEN, 5))]))[2:7] == ["-", "100%", "-", "0 (0)", "-"]


def test_lines_tell_confidence_and_cost() -> None:
    told = confidence_line(confidence_quality(pooled_frames([GOOD, BAD])))
    assert "32 poses, 16 of them bad" in told
    assert "0.500 AUROC" in told
    assert "no AUROC" in confidence_line(confidence_quality([SEEN]))
    assert "rendering median 40 ms" in cost_line([GOOD])
    assert "no frame" in cost_line([REFUSED])


def test_the_file_holds_every_frame_and_is_json_to_anybody(tmp_path: Path) -> None:
    logs = [GOOD, BAD, REFUSED]
    quality = confidence_quality(pooled_frames(logs))
    write_runs(tmp_path / "runs.json", {"views": 4}, [summarise("hidden", logs)], quality, logs)
    content = json.loads((tmp_path / "runs.json").read_text(), parse_constant=pytest.fail)
    assert [len(each["frames"]) for each in content["runs"]] == [20, 20, 0]
    assert content["scenarios"][0]["back_frames_worst"] is None
    assert content["runs"][1]["frames"][5]["error_m"] == 0.5
    assert content["runs"][2]["refused"] == "too thin"
    assert content["confidence"]["auroc"] == 0.5
    assert content["protocol"] == {"views": 4}
