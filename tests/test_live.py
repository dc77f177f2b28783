"""A camera before the tracker and its command: what is dropped, what goes wrong, and what is kept of it."""

from __future__ import annotations

import json
import logging
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tracker.__main__
import tracker.sources
import tracker.sources.realsense
from tests.live_camera import LiveCamera
from tests.software_camera import SoftwareCamera
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import SourceError
from tracker.first_masks import FirstMasks
from tracker.frame import Frame
from tracker.in_order import InOrder
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult, TrackState
from tracker.saliency import SaliencyBackend
from tracker.sources import open_source
from tracker.sources.synthetic import SyntheticScene
from tracker.sources.synthetic.faults import without_depth

Run = Callable[..., tuple[int, str]]


@pytest.fixture
def run(can_file: Path, program: Callable[..., tuple[int, str]]) -> Run:
    """`python -m tracker` in this process: its exit code and what it says."""
    return lambda source, *options: program(tracker.__main__.main, source, "--model", can_file, *options)


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch) -> LiveCamera:
    """What every source's name opens."""
    live = LiveCamera()
    monkeypatch.setattr(tracker.sources, "open_source", lambda _: live)
    return live


def lines(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "poses.jsonl").read_text().splitlines()]


def test_every_frame_is_tracked_or_counted_and_the_latency_is_told(
    run: Run, camera: LiveCamera, can_frames: list[Frame], tmp_path: Path
) -> None:
    camera.show(*can_frames, None)
    code, said = run("realsense", "--out", tmp_path / "out")
    assert code == 0, said
    tracked = lines(tmp_path / "out")
    dropped = len(can_frames) - len(tracked)
    assert dropped == 0 or f"{dropped} frames dropped: newer ones had come" in said
    assert tracked[-1]["frame"] == can_frames[-1].index
    assert {line["state"] for line in tracked} == {"tracking"}
    assert "ms after its arrival (median; 95 %:" in said


@pytest.mark.parametrize("ending", ["ctrl-C", "SIGTERM", "camera gone"])
def test_a_run_that_ends_early_keeps_what_was_tracked_and_leaves_no_thread(
    ending: str, run: Run, camera: LiveCamera, can_frames: list[Frame], tmp_path: Path
) -> None:
    before = threading.active_count()
    camera.show(can_frames[0])

    def end() -> None:
        for _ in range(4000):
            if lines_of(tmp_path):
                break
            threading.Event().wait(0.005)
        if ending != "camera gone":
            os.kill(os.getpid(), signal.SIGINT if ending == "ctrl-C" else signal.SIGTERM)
        else:
            camera.show(SourceError("camera:7: the camera is gone for 60.0 s"))

    other = threading.Thread(target=end)
    other.start()
    code, said = run("realsense", "--out", tmp_path / "out", "--view", "overlay")
    other.join()
    assert (code, "stopped" in said) == ((0, True) if ending != "camera gone" else (1, False)), said
    assert ("the camera is gone" in said) == (ending == "camera gone")
    assert len(lines(tmp_path / "out")) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert threading.active_count() == before


def lines_of(folder: Path) -> str:
    """What has been written of the poses by now, while the folder is still being made."""
    return "".join(path.read_text() for path in folder.glob("**/poses.jsonl"))


