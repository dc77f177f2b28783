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
from tracker.in_order import SET_BACK, InOrder

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
    still = InOrder(frames([10, *[10] * (3 * SET_BACK), 20]))
    assert [frame.stamp_ns for frame in still] == [10, 20]
    assert still.refused == 3 * SET_BACK
