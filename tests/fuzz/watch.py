"""The attempts in a process of their own, so that one that crashes, hangs or asks for too much memory is found too."""

from __future__ import annotations

import multiprocessing
import resource
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.attempt import Attempts, Finding
from tests.fuzz.faulty_frames import NAME, FaultyFrames, Scenes

MOST_MEMORY = 1 << 30  # bytes beyond those before the first input: some pictures of the largest size
MOST_ADDRESSES = 8 * MOST_MEMORY  # of which not everything has memory behind it; guards the machine
STALLED_S, STARTED_S = 60.0, 300.0
Work = Callable[[Connection, str, int, int, int], None]


@dataclass(slots=True)
class Outcome:
    """Of the inputs of one reader: how many there were, and how many it refused as it should."""

    reader: str
    tried: int = 0
    refused: int = 0
    findings: list[Finding] = field(default_factory=list)


def watched(
    name: str, seed: int, first: int, inputs: int, work: Work | None = None, stalled_s: float = STALLED_S
) -> Outcome:
    """Inputs `first` to `first + inputs` of a reader, or frames of the tracker.

    work: what is done in the process. stalled_s: after so long without an input that ends it is given up.
    """
    outcome, number = Outcome(name), first - 1
    while number < first + inputs - 1:
        for told in _told(work or _work, (name, seed, number + 1, first + inputs - number - 1), stalled_s):
            if isinstance(told, int):
                number = told
            elif isinstance(told, Finding):
                outcome.findings.append(told)
            elif isinstance(told, str) and number < first:
                raise RuntimeError(f"{name}: {told} before the first input: its sample is refused")
            elif isinstance(told, str):
                outcome.findings.append(Finding(name, number, told))
            elif told:
                outcome.refused += told[0]
        outcome.tried = number + 1 - first
    return outcome


def _told(
    work: Work, asked: tuple[str, int, int, int], stalled_s: float
) -> Iterator[int | Finding | str | tuple[int] | None]:
    """The number of each input as it begins, what was found, how many were refused since that was told last, and in the
    end None or, as text, how the process ended before that."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=work, args=(there, *asked), daemon=True)
    process.start()
    there.close()
    try:
        patience_s = STARTED_S
        while here.poll(patience_s):
            told, patience_s = here.recv(), stalled_s
            yield told
            if told is None:
                return
        yield f"no end after {patience_s:g} s"
    except EOFError:
        process.join()
        yield f"the process ended with exit code {process.exitcode}"
    finally:
        process.kill()
        process.join()


def _work(there: Connection, name: str, seed: int, first: int, inputs: int) -> None:
    with TemporaryDirectory() as folder:
        attempts = FaultyFrames(seed, Scenes()) if name == NAME else Attempts(name, seed, Path(folder))
        most = _bytes_of("VmSize") + MOST_ADDRESSES
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        before = _bytes_of("VmHWM")
        for number in range(first, first + inputs):
            there.send(number)
            refused, finding = attempts.refused, attempts(number)
            if finding:
                there.send(finding)
            if attempts.refused > refused:
                there.send((attempts.refused - refused,))
            grown = _bytes_of("VmHWM") - before
            if grown > MOST_MEMORY:
                there.send(Finding(name, number, f"needs {grown >> 20} MiB of memory"))
                before += grown
        there.send(None)


def _bytes_of(kind: str) -> int:
    """Bytes of this process: VmSize of addresses, VmHWM the most that it had of memory so far."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition(f"{kind}:")[2].split()[0]) << 10