def test_a_camera_is_recorded_while_it_is_tracked_and_the_recording_is_tracked_alike(
    run: Run, can_frames: list[Frame], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    software = SoftwareCamera(can_frames[0].intrinsics)
    monkeypatch.setattr(tracker.sources.realsense, "Finder", lambda *_: lambda: software.device)
    file = tmp_path / "can.db3"

    def show() -> None:
        software.wait_until_open()
        for frame in can_frames[:6]:
            software.show_frame(frame, frame.stamp_ns / 1e6)
            threading.Event().wait(0.05)
        for _ in range(4000):  # until the last one is tracked
            if '"frame": 5' in lines_of(tmp_path):
                break
            threading.Event().wait(0.005)
        os.kill(os.getpid(), signal.SIGINT)

    other = threading.Thread(target=show)
    other.start()
    code, said = run("realsense", "--record", file, "--out", tmp_path / "live")
    other.join()
    assert (code, "stopped" in said) == (0, True), said
    played = list(open_source(f"realsense:{file}"))
    assert [frame.stamp_ns for frame in played] == [frame.stamp_ns for frame in can_frames[:6]]
    assert lines(tmp_path / "live")[-1]["stamp_ns"] == played[-1].stamp_ns
    assert np.array_equal(played[3].rgb, can_frames[3].rgb)
    code, said = run("realsense", "--record", file)
    assert code == 1
    assert "can.db3 exists already; give another name, or --overwrite" in said
    code, said = run(f"realsense:{file}", "--out", tmp_path / "played")
    assert code == 0, said
    assert [line["frame"] for line in lines(tmp_path / "played")] == list(range(6))


@pytest.mark.parametrize("source", ["synthetic:still?size=160x120&frames=3"])
def test_what_is_no_camera_is_not_recorded(source: str, run: Run, tmp_path: Path) -> None:
    code, said = run(source, "--record", tmp_path / "a.db3")
    assert code == 1
    assert f"{source} cannot be recorded; expected a camera: realsense or realsense:SERIAL" in said
    assert list(tmp_path.iterdir()) == []


def test_without_masks_there_has_to_be_a_prior(run: Run) -> None:
    code, said = run("realsense", "--prior", "off")
    assert code == 1
    assert "realsense has no masks, so the tracker carries them on: it needs --prior on" in said


# Faults


@pytest.fixture
def track(can_model: ConceptModel, attributes: SaliencyBackend) -> Callable[[Sequence[Frame]], list[TrackResult]]:
    """The results of what a camera shows, pointed out in the first frame alone."""

    def run_through(frames: Sequence[Frame]) -> list[TrackResult]:
        follow, first = ObjectTracker(can_model, TrackerConfig(masks="carried"), attributes), FirstMasks()
        return [follow.step(first(frame))[0] for frame in InOrder(frames, live=True)]

    return run_through


def states(results: Sequence[TrackResult]) -> Iterator[str]:
    for result in results:
        assert (result.pose is None) == (result.state is not TrackState.TRACKING)
        assert result.state is TrackState.TRACKING or result.reason
        yield result.state.value


def test_repeated_stamps_and_a_clock_that_begins_anew_cost_frames_and_not_the_object(
    track: Callable[[Sequence[Frame]], list[TrackResult]],
    can_frames: list[Frame],
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.WARNING)
    began_ns = can_frames[4].stamp_ns
    anew = [replace(frame, stamp_ns=frame.stamp_ns - began_ns) for frame in can_frames[4:]]
    results = track([*can_frames[:4], can_frames[3], can_frames[3], *anew])
    assert set(states(results)) == {"tracking"}
    assert len(results) == 4 + len(anew) - 4
    assert "the clock went back; from here on its stamps count" in caplog.text


def test_after_a_long_gap_the_object_is_where_it_is_now_or_lost(
    track: Callable[[Sequence[Frame]], list[TrackResult]], can_scene: SyntheticScene, can_frames: list[Frame]
) -> None:
    """What an unplugged camera looks like from behind: ten seconds without a frame, and the can is elsewhere."""
    later = [can_scene[index] for index in range(50, 58)]
    results = track([*can_frames[:4], *(replace(f, stamp_ns=f.stamp_ns + 10**10) for f in later)])
    told = list(states(results))
    assert told[:4] == ["tracking"] * 4
    assert told[-1] == "tracking"
    truth = {s.index: s.T_cam_obj for s in can_scene.sightings("soup_can")}
    for frame, result in zip(later, results[4:], strict=True):
        if result.pose:
            assert result.pose.distance_to_m(truth[frame.index]) < 0.02


def test_without_depth_the_object_is_lost_with_a_reason_and_found_again(
    track: Callable[[Sequence[Frame]], list[TrackResult]], can_frames: list[Frame]
) -> None:
    blind = [without_depth(frame) if 3 <= k < 6 else frame for k, frame in enumerate(can_frames)]
    told = list(states(track(blind)))
    assert told[:3] == ["tracking"] * 3
    assert set(told[3:6]) == {"lost"}
    assert told[-1] == "tracking"


def test_half_a_picture_and_a_wrong_camera_matrix_have_a_state_and_no_crash(
    track: Callable[[Sequence[Frame]], list[TrackResult]], can_frames: list[Frame]
) -> None:
    rgb, depth_m = can_frames[4].rgb.copy(), can_frames[4].depth_m.copy()
    rgb[120:], depth_m[120:] = 0, 0
    half = replace(can_frames[4], rgb=rgb, depth_m=depth_m)
    assert list(states(track([*can_frames[:4], half, *can_frames[5:]])))[-1] == "tracking"
    camera = can_frames[0].intrinsics
    wrong = replace(camera, fx=camera.fx * 1.6, fy=camera.fy * 1.6)
    told = track([replace(frame, intrinsics=wrong) for frame in can_frames[:4]])
    assert len(list(states(told))) == 4
