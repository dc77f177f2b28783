"""What is asked for: a camera by its serial number, or a recording, and how to take its pictures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tracker.errors import SourceError
from tracker.sources.query import number, read_query, whole

FILTERS = ("spatial", "temporal", "hole")
RECORDINGS = (".db3", ".bag")


@dataclass(frozen=True, slots=True)
class Options:
    """width, height, fps: of both streams, None for what is nearest to 640 x 480 at 30. filters: of the depth, in the
    order in which they are applied. depth_unit_m: metres per unit whatever the camera says. reconnect_s: a camera that
    is gone for longer ends the source."""

    width: int | None = None
    height: int | None = None
    fps: int | None = None
    filters: tuple[str, ...] = ()
    depth_unit_m: float | None = None
    reconnect_s: float = 60.0


@dataclass(frozen=True, slots=True)
class Request:
    """serial: None for the only camera that there is. file: None for a camera."""

    serial: str | None
    file: Path | None
    options: Options


def _filters(text: str) -> tuple[str, ...]:
    names = tuple(text.split(","))
    if set(names) - set(FILTERS) or len(set(names)) < len(names):
        raise ValueError(f"one or several of {', '.join(FILTERS)}, with commas between them, each once")
    return names


SIZE = {"width": whole(64, 4096), "height": whole(64, 4096), "fps": whole(1, 300)}
DEPTH = {"filters": _filters, "depth_unit": number(1e-6, 1.0, "metres per unit of the depth")}
LOSS = {"reconnect": number(0, 86_400, "seconds")}


def read_request(argument: str) -> Request:
    """Raises SourceError that lists what there is where an option or a value is not known."""
    name = f"realsense:{argument}"
    target, _, query = argument.partition("?")
    recording = "/" in target or Path(target).suffix != ""
    if recording and Path(target).suffix.lower() not in RECORDINGS:
        raise SourceError(f"{name}: {target} is not a RealSense recording; expected FILE{' or FILE'.join(RECORDINGS)}")
    given = read_query(name, query, DEPTH if recording else SIZE | DEPTH | LOSS)
    renamed = {"depth_unit": "depth_unit_m", "reconnect": "reconnect_s"}
    options = Options(**{renamed.get(key, key): value for key, value in given.items()})
    return Request(None if recording else target or None, Path(target) if recording else None, options)
