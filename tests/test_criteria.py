"""Runs written down by hand, a letter a frame, and what is said of each."""

from __future__ import annotations

import pytest

from eval.scenarios.criteria import (
    Delay,
    false_tracks,
    finding_delays,
    found_share,
    longest_astray,
    losing_delays,
)
from eval.scenarios.frame_log import FrameLog

SEEN = {"#": 1.0, "+": 0.5, "-": 0.49, ".": 0.05, " ": 0.049, "0": 0.0, "x": 1.0, "!": 1.0}
ERRORS_M = {"T": 0.01, "e": 0.05, "F": 0.051, "L": None, "i": None}
STATES = {"T": "tracking", "e": "tracking", "F": "tracking", "L": "lost", "i": "initialising"}


def frames(sight: str, said: str) -> list[FrameLog]:
    """sight: how much of the object can be seen; "x" all of it, without depth; "!" all of it, after a jump. said: "T"
    tracked well, "e" at the very limit, "F" beyond it, "L" lost, "i" not seen yet."""
    return [
        FrameLog(
            index=k,
            visible=SEEN[seen],
            has_depth=seen != "x",
            jumped=seen == "!",
            state=STATES[word],
            confidence=0.0 if ERRORS_M[word] is None else 0.7,
            reason="",
            error_m=ERRORS_M[word],
            error_deg=None if ERRORS_M[word] is None else 1.0,
        )
        for k, (seen, word) in enumerate(zip(sight, said, strict=True))
    ]


@pytest.mark.parametrize(
    ("sight", "said", "expected"),
    [
        ("####", "TTTT", []),
        ("##00000", "TTLLLLL", [(2, 0, True)]),
        ("##00000", "TTTLLLL", [(2, 1, True)]),
        ("##00000", "TTTTTLL", [(2, 3, True)]),  # three frames with a pose are allowed
        ("##00000", "TTTTTTL", [(2, 4, False)]),  # four are not
        ("##00000", "TTTTTTT", [(2, None, False)]),
        ("##0000", "TTTTTT", [(2, None, False)]),
        ("##000", "TTTTT", []),  # over before it could be too late
        ("##000", "TTTTL", [(2, 2, True)]),
        ("##000##", "TTTTTTL", []),
        ("##     ", "TTLLLLL", [(2, 0, True)]),  # a hair under a twentieth is out of sight
        ("##.....", "TTTTTTT", []),  # a twentieth is not
        ("##xxxxxx##", "TTTLLLLTTT", [(2, 1, True)]),  # depth failed
        ("##00000##00000", "TTLLLLLTTTTTTT", [(2, 0, True), (9, None, False)]),
        ("00000##", "iiiiiTT", []),  # what was never seen cannot be lost
        ("##00000", "LLLLLLL", [(2, 0, True)]),
    ],
)
def test_losing_sight(sight: str, said: str, expected: list[tuple[int, int | None, bool]]) -> None:
    assert told(losing_delays(frames(sight, said))) == expected


@pytest.mark.parametrize(
    ("sight", "said", "expected"),
    [
        ("########", "TTTTTTTT", []),
        ("#00#####", "TLLTTTTT", [(3, 0, True)]),
        ("#00.-+######", "TLLLLLLTTTTT", [(5, 2, True)]),  # half of it counts, not less
        ("#00.-+######", "TLLTTTTTTTTT", [(5, 0, True)]),  # found before it is asked for
        ("#0########", "TLLLLLLTTT", [(2, 5, True)]),
        ("#0########", "TLLLLLLLTT", [(2, 6, False)]),
        ("#0########", "TLLLLLLLLL", [(2, None, False)]),
        ("#0######", "TLLLLLLL", [(2, None, False)]),
        ("#0#####", "TLLLLLL", []),  # five frames have not passed at the end
        ("#0#####", "TLLLLLe", [(2, 4, True)]),
        ("#0########", "TLFFFFFFFF", [(2, None, False)]),  # another object is not the one
        ("#0########", "TLFFFeTTTT", [(2, 3, True)]),  # five centimetres off is just on it
        ("###!######", "TTTFFLTTTT", [(3, 3, True)]),  # a jump asks like a return
        ("###!######", "TTTTTTTTTT", [(3, 0, True)]),
        ("#0##00000##", "TLLLLLLLLTT", [(9, 0, True)]),  # gone again before it was due
        ("xx######", "iiTTTTTT", [(2, 0, True)]),
        ("#xxx####", "TLLLLTTT", [(4, 1, True)]),
    ],
)
def test_finding_again(sight: str, said: str, expected: list[tuple[int, int | None, bool]]) -> None:
    assert told(finding_delays(frames(sight, said))) == expected


def told(delays: list[Delay]) -> list[tuple[int, int | None, bool]]:
    return [(delay.index, delay.frames, delay.in_time) for delay in delays]


@pytest.mark.parametrize(
    ("said", "longest"),
    [("TTTT", 0), ("FTFF", 2), ("FFFF", 4), ("eeee", 0), ("FFLFFF", 3), ("LLLL", 0), ("", 0)],
)
def test_frames_in_a_row_with_a_wrong_pose(said: str, longest: int) -> None:
    assert longest_astray(frames("#" * len(said), said)) == longest


def test_a_pose_of_what_is_out_of_sight_is_a_false_track_wherever_it_is() -> None:
    assert false_tracks(frames("##00 .#x", "TTTFTTTT")) == 4
    assert false_tracks(frames("##00 .#x", "TTLLLLLL")) == 0


def test_found_are_frames_with_half_of_it_in_sight_in_which_it_is_tracked() -> None:
    assert found_share(frames("#+-x##0#", "TeTTFLTL")) == pytest.approx(2 / 5)
    assert found_share(frames("--00", "TTTT")) is None
