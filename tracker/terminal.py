"""Running a program from a terminal: its errors become one sentence and an exit code, its long work shows a bar."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from tracker.errors import TrackerError

STDERR = Console(stderr=True)
Item = TypeVar("Item")


def run(program: Callable[[], None]) -> None:
    """Run a command to its end. A TrackerError is told in a sentence, exit code 1; ctrl-C gives 130."""
    handler = RichHandler(console=STDERR, show_path=False, show_time=False)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[handler])
    try:
        program()
    except TrackerError as error:
        STDERR.print(f"[bold red]error:[/] {_plain(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(1)
    except KeyboardInterrupt:
        STDERR.print("stopped")
        sys.exit(130)


def progress(items: Iterable[Item], total: int | None, what: str) -> Iterator[Item]:
    """The items, with a bar on the terminal that tells how many of them are done, how fast, and how long it takes."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=STDERR, transient=True, disable=not STDERR.is_terminal) as bar:
        task = bar.add_task(what, total=total, rate="")
        for item in items:
            yield item
            speed = bar.tasks[0].speed
            bar.update(task, advance=1, rate=f"{speed:.1f}/s" if speed else "")


def _plain(text: str) -> str:
    """Text in which square brackets are just brackets."""
    return text.replace("[", r"\[")
