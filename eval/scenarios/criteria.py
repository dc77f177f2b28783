"""Judgements of one run of a scenario, each a function of its frames in order.

A delay counts frames that pass: 0 where the answer is in the frame of the event itself. An event so near the end that
its time limit is not over, and that is not answered, is not judged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby

from eval.scenarios.frame_log import FrameLog

LOST_WITHIN, BACK_WITHIN, ASTRAY_AT_MOST = 3, 5, 3  # frames

Frames = Sequence[FrameLog]


@dataclass(frozen=True, slots=True)
class Delay:
    """frames: that passed until the answer to the event in frame `index`; None where there was none. limit: how many
    may pass at most."""

    index: int
    frames: int | None
    limit: int

    @property
    def in_time(self) -> bool:
        return self.frames is not None and self.frames <= self.limit


def losing_delays(frames: Frames) -> list[Delay]:
    """Every time sight of the object is lost: how many frames pass, still with a pose, until there is none.

    Of a stretch out of sight that is over before the limit, and in which a pose stood throughout, there is nothing.
    """
    delays = []
    for start in _starts([not frame.in_sight for frame in frames]):
        stretch = _while(frames[start:], lambda frame: not frame.in_sight)
        answer = next((k for k, frame in enumerate(stretch) if not frame.tracking), None)
        if answer is not None or len(stretch) > LOST_WITHIN:
            delays.append(Delay(start, answer, LOST_WITHIN))
    return delays


def finding_delays(frames: Frames) -> list[Delay]:
    """Every time that half of an object is in sight after sight of it was lost, or that it jumped in sight: how many
    frames pass until it is tracked again, at most 5 cm off.

    An object that goes out of sight again, or the end, before the limit ends the wait: there is nothing then.
    """
    delays = []
    for start in _returns(frames):
        stretch = _while(frames[start:], lambda frame: frame.in_sight)
        answer = next((k for k, frame in enumerate(stretch) if frame.on_object), None)
        if answer is not None or len(stretch) > BACK_WITHIN:
            delays.append(Delay(start, answer, BACK_WITHIN))
    return delays


def longest_astray(frames: Frames) -> int:
    """The most frames in a row with a pose that is more than 5 cm off."""
    return max((len(list(run)) for astray, run in groupby(frame.astray for frame in frames) if astray), default=0)


def false_tracks(frames: Frames) -> int:
    """Frames with a pose while the object is out of sight."""
    return sum(frame.tracking and not frame.in_sight for frame in frames)


def found_share(frames: Frames) -> float | None:
    """Share, in [0, 1], of the frames with half of the object in sight in which it is tracked, at most 5 cm off; None
    where there is no such frame."""
    due = [frame.on_object for frame in frames if frame.half_in_sight]
    return sum(due) / len(due) if due else None


def _returns(frames: Frames) -> list[int]:
    """Frames in which an object is to be found again."""
    found, lost = [], False
    for k, frame in enumerate(frames):
        lost = lost or (frame.jumped and k > 0) or (k > 0 and not frame.in_sight)
        if lost and frame.half_in_sight:
            found.append(k)
            lost = False
    return found


def _starts(flags: Sequence[bool]) -> list[int]:
    """Where a stretch of true values begins, not at the very beginning: nobody can lose what was not seen yet."""
    return [k for k in range(1, len(flags)) if flags[k] and not flags[k - 1]]


def _while(frames: Frames, holds: Callable[[FrameLog], bool]) -> Frames:
    """The frames before the first for which it does not hold."""
    return frames[: next((k for k, frame in enumerate(frames) if not holds(frame)), len(frames))]
