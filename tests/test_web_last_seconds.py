"""What is saved is read again as it was seen, and nothing grows without bound."""

from __future__ import annotations

import threading
import zipfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
import pytest

import tracker.web.last_seconds
from tracker.errors import OutputError
from tracker.frame import Frame
from tracker.sources import open_source
from tracker.web.last_seconds import WAITING, LastSeconds, compressed, zipped

SECOND_NS = 1_000_000_000


def stamped(frame: Frame, seconds: float) -> Frame:
    return replace(frame, stamp_ns=round(seconds * SECOND_NS))


def kept(frames: list[Frame], **bounds: float) -> LastSeconds:
    """After all of them are compressed, none left out."""
    ring = LastSeconds(**bounds)  # pyright: ignore[reportArgumentType]
    for k, frame in enumerate(frames):
        ring.put(frame)
        while k % WAITING == WAITING - 1 and ring.extent().frames == 0:
            threading.Event().wait(0.005)
    ring.close()
    return ring


def test_what_is_saved_is_a_folder_that_is_read_again(can_frames: list[Frame], tmp_path: Path) -> None:
    seen = can_frames[:4]
    ring = kept(seen)
    archive = BytesIO(b"".join(zipped(ring.held(), "recording")))
    with zipfile.ZipFile(archive) as opened:
        assert opened.testzip() is None
        opened.extractall(tmp_path)
    again = list(open_source(f"folder:{tmp_path / 'recording'}"))
    assert [frame.stamp_ns for frame in again] == [frame.stamp_ns for frame in seen]
    for before, after in zip(seen, again, strict=True):
        assert after.intrinsics == before.intrinsics
        assert np.abs(after.depth_m - before.depth_m).max() <= 0.0005001
        assert ((after.depth_m > 0) == (before.depth_m > 0)).all()
        off = np.abs(after.rgb.astype(int) - before.rgb)
        assert off.mean() < 3  # of sensor noise; were red blue, it would be tens
    assert (ring.extent().frames, ring.extent().left_out) == (4, 0)
    assert ring.extent().seconds == pytest.approx((seen[-1].stamp_ns - seen[0].stamp_ns) / 1e9)


def test_depth_that_the_layout_cannot_hold_is_none(can_frames: list[Frame]) -> None:
    depth_m = can_frames[0].depth_m.copy()
    depth_m[:2] = 66.0
    held = compressed(replace(can_frames[0], depth_m=depth_m))
    raw = cv2.imdecode(np.frombuffer(held.depth, np.uint8), cv2.IMREAD_UNCHANGED)
    assert raw is not None
    assert (raw[:2] == 0).all()
    assert raw[2:].any()


def test_only_the_last_seconds_are_held(can_frames: list[Frame]) -> None:
    ring = kept([stamped(can_frames[0], 0.5 * k) for k in range(8)], seconds=1.2)
    assert [held.stamp_ns / SECOND_NS for held in ring.held()] == [2.5, 3.0, 3.5]


def test_memory_is_bounded_whatever_the_seconds(can_frames: list[Frame]) -> None:
    size = compressed(can_frames[0]).size
    ring = kept([stamped(can_frames[0], 0.1 * k) for k in range(8)], seconds=60, most_bytes=int(3.5 * size))
    assert [held.stamp_ns / SECOND_NS for held in ring.held()] == pytest.approx([0.5, 0.6, 0.7])
    assert ring.extent().megabytes == pytest.approx(3 * size / 1e6)


def test_the_giver_never_waits_and_what_there_was_no_time_for_is_counted(
    can_frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on, real = threading.Event(), compressed

    def slow(frame: Frame) -> object:
        go_on.wait(20)
        return real(frame)

    monkeypatch.setattr(tracker.web.last_seconds, "compressed", slow)
    ring = LastSeconds()
    for k in range(3 * WAITING):
        ring.put(stamped(can_frames[0], k / 30))
    go_on.set()
    ring.close()
    extent = ring.extent()
    assert extent.left_out >= 2 * WAITING - 1
    assert extent.frames + extent.left_out == 3 * WAITING


def test_another_camera_begins_another_recording(can_frames: list[Frame]) -> None:
    other = replace(can_frames[1], intrinsics=replace(can_frames[1].intrinsics, fx=320.0))
    ring = kept([can_frames[0], other])
    assert [held.intrinsics.fx for held in ring.held()] == [320.0]


def test_nothing_is_no_recording() -> None:
    with pytest.raises(OutputError, match="no frame yet"):
        list(zipped([], "a"))


def test_the_zip_is_made_piece_by_piece(can_frames: list[Frame]) -> None:
    held = [compressed(stamped(can_frames[0], k)) for k in range(5)]
    pieces = list(zipped(held, "a"))
    assert max(map(len, pieces)) < 2 * held[0].size
