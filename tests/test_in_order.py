"""Late frames and repeated stamps are left out and counted; a clock that was set back is told."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.errors import SourceError
from tracker.frame import Frame
from tracker.geometry import Intrinsics
from tracker.in_order import SET_BACK, SET_BACK_LIVE, InOrder

EMPTY = Frame(np.zeros((4, 4, 3), np.uint8), np.ones((4, 4), np.float32), Intrinsics(4, 4, 2, 2, 4, 4), 0)


def frames(stamps_ns: Sequence[int]) -> Iterator[Frame]:
    return (replace(EMPTY, stamp_ns=stamp, index=k) for k, stamp in enumerate(stamps_ns))


@given(st.lists(st.integers(0, 30), max_size=25))
def test_what_comes_out_goes_on_in_time_and_what_does_not_is_counted(stamps_ns: list[int]) -> None:
    ordered = InOrder(frames(stamps_ns))
    out = [frame.stamp_ns for frame in ordered]
    assert out == sorted(set(out))
    assert len(out) + ordered.refused == len(stamps_ns)
    assert max(out, default=-1) == max(stamps_ns, default=-1)


def test_dropped_repeated_and_swapped_frames() -> None:
    ordered = InOrder(frames([0, 10, 10, 20, 200, 190, 210]))
    assert [frame.index for frame in ordered] == [0, 1, 3, 4, 6]
    assert ordered.refused == 2


def test_a_clock_that_is_set_back_for_good_ends_it_and_one_that_stands_still_does_not() -> None:
    back = InOrder(frames([10**9, *range(2 * SET_BACK)]))
    with pytest.raises(SourceError, match=rf"clock went back from {10**9} ns and is at {SET_BACK - 1} ns"):
        list(back)
    live = InOrder(frames([10**9, *range(SET_BACK_LIVE - 1)]), live=True)  # one fewer than it takes
    assert [frame.stamp_ns for frame in live] == [10**9]
    still = InOrder(frames([10, *[10] * (3 * SET_BACK), 20]))
    assert [frame.stamp_ns for frame in still] == [10, 20]
    assert still.refused == 3 * SET_BACK


@pytest.mark.parametrize("begins_ns", [0, 7, 10**9 - 100])
def test_the_stamps_of_a_camera_whose_clock_begins_anew_go_on_by_the_time_that_has_passed(begins_ns: int) -> None:
    anew = [begins_ns + 10 * k for k in range(12)]
    hours_ns = iter(range(0, 10**12, 10**6))  # a millisecond from one look at the clock to the next
    ordered = InOrder(frames([10**9 - 10, 10**9, *anew]), live=True, now_ns=lambda: next(hours_ns))
    taken = list(ordered)
    assert ordered.refused == SET_BACK_LIVE - 1
    assert [frame.index for frame in taken] == [0, 1, *range(1 + SET_BACK_LIVE, 14)]
    stamps_ns = [frame.stamp_ns for frame in taken]
    assert stamps_ns[:3] == [10**9 - 10, 10**9, 10**9 + 10**6]
    assert set(np.diff(stamps_ns[2:])) == {10}
    assert np.array_equal(taken[3].rgb, EMPTY.rgb)


def test_a_camera_s_clock_may_begin_anew_twice_and_may_jump_forward_for_a_moment() -> None:
    jump = [0, 10, 10**12, *range(20, 20 + 10 * 9, 10)]
    again = [*range(0, 90, 10)]
    ordered = InOrder(frames([*jump, *again]), live=True)
    stamps_ns = [frame.stamp_ns for frame in ordered]
    assert stamps_ns == sorted(set(stamps_ns))
    assert len(stamps_ns) == len(jump) + len(again) - 2 * (SET_BACK_LIVE - 1)
