"""The unit of work: a scene of a run with all its objects. Units are tracked anywhere, and kept as they finish."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from eval.datasets import require
from eval.kept_units import KeptUnits
from eval.predict import Progress, track_scene
from eval.spread import Spreading, spread
from eval.track_run import TrackRun, code_fingerprint, fingerprint_of, opened_backend, opened_dataset
from eval.tracked import Tracked
from tracker.errors import ConfigError, TrackerError
from tracker.threads import torch_threads
from tracker.viewer import file_viewer

Item = TypeVar("Item")
Outcome = Tracked | TrackerError
UnitsShown = Callable[[Iterable[tuple[int, Outcome]], int, str], Iterable[tuple[int, Outcome]]]


@dataclass(frozen=True, slots=True, eq=False)
class Unit:
    """A scene of a run. decided_by: as `TrackRun.decided_by`, and what is drawn of it. code: of the process that
    made the unit. views: what is drawn, as `file_viewer` has it, into the folder where the unit is kept."""

    run: TrackRun
    scene_id: int
    decided_by: dict[str, object]
    code: str
    views: tuple[str, ...] = ()

    @property
    def fingerprint(self) -> str:
        return fingerprint_of(self.decided_by)


def units_of(
    run: TrackRun, scene_ids: Sequence[int], views: tuple[str, ...] = ()
) -> tuple[list[Unit], dict[str, object]]:
    """The run's units, in the order of the scenes, and what its report says of it. Opens the backend.

    Raises ConfigError and SourceError where the run cannot be.
    """
    dataset = opened_dataset(run.dataset)
    for scene_id in scene_ids:
        dataset.scene(scene_id, run.given_masks)  # refuses scenes and masks that are not there
    for object_id in run.object_ids or ():
        require("object", object_id, dataset.object_ids, dataset.name)
    backend = run.protocol().backend
    decided = [run.decided_by(scene_id, backend) | {"drawn": sorted(set(views))} for scene_id in scene_ids]
    units = [Unit(run, s, d, code_fingerprint(), views) for s, d in zip(scene_ids, decided, strict=True)]
    return units, run.stated(backend)


def track_units(
    units: Sequence[Unit],
    kept: KeptUnits | None = None,
    spreading: Spreading | None = None,
    frames_shown: Progress | None = None,
    units_shown: UnitsShown | None = None,
    stop: bool = True,
) -> list[Outcome]:
    """What every unit came to, in their order, whatever the order in which they were finished.

    kept: where finished units are, and new ones go; None keeps nothing. frames_shown: progress through the frames of a
    unit, where all are tracked in this process; units_shown: through the units, elsewhere. stop: raise the first error
    of the tracker's; otherwise it stands in the place of its unit.
    """
    spreading = spreading or Spreading()
    outcomes: dict[str, Outcome] = {}
    for unit in units:
        if kept and unit.fingerprint not in outcomes and (before := kept.read(unit.fingerprint)):
            outcomes[unit.fingerprint] = before
    missing = list({unit.fingerprint: unit for unit in units if unit.fingerprint not in outcomes}.values())
    if not spreading.here:
        opened_backend.cache_clear()  # the others open their own
    threads = max((unit.run.threads for unit in missing), default=1)
    try:
        stages = [kept.stage(unit.fingerprint) if kept and unit.views else None for unit in missing]
        work = partial(_finished, frames_shown=frames_shown) if spreading.here else _finished
        found = spread(work, list(zip(missing, stages, strict=True)), spreading, threads)
        for place, outcome in found if spreading.here else (units_shown or _not_shown)(found, len(missing), "scenes"):
            if isinstance(outcome, TrackerError) and stop:
                raise outcome
            if kept and isinstance(outcome, Tracked):
                kept.keep(missing[place].decided_by, outcome)
            outcomes[missing[place].fingerprint] = outcome
    finally:
        if kept:
            for unit in missing:
                kept.discard(unit.fingerprint)
        opened_backend.cache_clear()
        opened_dataset.cache_clear()
    return [outcomes[unit.fingerprint] for unit in units]


def _finished(item: tuple[Unit, Path | None], frames_shown: Progress | None = None) -> Outcome:
    """A unit's result, or why there is none. Called in whatever process is to do it."""
    unit, folder = item
    try:
        if code_fingerprint() != unit.code:
            raise ConfigError(f"{platform.node()} would track with other source code than this: install the same there")
        dataset, protocol = opened_dataset(unit.run.dataset), unit.run.protocol()
        viewer = partial(file_viewer, unit.views, folder)
        with torch_threads(unit.run.threads):
            objects, shown = unit.run.object_ids, frames_shown or _not_shown
            return track_scene(dataset, unit.scene_id, protocol, objects, viewer, shown)
    except TrackerError as error:
        return error


def _not_shown(items: Iterable[Item], total: int, what: str) -> Iterable[Item]:  # noqa: ARG001
    return items
