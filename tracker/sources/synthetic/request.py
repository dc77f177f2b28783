"""What is asked for: `NAME?frames=60&seed=1&size=320x240&noise=1.0&object=mug`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from tracker.errors import SourceError
from tracker.sources.options import split_options
from tracker.sources.synthetic.scenes import SCENES
from tracker.sources.synthetic.things.objects import OBJECTS

SIDES_PX = (64, 1920)


@dataclass(frozen=True, slots=True)
class Request:
    """A scene and how to take it. hero: the object of a scene that has one, else empty."""

    scene: str
    frames: int
    seed: int
    width: int
    height: int
    noise: float
    hero: str


def _whole(low: int, high: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise ValueError(f"a whole number from {low} to {high}")
        return int(text)

    return read


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    try:
        return _whole(*SIDES_PX)(width), _whole(*SIDES_PX)(height)
    except ValueError as error:
        raise ValueError(f"WIDTHxHEIGHT, each {error}") from error


def _noise(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 5:
        raise ValueError("a number from 0 (a clean picture) to 5; 1 is a usual camera")
    return value


def _object(text: str) -> str:
    if text not in OBJECTS:
        raise ValueError(f"one of {', '.join(OBJECTS)}")
    return text


OPTIONS: Mapping[str, Callable[[str], Any]] = {
    "frames": _whole(1, 100_000),
    "seed": _whole(0, 2**31),
    "size": _size,
    "noise": _noise,
    "object": _object,
}


def read_request(argument: str) -> Request:
    """Raises SourceError that lists what there is where the scene, an option or a value is not known."""
    scene = argument.partition("?")[0]
    if scene not in SCENES:
        known = ", ".join(f"{name} ({kind.summary})" for name, kind in SCENES.items())
        raise SourceError(f"synthetic:{argument}: there is no scene {scene!r}; there is {known}")
    kind = SCENES[scene]
    _, given = split_options("synthetic", argument, OPTIONS)
    if "object" in given and not kind.heroes:
        raise SourceError(f"synthetic:{argument}: scene {scene!r} has all objects, so option 'object' says nothing")
    width, height = given.get("size", (640, 480))
    seed = given.get("seed", 0)
    return Request(
        scene=scene,
        frames=given.get("frames", kind.frames),
        seed=seed,
        width=width,
        height=height,
        noise=given.get("noise", 1.0),
        hero=given.get("object", kind.hero(seed)),
    )
