"""Colour and depth that belong together: nearest in time, in order, stale depth never taken for new."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.sources.pairing import WAITING_COLOURS, Pair, Pairing, Shot

PERIOD_NS = 33_333_333


def run(order: list[tuple[str, int]], clock: str = "hardware_clock", pairing: Pairing | None = None) -> list[Pair]:
    """order: stream and stamp, as they come."""
    pairing = pairing or Pairing(PERIOD_NS)
    pairs = []
    for kind, stamp_ns in order:
        add = pairing.add_depth if kind == "depth" else pairing.add_colour
        pairs += add(Shot(stamp_ns, clock if kind == "depth" else "hardware_clock", kind))
    return pairs + pairing.finish()


def stamps(pairs: list[Pair]) -> list[tuple[int, int | None]]:
    return [(pair.colour.stamp_ns, pair.depth and pair.depth.stamp_ns) for pair in pairs]


@given(st.lists(st.booleans(), min_size=20, max_size=20), st.integers(-PERIOD_NS // 2, PERIOD_NS // 2))
def test_whichever_comes_first_each_colour_gets_the_depth_of_its_moment(first: list[bool], skew_ns: int) -> None:
    order: list[tuple[str, int]] = []
    for k, depth_first in enumerate(first):
        both = [("depth", (k + 1) * PERIOD_NS - skew_ns), ("colour", (k + 1) * PERIOD_NS)]
        order += both if depth_first else both[::-1]
    pairs = run(order)
    assert [pair.colour.stamp_ns for pair in pairs] == [(k + 1) * PERIOD_NS for k in range(20)]
    assert all(abs(pair.skew_ns) <= PERIOD_NS / 2 + 1 for pair in pairs)
    assert all(pair.depth for pair in pairs)


def test_first_pictures_without_the_other_are_skipped_and_counted() -> None:
    pairing = Pairing(PERIOD_NS)
    ns = [k * PERIOD_NS for k in range(12)]
    order = [("depth", t) for t in ns[:6]] + [pair for t in ns[6:9] for pair in (("depth", t), ("colour", t))]
    assert stamps(run(order, pairing=pairing)) == [(t, t) for t in ns[6:9]]
    assert pairing.skipped == 6
    pairing = Pairing(PERIOD_NS)
    order = [("colour", t) for t in ns[:8]] + [("depth", t) for t in ns[8:10]] + [("colour", t) for t in ns[8:10]]
    assert stamps(run(order, pairing=pairing)) == [(t, t) for t in ns[8:10]]
    assert pairing.skipped == 8


def test_once_they_have_met_colour_comes_alone_where_there_is_no_depth_of_its_moment() -> None:
    ns = [k * PERIOD_NS for k in range(12)]
    order = [pair for t in ns[:2] for pair in (("depth", t), ("colour", t))] + [("colour", t) for t in ns[2:9]]
    order += [pair for t in ns[9:] for pair in (("depth", t), ("colour", t))]
    pairing = Pairing(PERIOD_NS)
    at_once = [pair for kind, t in order for pair in getattr(pairing, f"add_{kind}")(Shot(t, "hardware_clock", kind))]
    assert stamps(at_once) == [(t, t if t in (*ns[:2], *ns[9:]) else None) for t in ns]


def test_depth_that_stays_away_is_waited_for_no_longer_than_a_few_pictures() -> None:
    pairing = Pairing(PERIOD_NS)
    run_so_far = [*pairing.add_depth(Shot(0, "c", None)), *pairing.add_colour(Shot(0, "c", None))]
    for k in range(1, 10):
        run_so_far += pairing.add_colour(Shot(k * PERIOD_NS, "c", None))
        assert k - len(run_so_far) + 1 < WAITING_COLOURS


def test_a_slower_depth_stream_serves_two_colours() -> None:
    order = [("depth", 0), ("colour", 0), ("colour", 33), ("depth", 66), ("colour", 66), ("colour", 100)]
    assert stamps(run(order, pairing=Pairing(66))) == [(0, 0), (33, 0), (66, 66), (100, 66)]


def test_stamps_of_two_clocks_are_not_compared_and_the_newest_depth_is_taken() -> None:
    pairs = run([("depth", 7), ("colour", 10**15), ("depth", 9), ("colour", 2 * 10**15)], clock="system_time")
    assert stamps(pairs) == [(10**15, 7), (2 * 10**15, 9)]
    assert [pair.skew_ns for pair in pairs] == [0, 0]


@pytest.mark.parametrize("jump_ns", [-(10**12), 10**12])
def test_a_clock_that_jumps_costs_no_colour(jump_ns: int) -> None:
    ns = [2 * 10**12 + k * PERIOD_NS + (jump_ns if k >= 5 else 0) for k in range(10)]
    pairs = run([pair for t in ns for pair in (("depth", t), ("colour", t))])
    assert stamps(pairs) == [(t, t) for t in ns]
