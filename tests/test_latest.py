"""The newest frame wins: what is dropped, what is told, and that the thread always ends."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.live_camera import LiveCamera
from tracker.errors import SourceError
from tracker.frame import Frame, Provenance
from tracker.geometry import Intrinsics
from tracker.latest import Latest
from tracker.sources import LiveSource

EMPTY = Frame(np.zeros((4, 4, 3), np.uint8), np.ones((4, 4), np.float32), Intrinsics(4, 4, 2, 2, 4, 4), 0)


def frame(index: int, clock: str = "hardware_clock", stamp_ns: int | None = None) -> Frame:
    stamp_ns = index * 10 if stamp_ns is None else stamp_ns
    return replace(EMPTY, index=index, stamp_ns=stamp_ns, provenance=Provenance("camera:7", clock))


@pytest.fixture(autouse=True)
def _no_thread_is_left() -> object:
    before = threading.active_count()
    yield
    assert threading.active_count() == before


def test_a_slow_tracker_gets_the_newest_frame_each_time_and_the_others_are_counted() -> None:
    camera = LiveCamera()
    assert isinstance(camera, LiveSource)
    taken = []
    with Latest(camera) as latest:
        frames = iter(latest)
        for step in range(6):
            camera.show(*(frame(5 * step + k) for k in range(5))).all_read()
            taken.append(next(frames).index)
    assert taken == [4, 9, 14, 19, 24, 29]
    assert latest.dropped == 6 * 4
    assert [count for what, count in latest.left_out.items() if what.startswith("dropped")] == [6 * 4]


def test_a_tracker_that_is_fast_enough_gets_all_of_them() -> None:
    camera = LiveCamera()
    with Latest(camera) as latest:
        frames = iter(latest)
        taken = [next(frames).index for k in range(20) if camera.show(frame(k))]
        camera.show(None)
        assert list(frames) == []
    assert taken == list(range(20))
    assert latest.dropped == 0


def test_what_ends_the_camera_reaches_the_tracker_after_the_last_frame() -> None:
    camera = LiveCamera().show(frame(0), SourceError("camera:7 is gone"))
    with Latest(camera) as latest:
        camera.all_read()
        frames = iter(latest)
        assert next(frames).index == 0
        with pytest.raises(SourceError, match="camera:7 is gone"):
            next(frames)
    with Latest(LiveCamera().show(ZeroDivisionError("a bug"))) as latest, pytest.raises(ZeroDivisionError):
        list(latest)


@pytest.mark.parametrize("how", [KeyboardInterrupt, SourceError])
def test_the_thread_ends_however_the_tracker_does(how: type[BaseException]) -> None:
    camera = LiveCamera().show(frame(0))
    with pytest.raises(how), Latest(camera) as latest:
        raise how if next(iter(latest)).index == 0 else ZeroDivisionError


def test_a_camera_that_says_nothing_is_named_and_stopped(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    camera = LiveCamera()
    with Latest(camera, silence_s=0.05) as latest:
        frames = iter(latest)
        waiting = threading.Thread(target=lambda: (_until(lambda: len(caplog.records) > 1), camera.show(frame(3))))
        waiting.start()
        assert next(frames).index == 3
        waiting.join()
    assert all(record.message.startswith("camera:7 has shown nothing for") for record in caplog.records)


def _until(done: Callable[[], bool]) -> None:
    for _ in range(2000):
        if done():
            return
        time.sleep(0.005)


def test_latency_counts_from_the_stamp_where_this_is_of_the_machine_s_clock_and_else_from_the_arrival() -> None:
    long_ago_ns = time.time_ns() - 3600 * 10**9
    for clock, stamped in (("global_time", True), ("system_time", True), ("hardware_clock", False), ("nominal", False)):
        camera = LiveCamera().show(frame(0, clock, long_ago_ns))
        with Latest(camera) as latest:
            assert latest.latency_ms() == 0.0
            next(iter(latest))
            assert latest.stamped == stamped
            assert (latest.latency_ms() > 3_599_000) == stamped
            assert latest.latency_ms() > 0
