"""Pairs of two streams: the nearest, each message once, in order, whatever is dropped, late or in disorder."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.sources.approximate_time import MOST_WAITING, Pair, Pairing, pair_stamps, paired

PERIOD = 33
stamps = st.lists(st.integers(0, 300), max_size=15, unique=True)


def both(first: list[int], second: list[int], slop: int) -> list[tuple[int, int]]:
    """The stamps of the pairs."""
    return [(first[a], second[b]) for a, b in pair_stamps(first, second, slop)]


@given(first=stamps, second=stamps, slop=st.integers(0, 60))
def test_pairs_are_near_in_order_and_of_messages_that_are_used_once(
    first: list[int], second: list[int], slop: int
) -> None:
    pairs = both(first, second, slop)
    assert all(abs(a - b) <= slop for a, b in pairs)
    assert all(a < c and b < d for (a, b), (c, d) in pairwise(pairs))


@given(first=stamps, second=stamps, slop=st.integers(0, 60))
def test_two_that_are_each_other_s_nearest_are_a_pair(first: list[int], second: list[int], slop: int) -> None:
    def nearest(stamp: int, others: list[int]) -> list[int]:
        least = min((abs(stamp - other) for other in others), default=slop + 1)
        return [other for other in others if abs(stamp - other) == least <= slop]

    pairs = both(first, second, slop)
    for a in first:
        for b in second:
            if nearest(a, second) == [b] and nearest(b, first) == [a]:
                assert (a, b) in pairs


@given(first=stamps, second=stamps, slop=st.integers(0, 60))
def test_it_is_the_same_whichever_stream_is_the_first(first: list[int], second: list[int], slop: int) -> None:
    def apart(pairs: list[tuple[int, int]]) -> list[int]:
        return [abs(a - b) for a, b in pairs]

    # Where two are as near as each other the earlier is taken, so the distances are the same.
    assert apart(both(first, second, slop)) == apart(both(second, first, slop))


@pytest.mark.parametrize("skew", [-15, -5, 0, 5, 15])
def test_a_skew_below_half_a_period_and_drops_on_both_sides_leave_the_right_pairs(skew: int) -> None:
    first = [1000 + PERIOD * k for k in range(20) if k not in (3, 4, 11)]
    second = [1000 + PERIOD * k + skew for k in range(20) if k not in (0, 4, 12)]
    expected = [1000 + PERIOD * k for k in range(20) if k not in (0, 3, 4, 11, 12)]
    assert both(first, second, 16) == [(stamp, stamp + skew) for stamp in expected]


def test_a_faster_stream_gives_each_of_the_slower_its_nearest() -> None:
    fast = list(range(0, 200, 10))
    assert both(fast, [22, 88, 141], 20) == [(20, 22), (90, 88), (140, 141)]


def test_messages_in_disorder_are_put_in_order_as_far_as_they_wait() -> None:
    messages = [(0, 0, "a0"), (0, 66, "a2"), (0, 33, "a1"), (1, 34, "b1"), (1, 1, "b0"), (0, 99, "a3"), (1, 67, "b2")]
    found = list(paired(messages, Pairing[str](10, reorder=2)))
    assert [(pair.first, pair.second) for pair in found] == [("a0", "b0"), ("a1", "b1"), ("a2", "b2")]
    hasty = Pairing[str](10)
    assert [pair.first for pair in paired(messages, hasty)] == ["a2"]
    assert (hasty.late, hasty.unpaired) == ([1, 1], [2, 1])


def test_what_is_sent_twice_counts_once() -> None:
    pairing = Pairing[str](10, reorder=3)
    messages = [(0, 0, "a"), (0, 0, "again"), (1, 0, "b"), (0, 33, "c"), (1, 33, "d")]
    assert [pair.first for pair in paired(messages, pairing)] == ["a", "c"]
    assert (pairing.late, pairing.unpaired) == ([1, 0], [0, 0])


def test_a_pair_is_told_as_soon_as_no_other_can_be_nearer() -> None:
    waiting = Pairing[str](10)
    assert waiting.add(0, 100, "a") == []
    assert waiting.add(1, 103, "b") == []  # the next colour could be at 102
    assert waiting.add(0, 133, "c") == [Pair(100, "a", 103, "b")]
    assert waiting.add(1, 133, "d") == [Pair(133, "c", 133, "d")]  # nothing is nearer than the same time
    knowing = Pairing[str](10, least_gap_ns=20)
    assert knowing.add(0, 100, "a") == []
    assert knowing.add(1, 103, "b") == [Pair(100, "a", 103, "b")]


def test_a_stream_that_is_silent_does_not_fill_the_memory() -> None:
    pairing = Pairing[int](10)
    for k in range(1000):
        assert pairing.add(0, k * PERIOD, k) == []
    assert len(pairing._messages) <= MOST_WAITING
    assert pairing.add(1, 999 * PERIOD, -1) == [Pair(999 * PERIOD, 999, 999 * PERIOD, -1)]
    assert pairing.unpaired == [999, 0]
