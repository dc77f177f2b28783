"""Result folders are whole or absent, what was there stays until it is replaced, and a result is a line of JSON."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from io import StringIO
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from tracker.confidence import Grounds
from tracker.errors import OutputError, SourceError
from tracker.frame import Frame, Provenance
from tracker.geometry import Intrinsics, Pose
from tracker.output import PoseLines, PoseOutput, as_json_line, require_free, result_folder
from tracker.result import Surface, TrackResult, TrackState
from tracker.verification import Evidence


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def write(path: Path, content: str, overwrite: bool = False, error: BaseException | None = None) -> None:
    """A run that writes one file, sees that nothing of it is at its place yet, and may fail then."""
    before = names(path) if path.is_dir() else None
    with result_folder(path, overwrite) as folder:
        (folder / "poses.jsonl").write_text(content)
        assert before == (names(path) if path.is_dir() else None)
        if error:
            raise error


@pytest.fixture
def earlier(tmp_path: Path) -> Path:
    """A folder that holds results."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "poses.jsonl").write_text("earlier")
    return tmp_path / "out"


def test_results_appear_all_at_once_when_they_are_complete(tmp_path: Path) -> None:
    out = tmp_path / "runs" / "first"
    with result_folder(out, overwrite=False) as folder:
        (folder / "poses.jsonl").write_text("one")
        assert not out.exists()
        (folder / "sub").mkdir()
        (folder / "sub" / "more.txt").write_text("two")
    assert (out / "poses.jsonl").read_text() == "one"
    assert (out / "sub" / "more.txt").read_text() == "two"
    assert names(out.parent) == ["first"]


def test_an_error_on_the_way_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="half-written"):
        write(tmp_path / "out", "one", error=SourceError("frame 7 is half-written"))
    assert names(tmp_path) == []


