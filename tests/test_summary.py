"""What is told at the end of a run."""

from __future__ import annotations

import io
from dataclasses import replace

import pytest
from rich.console import Console
from rich.table import Table

import tracker.summary
from tracker.geometry import Pose
from tracker.result import TrackResult, TrackState
from tracker.summary import Summary, tell_left_out


def result(object_id: str, state: TrackState, total_ms: float) -> TrackResult:
    lost = TrackResult(
        stamp_ns=0, object_id=object_id, pose=None, state=state, confidence=0.0, covariance=None, reason="out of view",
        raw_pose=None, grounds=None, timings_ms={"total": total_ms},
    )  # fmt: skip
    return replace(lost, pose=Pose.identity(), confidence=0.9) if state is TrackState.TRACKING else lost


def text(table: Table) -> str:
    console = Console(file=io.StringIO(), width=100)
    console.print(table)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.fixture
def summary() -> Summary:
    summary = Summary()
    summary.add([result("mug", TrackState.TRACKING, 10.0), result("can", TrackState.LOST, 300.0)])
    summary.add([result("mug", TrackState.TRACKING, 12.0), result("can", TrackState.TRACKING, 9.0)])
    summary.add([result("mug", TrackState.LOST, 41.0), result("can", TrackState.TRACKING, 9.5)])
    return summary


def test_what_is_now_is_of_the_last_frame(summary: Summary) -> None:
    assert sorted(summary.now().split(", ")) == ["1 lost", "1 tracking"]
    assert Summary().now() == ""


def test_a_row_an_object_with_its_median_time(summary: Summary) -> None:
    rows = [line.split("│") for line in text(summary.table("its stamp")).splitlines() if "│" in line]
    cells = [[cell.strip() for cell in row if cell.strip()] for row in rows]
    assert cells == [["mug", "3", "2", "1", "12.0"], ["can", "3", "2", "1", "9.5"]]


def test_a_latency_is_told_of_a_camera_alone(summary: Summary) -> None:
    assert "comes" not in text(summary.table("its stamp"))
    summary.latencies_ms.extend((20.0, 30.0, 40.0))
    told = " ".join(text(summary.table("its arrival")).split())
    assert "a frame's result comes 30 ms after its arrival (median; 95 %: 39 ms)" in told


def test_only_what_was_left_out_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    console = Console(file=io.StringIO(), width=200)
    monkeypatch.setattr(tracker.summary, "ALWAYS", console)
    tell_left_out(0, {"dropped": 0}, 0)
    assert isinstance(console.file, io.StringIO)
    assert console.file.getvalue() == ""
    tell_left_out(2, {"dropped": 3}, 0)
    assert [line.split()[0] for line in console.file.getvalue().splitlines()] == ["2", "3"]
