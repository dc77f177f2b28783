"""What is written after a source's path or name: `PATH?size=320x240&seed=1`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from tracker.errors import SourceError

Readers = Mapping[str, Callable[[str], Any]]


def split_options(kind: str, argument: str, readers: Readers) -> tuple[str, dict[str, Any]]:
    """The path or name, and every option that is given as its reader reads it.

    A reader raises ValueError that says what it expected. Raises SourceError that lists the options where one is not
    known, and names the value where it is given twice or cannot be read.
    """
    name, _, query = argument.partition("?")
    given: dict[str, Any] = {}
    for part in query.split("&") if query else []:
        key, _, text = part.partition("=")
        if key not in readers:
            raise SourceError(f"{kind}:{argument}: there is no option {key!r}; there is {', '.join(readers)}")
        if key in given:
            raise SourceError(f"{kind}:{argument}: option {key!r} is given twice")
        try:
            given[key] = readers[key](text)
        except ValueError as error:
            raise SourceError(f"{kind}:{argument}: {key}={text!r}: expected {error}") from error
    return name, given


def text(value: str) -> str:
    if not value:
        raise ValueError("something after the equals sign")
    return value


def yes_or_no(value: str) -> bool:
    if value not in ("yes", "no"):
        raise ValueError("yes or no")
    return value == "yes"


def positive(unit: str) -> Callable[[str], float]:
    """A reader of a number above 0; unit: what it counts, for people."""

    def read(value: str) -> float:
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (math.isfinite(number) and number > 0):
            raise ValueError(f"a number above 0, in {unit}")
        return number

    return read


def numbers(*names: str) -> Callable[[str], tuple[float, ...]]:
    """A reader of so many finite numbers, separated by commas."""

    def read(value: str) -> tuple[float, ...]:
        try:
            found = tuple(float(part) for part in value.split(","))
        except ValueError:
            found = ()
        if len(found) != len(names) or not all(math.isfinite(number) for number in found):
            raise ValueError(f"{len(names)} numbers {','.join(names)}")
        return found

    return read
