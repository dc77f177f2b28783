"""Handing over between threads: order, the bound, who waits, and how it ends."""

from __future__ import annotations

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.handover import Handover

LONG_S = 20.0


@given(capacity=st.integers(1, 4), count=st.integers(0, 12))
def test_the_newest_are_kept_in_their_order_and_the_others_are_counted(capacity: int, count: int) -> None:
    door: Handover[int] = Handover(capacity, newest=True)
    for k in range(count):
        door.put(k)
    door.end()
    taken = []
    while not door.ended:
        taken.append(door.get(LONG_S))
    assert taken == list(range(count))[-capacity:]
    assert door.dropped == count - len(taken)


def test_a_giver_that_waits_for_room_loses_nothing() -> None:
    door: Handover[int] = Handover(2, newest=False)

    def give() -> None:
        for k in range(50):
            door.put(k)
        door.end()

    giver = threading.Thread(target=give)
    giver.start()
    taken = []
    while not door.ended:
        taken.append(door.get(LONG_S))
    giver.join(LONG_S)
    assert [k for k in taken if k is not None] == list(range(50))
    assert door.dropped == 0


def test_who_waits_goes_on_when_it_ends() -> None:
    door: Handover[int] = Handover(1, newest=False)
    door.put(1)
    giver = threading.Thread(target=door.put, args=(2,))
    giver.start()
    door.end()
    giver.join(LONG_S)
    assert not giver.is_alive()
    assert (door.get(LONG_S), door.get(LONG_S), door.ended) == (1, None, True)
    empty: Handover[int] = Handover(1, newest=True)
    taker = threading.Thread(target=empty.get, args=(LONG_S * 10,))
    taker.start()
    empty.end()
    taker.join(LONG_S)
    assert not taker.is_alive()


def test_what_the_giver_ended_with_is_raised_after_what_it_gave() -> None:
    door: Handover[int] = Handover(2, newest=True)
    door.put(1)
    door.end(ValueError("broken"))
    door.end()
    assert door.get(LONG_S) == 1
    for _ in range(2):
        with pytest.raises(ValueError, match="broken"):
            door.get(LONG_S)


def test_nothing_in_time_is_none_and_not_the_end() -> None:
    door: Handover[int] = Handover(1, newest=True)
    assert door.get(0.0) is None
    assert not door.ended
