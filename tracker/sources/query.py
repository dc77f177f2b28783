"""What follows a source's name: `?frames=60&size=320x240`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from tracker.errors import SourceError

Readers = Mapping[str, Callable[[str], Any]]


def read_query(source: str, query: str, readers: Readers) -> dict[str, Any]:
    """The options that are given, read. source: as the user wrote it, the messages begin with it.

    readers: option -> what reads its text; it raises ValueError that says what it expected.
    Raises SourceError that lists what there is where an option is unknown or twice there, or its value is none.
    """
    given: dict[str, Any] = {}
    for part in query.split("&") if query else []:
        key, _, text = part.partition("=")
        if key not in readers:
            raise SourceError(f"{source}: there is no option {key!r}; there is {', '.join(readers)}")
        if key in given:
            raise SourceError(f"{source}: option {key!r} is given twice")
        try:
            given[key] = readers[key](text)
        except ValueError as error:
            raise SourceError(f"{source}: {key}={text!r}: expected {error}") from error
    return given


def whole(low: int, high: int) -> Callable[[str], int]:
    """Reads a whole number in these limits."""

    def read(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise ValueError(f"a whole number from {low} to {high}")
        return int(text)

    return read


def number(low: float, high: float, what: str = "") -> Callable[[str], float]:
    """Reads a number in these limits. what: is said of it where it is not one."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise ValueError(f"a number from {low:g} to {high:g}{what and f', {what}'}")
        return value

    return read


def some(value: str) -> str:
    """Reads anything that is not empty."""
    if not value:
        raise ValueError("something after the equals sign")
    return value


def yes_or_no(value: str) -> bool:
    """Reads yes or no."""
    if value not in ("yes", "no"):
        raise ValueError("yes or no")
    return value == "yes"


def numbers(*names: str) -> Callable[[str], tuple[float, ...]]:
    """Reads so many finite numbers, with commas between them."""

    def read(value: str) -> tuple[float, ...]:
        try:
            found = tuple(float(part) for part in value.split(","))
        except ValueError:
            found = ()
        if len(found) != len(names) or not all(math.isfinite(number) for number in found):
            raise ValueError(f"{len(names)} numbers {','.join(names)}")
        return found

    return read
