"""Colour and depth that come as two streams, each with stamps of its own -> pairs that belong together.

Two messages are a pair where neither has a nearer partner and they are not further apart than the slop. Every message
is used once, pairs come in the order of their stamps, and what finds no partner is left out and counted. This is what
ApproximateTime of ROS' message_filters is for; the rule here is a plainer one, as there are two streams and no more.
https://wiki.ros.org/message_filters/ApproximateTime
"""

from __future__ import annotations

from bisect import insort
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

FOREVER_NS = 2**63
MOST_WAITING = 60  # messages of a stream whose partner does not come: two seconds of a usual camera

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Pair(Generic[T]):
    """A message of each stream, with its stamp."""

    first_ns: int
    first: T
    second_ns: int
    second: T


@dataclass(frozen=True, slots=True, order=True)
class _Stamped:
    stamp_ns: int
    number: int


class Pairing(Generic[T]):
    """Takes the messages of two streams, sides 0 and 1, as they come, and answers with the pairs that are decided.

    slop_ns: how far apart a pair may be. reorder: how many messages of the same stream one may be late; each waits for
    so many others. least_gap_ns: messages of one stream are at least so far apart; with it a pair is known without
    waiting for the next message. `unpaired` and `late` count, a side each, what was left out.
    """

    def __init__(self, slop_ns: int, reorder: int = 0, least_gap_ns: int = 0) -> None:
        self._slop_ns, self._reorder, self._least_gap_ns = slop_ns, reorder, least_gap_ns
        self._coming: tuple[list[_Stamped], list[_Stamped]] = ([], [])
        self._waiting: tuple[deque[_Stamped], deque[_Stamped]] = (deque(), deque())
        self._messages: dict[int, T] = {}
        self._last_ns = [-1, -1]
        self._number = 0
        self._ended = False
        self.unpaired, self.late = [0, 0], [0, 0]

    def add(self, side: int, stamp_ns: int, message: T) -> list[Pair[T]]:
        """The pairs that this message decides, mostly none or one."""
        if stamp_ns <= self._last_ns[side]:
            self.late[side] += 1
            return []
        self._number += 1
        self._messages[self._number] = message
        insort(self._coming[side], _Stamped(stamp_ns, self._number))
        return self._settled(self._reorder)

    def finish(self) -> list[Pair[T]]:
        """The pairs that are left: there are no more messages."""
        self._ended = True
        pairs = self._settled(0)
        for side in (0, 1):
            while self._waiting[side]:
                self._leave_out(side)
        return pairs

    def _settled(self, reorder: int) -> list[Pair[T]]:
        for side in (0, 1):
            coming = self._coming[side]
            while len(coming) > reorder:
                stamped = coming.pop(0)
                if stamped.stamp_ns == self._last_ns[side]:  # sent twice
                    del self._messages[stamped.number]
                    self.late[side] += 1
                    continue
                self._last_ns[side] = stamped.stamp_ns
                self._waiting[side].append(stamped)
        pairs: list[Pair[T]] = []
        while self._step(pairs):
            pass
        for side in (0, 1):
            while len(self._waiting[side]) > MOST_WAITING:
                self._leave_out(side)
        return pairs

    def _step(self, pairs: list[Pair[T]]) -> bool:
        """Decides about the earliest message that waits; False where that has to wait for others."""
        sides = [side for side in (0, 1) if self._waiting[side]]
        if not sides:
            return False
        early = min(sides, key=lambda side: self._waiting[side][0].stamp_ns)
        other = 1 - early
        earliest_ns = self._waiting[early][0].stamp_ns
        partner_ns = self._waiting[other][0].stamp_ns if self._waiting[other] else self._next_ns(other)
        apart_ns = partner_ns - earliest_ns
        if apart_ns > self._slop_ns:
            self._leave_out(early)
            return True
        if not self._waiting[other]:
            return False
        follows = self._waiting[early][1].stamp_ns if len(self._waiting[early]) > 1 else None
        if follows is not None and abs(follows - partner_ns) < apart_ns:
            self._leave_out(early)  # its partner has a nearer one
            return True
        if apart_ns and follows is None and self._next_ns(early) < partner_ns + apart_ns:
            return False
        pair = [self._waiting[side].popleft() for side in (0, 1)]
        first, second = (self._messages.pop(stamped.number) for stamped in pair)
        pairs.append(Pair(pair[0].stamp_ns, first, pair[1].stamp_ns, second))
        return True

    def _next_ns(self, side: int) -> int:
        """No message of the stream that is not in order yet is earlier."""
        return FOREVER_NS if self._ended else self._last_ns[side] + max(self._least_gap_ns, 1)

    def _leave_out(self, side: int) -> None:
        del self._messages[self._waiting[side].popleft().number]
        self.unpaired[side] += 1


def paired(messages: Iterable[tuple[int, int, T]], pairing: Pairing[T]) -> Iterator[Pair[T]]:
    """The pairs among (side, stamp in nanoseconds, message), as soon as each is decided."""
    for side, stamp_ns, message in messages:
        yield from pairing.add(side, stamp_ns, message)
    yield from pairing.finish()


def pair_stamps(first_ns: Sequence[int], second_ns: Sequence[int], slop_ns: int) -> list[tuple[int, int]]:
    """Positions in the two lists, in any order each, of the stamps that belong together."""
    in_order: list[tuple[int, int, int]] = [(stamp_ns, 0, k) for k, stamp_ns in enumerate(first_ns)]
    in_order += [(stamp_ns, 1, k) for k, stamp_ns in enumerate(second_ns)]
    messages = ((side, stamp_ns, k) for stamp_ns, side, k in sorted(in_order))
    return [(pair.first, pair.second) for pair in paired(messages, Pairing[int](slop_ns))]
