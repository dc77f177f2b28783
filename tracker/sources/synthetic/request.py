"""What is asked for: `NAME?frames=60&seed=1&size=320x240&noise=1.0&object=mug`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from tracker.errors import SourceError
from tracker.sources.query import number, read_query, whole
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


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    try:
        return whole(*SIDES_PX)(width), whole(*SIDES_PX)(height)
    except ValueError as error:
        raise ValueError(f"WIDTHxHEIGHT, each {error}") from error


def _object(text: str) -> str:
    if text not in OBJECTS:
        raise ValueError(f"one of {', '.join(OBJECTS)}")
    return text


OPTIONS: Mapping[str, Callable[[str], Any]] = {
    "frames": whole(1, 100_000),
    "seed": whole(0, 2**31),
    "size": _size,
    "noise": number(0, 5, "0 is a clean picture, 1 a usual camera"),
    "object": _object,
}


def read_request(argument: str) -> Request:
    """Raises SourceError that lists what there is where the scene, an option or a value is not known."""
    scene, _, query = argument.partition("?")
    if scene not in SCENES:
        known = ", ".join(f"{name} ({kind.summary})" for name, kind in SCENES.items())
        raise SourceError(f"synthetic:{argument}: there is no scene {scene!r}; there is {known}")
    kind = SCENES[scene]
    given = read_query(f"synthetic:{argument}", query, OPTIONS)
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
