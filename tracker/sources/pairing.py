"""Colour and depth pictures that come one by one -> pairs of the same moment."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

WITHIN_PERIODS = 0.6  # of the depth stream: one that is half a period away is the nearest there can be
WAITING_COLOURS = 4  # pictures that are held for depth that may come late


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """One picture of one stream. clock: whose time stamp_ns is. picture: whatever the source has."""

    stamp_ns: int
    clock: str
    picture: Any


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """depth: None where the camera has none of that moment."""

    colour: Shot
    depth: Shot | None

    @property
    def skew_ns(self) -> int:
        """Stamp of the colour minus that of the depth; 0 where two clocks cannot be compared."""
        if self.depth is None or self.depth.clock != self.colour.clock:
            return 0
        return self.colour.stamp_ns - self.depth.stamp_ns


class Pairing:
    """Every colour picture once, with the depth nearest in time, as soon as it is known; a depth picture may serve two.

    depth_period_ns: between two pictures of the depth stream. Until depth and colour have met, what lacks the other is
    skipped: `skipped` counts it. From then on colour comes without depth where there is none of its moment: stale depth
    is never taken for new.
    """

    def __init__(self, depth_period_ns: int) -> None:
        self._within_ns = round(WITHIN_PERIODS * depth_period_ns)
        self._colours: deque[Shot] = deque()
        self._depths: deque[Shot] = deque(maxlen=WAITING_COLOURS)
        self._met = False
        self.skipped = 0

    def add_depth(self, shot: Shot) -> list[Pair]:
        """The pairs that are known now, in the order of their colour pictures."""
        if not self._met and len(self._depths) == self._depths.maxlen:
            self.skipped += 1
        self._depths.append(shot)
        return self._known()

    def add_colour(self, shot: Shot) -> list[Pair]:
        """The pairs that are known now, in the order of their colour pictures."""
        self._colours.append(shot)
        return self._known()

    def finish(self) -> list[Pair]:
        """There are no more pictures: those that wait."""
        return self._known(most_waiting=0)

    def _known(self, most_waiting: int = WAITING_COLOURS - 1) -> list[Pair]:
        pairs = []
        while self._colours:
            depth = self._nearest(self._colours[0])
            if depth is None and len(self._colours) <= most_waiting and not self._is_past(self._colours[0]):
                break
            colour = self._colours.popleft()
            if depth is not None and not self._met:
                self._met = True
                self.skipped += list(self._depths).index(depth)
            if self._met:
                pairs.append(Pair(colour, depth))
            else:
                self.skipped += 1
        return pairs

    def _is_past(self, colour: Shot) -> bool:
        """The depth stream has gone on: there will be none of this moment."""
        return bool(self._depths) and self._depths[-1].stamp_ns > colour.stamp_ns + self._within_ns

    def _nearest(self, colour: Shot) -> Shot | None:
        if not self._depths:
            return None
        if self._depths[-1].clock != colour.clock:
            return self._depths[-1]
        nearest = min(self._depths, key=lambda depth: abs(depth.stamp_ns - colour.stamp_ns))
        return nearest if abs(nearest.stamp_ns - colour.stamp_ns) <= self._within_ns else None
