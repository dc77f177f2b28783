"""What is asked for from another thread is done between two frames, told, and bounded."""

from __future__ import annotations

import threading

import pytest

from tracker.errors import ConfigError
from tracker.pointing import Click, Pointer
from tracker.remote_control import MOST_WAITING, RemoteControl

LONG_S = 20.0


class Pointed:
    """Takes down what it is told, and knows no object called "unknown"."""

    def __init__(self) -> None:
        self.told: list[tuple[str, Pointer]] = []

    def point_out(self, object_id: str, there: Pointer) -> None:
        if object_id == "unknown":
            raise ConfigError("there is no model of object 'unknown'")
        self.told.append((object_id, there))


def test_it_waits_for_the_loop_and_is_done_in_order() -> None:
    remote, tracker = RemoteControl(), Pointed()
    asked = [remote.point_out("mug", Click(k, 2 * k)) for k in range(3)]
    assert not any(each.done() for each in asked)
    remote.carry_out(tracker)
    assert tracker.told == [("mug", Click(0, 0)), ("mug", Click(1, 2)), ("mug", Click(2, 4))]
    assert [each.result(0) for each in asked] == [None, None, None]
    remote.carry_out(tracker)
    assert len(tracker.told) == 3


def test_a_refusal_is_the_asker_s_and_the_loop_goes_on() -> None:
    remote, tracker = RemoteControl(), Pointed()
    refused, done = remote.point_out("unknown", Click(1, 1)), remote.point_out("mug", Click(1, 1))
    remote.carry_out(tracker)
    with pytest.raises(ConfigError, match="no model of object 'unknown'"):
        refused.result(0)
    assert done.result(0) is None


def test_what_is_no_refusal_ends_the_loop_and_is_told() -> None:
    class Broken:
        def point_out(self, object_id: str, there: Pointer) -> None:
            raise ZeroDivisionError(object_id, there)

    remote = RemoteControl()
    asked = remote.point_out("mug", Click(1, 1))
    with pytest.raises(ZeroDivisionError):
        remote.carry_out(Broken())
    with pytest.raises(ZeroDivisionError):
        asked.result(0)


def test_paused_the_loop_waits_and_still_does_what_is_asked() -> None:
    remote, tracker = RemoteControl(), Pointed()
    remote.pause(True)
    gone_on = threading.Event()
    loop = threading.Thread(target=lambda: (remote.carry_out(tracker), gone_on.set()))
    loop.start()
    remote.point_out("mug", Click(3, 4)).result(LONG_S)
    assert (remote.paused, gone_on.is_set(), tracker.told) == (True, False, [("mug", Click(3, 4))])
    remote.pause(False)
    assert gone_on.wait(LONG_S)
    loop.join()


def test_the_end_frees_the_loop_and_answers_who_waits_and_who_comes_later() -> None:
    remote, tracker = RemoteControl(), Pointed()
    waiting = remote.point_out("mug", Click(1, 1))
    remote.pause(True)
    remote.end("there are no more frames")
    remote.pause(True)
    remote.carry_out(tracker)
    later = remote.point_out("mug", Click(1, 1))
    for asked in (waiting, later):
        with pytest.raises(ConfigError, match="no more frames"):
            asked.result(0)
    assert tracker.told == []


def test_who_asks_faster_than_frames_come_is_refused() -> None:
    remote = RemoteControl()
    asked = [remote.point_out("mug", Click(1, 1)) for _ in range(MOST_WAITING + 1)]
    assert [each.done() for each in asked] == [False] * MOST_WAITING + [True]
    with pytest.raises(ConfigError, match="wait already"):
        asked[-1].result(0)