def test_what_a_killed_run_had_written_is_named_and_stays_and_what_another_one_writes_is_not(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    (tmp_path / f".out.{ended.pid}.partial").mkdir()
    (tmp_path / f".out.{os.getppid()}.partial").mkdir()
    (tmp_path / f".out.{os.getpid()}.partial").mkdir()  # of an earlier process of the same number
    write(tmp_path / "out", "one")
    assert names(tmp_path) == sorted([f".out.{ended.pid}.partial", f".out.{os.getppid()}.partial", "out"])
    (warning,) = caplog.messages
    assert f".out.{ended.pid}.partial" in warning


def test_results_that_are_there_are_not_overwritten_without_being_asked_to(earlier: Path) -> None:
    with pytest.raises(OutputError, match=f"{earlier} holds results already; .* --overwrite"):
        write(earlier, "later", error=AssertionError("the run has begun"))
    assert (earlier / "poses.jsonl").read_text() == "earlier"
    assert names(earlier.parent) == ["out"]


def test_overwriting_replaces_the_folder_as_a_whole(earlier: Path) -> None:
    with result_folder(earlier, overwrite=True) as folder:
        (folder / "scores.json").write_text("later")
        assert (earlier / "poses.jsonl").read_text() == "earlier"
    assert names(earlier) == ["scores.json"]
    assert names(earlier.parent) == ["out"]


@pytest.mark.parametrize("error", [SourceError("a damaged frame"), KeyboardInterrupt(), OSError(28, "No space left")])
def test_an_error_while_overwriting_leaves_what_was_there(earlier: Path, error: BaseException) -> None:
    with pytest.raises((SourceError, KeyboardInterrupt, OutputError)):
        write(earlier, "later", overwrite=True, error=error)
    assert (earlier / "poses.jsonl").read_text() == "earlier"
    assert names(earlier.parent) == ["out"]


def test_an_empty_folder_may_be_written_to(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    write(tmp_path / "out", "one")
    assert names(tmp_path / "out") == ["poses.jsonl"]
    assert names(tmp_path) == ["out"]


def test_a_place_where_no_folder_can_be_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("something else")
    with pytest.raises(OutputError, match="file exists already; give another name, or --overwrite"):
        write(tmp_path / "file", "results")
    for path, overwrite in ((tmp_path / "file" / "out", False), (tmp_path / "file", True)):
        with pytest.raises(OutputError, match=f"{path}: cannot be written"):
            write(path, "results", overwrite)
    assert (tmp_path / "file").read_text() == "something else"
    assert names(tmp_path) == ["file"]


def test_a_file_is_free_where_nothing_is_or_where_it_may_be_replaced(earlier: Path) -> None:
    require_free(earlier / "new.concept", overwrite=False)
    require_free(earlier / "poses.jsonl", overwrite=True)
    with pytest.raises(OutputError, match=r"poses\.jsonl exists already; give another name, or --overwrite"):
        require_free(earlier / "poses.jsonl", overwrite=False)


POSE = Pose.from_quaternion([np.sqrt(0.5), 0, 0, np.sqrt(0.5)], [0.1, 0.2, 0.3])
COVARIANCE = np.diag([1e-4] * 6)
TRACKED = TrackResult(
    stamp_ns=1_581_120_424_100_262_102,  # more digits than a float holds
    object_id="mug",
    pose=POSE,
    state=TrackState.TRACKING,
    confidence=0.87654321,
    covariance=COVARIANCE,
    reason="found by search",
    raw_pose=Pose.identity(),
    grounds=Grounds(Evidence(*[0.123456] * len(fields(Evidence))), 0.01, 0.03),
    timings_ms={"view": 1.23456, "total": 20.0},
)
LOST = TrackResult(33, "mug", None, TrackState.LOST, 0.0, None, "out of view", None, None, {"total": 0.5})


def test_a_tracked_frame_is_a_line_with_pose_state_and_evidence() -> None:
    line = as_json_line(TRACKED, 12)
    assert "\n" not in line
    content = json.loads(line)
    assert (content["frame"], content["stamp_ns"], content["object"]) == (12, 1_581_120_424_100_262_102, "mug")
    assert (content["state"], content["reason"], content["confidence"]) == ("tracking", "found by search", 0.8765)
    read = Pose.from_quaternion(content["T_cam_obj"]["quaternion_wxyz"], content["T_cam_obj"]["translation_m"])
    assert np.allclose(read.matrix, POSE.matrix, atol=1e-15)
    assert content["T_cam_obj_raw"] == {"quaternion_wxyz": [1, 0, 0, 0], "translation_m": [0, 0, 0]}
    assert content["covariance"] == COVARIANCE.tolist()
    assert content["evidence"] == {field.name: 0.1235 for field in fields(Evidence)}
    assert content["timings_ms"] == {"view": 1.23, "total": 20}


def test_a_lost_frame_has_a_reason_and_no_pose_at_all() -> None:
    content = json.loads(as_json_line(LOST, 3))
    assert (content["state"], content["reason"], content["confidence"]) == ("lost", "out of view", 0)
    for name in ("T_cam_obj", "T_cam_obj_raw", "covariance", "evidence"):
        assert content[name] is None


def lines_of(text: StringIO) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.getvalue().splitlines()]


def test_lines_go_to_every_text() -> None:
    texts = [StringIO(), StringIO()]
    lines = PoseLines(texts, {"mug": {}})
    lines.add(4, Provenance(), [TRACKED])
    lines.add(5, Provenance(), [LOST])
    assert lines_of(texts[0]) == lines_of(texts[1])
    assert [(line["frame"], line["state"]) for line in lines_of(texts[0])] == [(4, "tracking"), (5, "lost")]


class Taken:
    """A writer that remembers what it was given."""

    def __init__(self) -> None:
        self.frames: list[tuple[int, str, list[TrackResult]]] = []

    def add(self, frame_index: int, provenance: Provenance, results: Sequence[TrackResult]) -> None:
        self.frames.append((frame_index, provenance.name, list(results)))


def frame(index: int) -> Frame:
    camera = Intrinsics(60.0, 60.0, 23.5, 17.5, 48, 36)
    rgb, depth_m = np.zeros((36, 48, 3), np.uint8), np.zeros((36, 48), np.float32)
    return Frame(rgb, depth_m, camera, index, index=index, provenance=Provenance(name=f"picture{index}"))


def test_results_go_to_every_writer_as_they_come() -> None:
    writers = [Taken(), Taken()]
    output = PoseOutput(writers)
    output.add(frame(4), [TRACKED])
    assert writers[0].frames == [(4, "picture4", [TRACKED])]
    output.add(frame(5), [LOST])
    output.finish()
    assert writers[0].frames == writers[1].frames == [(4, "picture4", [TRACKED]), (5, "picture5", [LOST])]


def test_smoothed_results_come_at_the_end_once_and_the_same_to_every_writer() -> None:
    cup = replace(TRACKED, object_id="cup")
    writers = [Taken(), Taken()]
    output = PoseOutput(writers, smooth="offline")
    for index, results in ((4, [TRACKED, cup]), (5, [LOST, cup])):
        output.add(frame(index), results)
    assert writers[0].frames == []
    output.finish()
    output.finish()
    told = [
        [(index, name, [(r.object_id, r.state) for r in results]) for index, name, results in writer.frames]
        for writer in writers
    ]
    mug, tracking = ("mug", TrackState.TRACKING), TrackState.TRACKING
    lost = ("mug", TrackState.LOST)
    assert told[0] == [(4, "picture4", [mug, ("cup", tracking)]), (5, "picture5", [lost, ("cup", tracking)])]
    assert told[1] == told[0]


def test_while_waiting_for_the_end_surfaces_are_held_only_where_they_are_asked_for() -> None:
    surface = cast("Surface", object())
    mug, cup = replace(TRACKED, surface=surface), replace(TRACKED, object_id="cup", surface=surface)
    writer = Taken()
    output = PoseOutput([writer], smooth="offline", located=["cup"])
    output.add(frame(0), [mug, cup])
    output.finish()
    assert [result.surface for result in writer.frames[0][2]] == [None, surface]
