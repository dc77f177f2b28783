"""Running a program from a terminal: its errors become one sentence and an exit code, its long work shows a bar."""

from __future__ import annotations

import json
import logging
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from tracker.errors import TrackerError

STDERR, ALWAYS = Console(stderr=True), Console(stderr=True)  # ALWAYS is heard where a program is to be quiet
Item = TypeVar("Item")
LINE_EVERY_S = 30.0  # where there is no terminal to draw a bar on


class Terminated(KeyboardInterrupt):
    """Somebody else ends the program, as a service manager does: as ctrl-C would."""


def run(program: Callable[[], None]) -> None:
    """Run a command to its end. A TrackerError is told in a sentence, exit code 1; ctrl-C gives 130, SIGTERM 143, where
    the command does not end in its own way then."""
    STDERR.quiet = False
    before = signal.signal(signal.SIGTERM, _terminate)
    handler = RichHandler(console=ALWAYS, show_path=False, show_time=False)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[handler])
    try:
        program()
    except TrackerError as error:
        ALWAYS.print(f"[bold red]error:[/] {_plain(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(1)
    except KeyboardInterrupt as stop:
        ALWAYS.print("stopped")
        sys.exit(128 + (signal.SIGTERM if isinstance(stop, Terminated) else signal.SIGINT))
    finally:
        signal.signal(signal.SIGTERM, before)


def _terminate(*_: object) -> None:
    raise Terminated


def hush(quiet: bool) -> None:
    """If that is wanted, from now on until the program has run nothing but warnings and errors: no bars, no tables."""
    STDERR.quiet = quiet


def say_json(content: object) -> None:
    """A line of JSON on the standard output, for other programs."""
    sys.stdout.write(json.dumps(content, allow_nan=False) + "\n")
    sys.stdout.flush()


def progress(
    items: Iterable[Item], total: int | None, what: str, told: Callable[[], str] = lambda: ""
) -> Iterator[Item]:
    """The items, with a bar on the terminal that tells how many of them are done, how fast, how long it takes, and
    whatever is told after each; elsewhere, as in a log, a line of that every LINE_EVERY_S seconds."""
    if not STDERR.is_terminal:
        yield from _told_in_lines(items, total, what, told)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[told]}", markup=False),
    )
    with Progress(*columns, console=STDERR, transient=True, disable=STDERR.quiet) as bar:
        task = bar.add_task(what, total=total, rate="", told="")
        for item in items:
            yield item
            speed = bar.tasks[0].speed
            bar.update(task, advance=1, rate=f"{speed:.1f}/s" if speed else "", told=told())


def _told_in_lines(items: Iterable[Item], total: int | None, what: str, told: Callable[[], str]) -> Iterator[Item]:
    last_s = time.monotonic()
    for done, item in enumerate(items, start=1):
        yield item
        if time.monotonic() - last_s >= LINE_EVERY_S:
            last_s = time.monotonic()
            count = f"{done} of {total}" if total is not None else str(done)
            STDERR.print(f"{what}: {count} {told()}".rstrip(), markup=False, highlight=False)


def _plain(text: str) -> str:
    """Text in which square brackets are just brackets."""
    return text.replace("[", r"\[")
