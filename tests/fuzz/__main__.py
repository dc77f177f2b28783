"""Damaged files through the readers, and faulty frames through the tracker; what should not come out is printed."""

from __future__ import annotations

import argparse
import logging
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.attempt import Attempts, Finding
from tests.fuzz.faulty_frames import NAME
from tests.fuzz.readers import READERS
from tests.fuzz.watch import watched

NAMES = (*READERS, NAME)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("readers", nargs="*", metavar="NAME", help=f"all, or some of {', '.join(NAMES)}")
    parser.add_argument("--inputs", type=int, default=10_000, help="for each")
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for the damaged files that were found")
    asked = parser.parse_args()
    if unknown := set(asked.readers) - set(NAMES):
        parser.error(f"no reader is called {', '.join(sorted(unknown))}; there are {', '.join(NAMES)}")
    logging.disable()
    found = 0
    for name in asked.readers or NAMES:
        began = time.monotonic()
        outcome = watched(name, asked.seed, asked.first, asked.inputs)
        seconds = time.monotonic() - began
        print(
            f"{name:18} {outcome.tried:6} inputs, {outcome.refused:6} refused, {len(outcome.findings):5} wrong, "
            f"{seconds:6.0f} s",
            flush=True,
        )
        found += len(outcome.findings)
        for finding in _one_of_a_kind(outcome.findings):
            print(f"  {finding.number}: {finding.what}\n{finding.trace}", flush=True)
            if asked.keep and name in READERS:
                _keep(asked.keep, finding, asked.seed)
    sys.exit(1 if found else 0)


def _one_of_a_kind(findings: list[Finding]) -> list[Finding]:
    """The first of those that came from the same lines."""
    return list({_kind(finding): finding for finding in reversed(findings)}.values())[::-1]


def _kind(finding: Finding) -> str:
    lines = [line for line in finding.trace.splitlines() if line.startswith("  File ")]
    return "".join(lines[-4:]) + finding.what[:20]


def _keep(folder: Path, finding: Finding, seed: int) -> None:
    with TemporaryDirectory() as sample:
        file, content = Attempts(finding.reader, seed, Path(sample)).damaged(finding.number)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{finding.reader}-{finding.number}{file.suffix}").write_bytes(content)


if __name__ == "__main__":
    main()
