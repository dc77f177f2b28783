"""Damaged files through the readers, faulty frames through the tracker: a few of those of `python -m tests.fuzz`."""

from __future__ import annotations

import os
import time
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from tests.fuzz.attempt import Attempts
from tests.fuzz.faulty_frames import FaultyFrames, Scenes
from tests.fuzz.readers import READERS, Reader
from tests.fuzz.samples import answer
from tests.fuzz.watch import watched
from tests.fuzz.words import reworded
from tracker.errors import SourceError

INPUTS, FRAMES = 100, 125


@pytest.mark.parametrize("name", READERS)
def test_damaged_files_are_taken_or_refused_by_name_and_nothing_else_comes_out(name: str, tmp_path: Path) -> None:
    attempts = Attempts(name, 7, tmp_path)
    findings = [finding for number in range(INPUTS) if (finding := attempts(number))]
    assert not findings, "\n".join(f"{each.number}: {each.what}\n{each.trace}" for each in findings[:3])


def test_whatever_frames_come_the_tracker_says_what_is_lawful() -> None:
    attempts = FaultyFrames(7, Scenes(seen=12, unseen=2))
    findings = [finding for number in range(FRAMES) if (finding := attempts(number))]
    assert not findings, "\n".join(f"{each.number}: {each.what}\n{each.trace}" for each in findings[:3])
    assert attempts.refused > FRAMES / 10
    assert attempts.tracked > FRAMES / 10  # the faults leave something to be tracked


@pytest.mark.parametrize(
    ("error", "found"),
    [
        (KeyError("a"), "KeyError"),
        (SourceError("something is wrong"), "does not name answer.txt"),
        (SourceError("answer.txt: is damaged"), None),
        (None, None),
    ],
)
def test_only_an_error_that_names_the_file_is_no_finding(
    error: Exception | None, found: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads = 0

    def read(folder: Path, file: Path) -> None:  # noqa: ARG001
        nonlocal reads
        reads += 1
        if error and reads > 1:  # the first is of the whole sample
            raise error

    monkeypatch.setitem(READERS, "broken", Reader(answer, ("*",), reworded, read))
    finding = Attempts("broken", 0, tmp_path)(0)
    assert (finding is None) == (found is None)
    assert finding is None or (found and found in finding.what)


def test_an_input_follows_from_its_number_alone(tmp_path: Path) -> None:
    one, other = (Attempts("run", 3, tmp_path / name) for name in ("one", "other") if not (tmp_path / name).mkdir())
    other(0)
    assert one.damaged(5)[1] == other.damaged(5)[1] != one.damaged(6)[1]


def crash_then_stall(there: Connection, name: str, seed: int, first: int, inputs: int) -> None:  # noqa: ARG001
    for number in range(first, first + inputs):
        there.send(number)
        if number == 1:
            os._exit(3)
        if number == 2:
            time.sleep(600)
    there.send(None)


def test_a_process_that_crashes_or_stalls_is_found_and_the_inputs_go_on() -> None:
    outcome = watched("run", 0, 0, 4, work=crash_then_stall, stalled_s=2)
    assert outcome.tried == 4
    assert [(finding.number, finding.what[:20]) for finding in outcome.findings] == [
        (1, "the process ended wi"),
        (2, "no end after 2 s"),
    ]
