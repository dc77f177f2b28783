"""Runs the cells of a preset: what is finished is not tracked again, what cannot be run says why."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from eval.datasets import Dataset
from eval.kept_units import KeptUnits
from eval.occlusion import Occlusion, occlusion
from eval.predict import Progress
from eval.preset import Preset, Variation, over
from eval.score import Scores, score
from eval.spread import Spreading
from eval.track_run import TrackRun
from eval.tracked import Tracked
from eval.units import Unit, UnitsShown, track_units, units_of
from reference.vocabulary import read_vocabulary
from tracker.config import parse_config
from tracker.errors import ConfigError, TrackerError

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class CellResult:
    """cell: what was varied. failure: why it could not be run; the rest is empty then. kept, units: scenes that were
    finished before, and in all. latency_ms: as in `scores.json`. fingerprints: of the scenes."""

    cell: Variation
    failure: str = ""
    scores: Scores | None = None
    latency_ms: dict[str, object] | None = None
    occlusion: Occlusion | None = None
    fingerprints: tuple[str, ...] = ()
    kept: int = 0

    def value(self, column: str) -> float | None:
        """What the cell has in a column of the table, None where it was not measured."""
        if self.scores is None:
            return None
        if column == "ms":
            found = (self.latency_ms or {}).get("median")
            return found if isinstance(found, float) else None
        found = self.scores.pooled.get(column)
        return None if found is None or found != found else float(found)  # NaN: not one instance


@dataclass(frozen=True, slots=True, eq=False)
class DatasetCells:
    """What the cells of a preset came to on one dataset. dataset: the name that opens it. scene_ids: those that were
    tracked. results: a cell each, in the order of the preset."""

    dataset: str
    scene_ids: tuple[int, ...]
    results: tuple[CellResult, ...]

    @property
    def instances(self) -> int:
        """How many were scored, the same in every cell with as many reference frames; 0 where no cell was run."""
        return next((int(result.scores.pooled["instances"]) for result in self.results if result.scores), 0)


@dataclass(frozen=True, slots=True, eq=False)
class _Prepared:
    units: list[Unit]
    stated: dict[str, object]
    failure: str


def run_of(cell: Variation, common: TrackRun, folder: Path) -> TrackRun:
    """The run that a cell is: its differences laid over what is common. folder: of the preset, where a vocabulary's
    file may be. Raises ConfigError that names the setting."""
    told = cell.options.model_dump(exclude_none=True)
    told |= {"initialisation": told.pop("init")} if "init" in told else {}
    if "vocabulary" in told:
        beside = folder / told["vocabulary"]
        told["vocabularies"] = read_vocabulary(str(beside) if beside.is_file() else told["vocabulary"])
    if "backend" in told and "weights" not in told:
        told["weights"] = None  # those of another backend are of no use to it
    config = parse_config(over(common.config.model_dump(), cell.config), f"cell {cell.name!r}")
    return replace(common, config=config, **told)


def run_cells(
    preset: Preset,
    common: TrackRun,
    datasets: Mapping[str, Dataset],
    scene_ids: Sequence[int] | None,
    kept: KeptUnits,
    folder: Path,
    spreading: Spreading | None = None,
    with_vsd: bool = False,
    frames_shown: Progress | None = None,
    units_shown: UnitsShown | None = None,
) -> list[DatasetCells]:
    """Every cell of the preset on every dataset, in their orders. The scenes of all are spread together.

    common: the run that the cells differ from, but for its dataset. datasets: by the names that open them. scene_ids:
    of each of them, None for all that it has. A cell that raises a TrackerError is a result with that failure. Raises
    ConfigError, before anything is tracked, where there is a dataset that no cell can be run on.
    """
    cells, before = preset.cells(), set(kept.names())
    scenes = {name: tuple(dataset.scene_ids if scene_ids is None else scene_ids) for name, dataset in datasets.items()}
    prepared = {
        name: [_prepare(cell, replace(common, dataset=name), scenes[name], folder) for cell in cells]
        for name in datasets
    }
    for name, of_cells in prepared.items():
        if all(each.failure for each in of_cells):
            raise ConfigError(f"no cell of {preset.title!r} can be run on {name}: {of_cells[0].failure}")
    units = [unit for of_cells in prepared.values() for each in of_cells for unit in each.units]
    outcomes = iter(track_units(units, kept, spreading, frames_shown, units_shown, stop=False))
    found = []
    for name, dataset in datasets.items():
        results = []
        for cell, each in zip(cells, prepared[name], strict=True):
            of_scenes = [next(outcomes) for _ in each.units]
            failure = each.failure or "; ".join(str(one) for one in of_scenes if isinstance(one, TrackerError))
            if failure:
                log.warning("cell %r could not be run on %s: %s", cell.name, name, failure)
                results.append(CellResult(cell, failure))
                continue
            tracked = Tracked.joined(one for one in of_scenes if isinstance(one, Tracked))
            results.append(_scored(preset, cell, common, dataset, scenes[name], each, tracked, before, with_vsd))
        found.append(DatasetCells(name, scenes[name], tuple(results)))
    return found


def _scored(
    preset: Preset,
    cell: Variation,
    common: TrackRun,
    dataset: Dataset,
    scene_ids: Sequence[int],
    prepared: _Prepared,
    tracked: Tracked,
    before: set[str],
    with_vsd: bool,
) -> CellResult:
    scores = score(
        dataset,
        tracked.estimates,
        scene_ids=scene_ids,
        object_ids=common.object_ids,
        exclude=tracked.reference_frames,
        protocol={**prepared.stated, "models_refused": tracked.refused},
        tracking=tracked.counts,
        with_vsd=with_vsd,
    )
    names = tuple(unit.fingerprint for unit in prepared.units)
    seen = occlusion(dataset, scores.instances) if preset.analysis == "occlusion" else None
    return CellResult(cell, "", scores, tracked.latency_ms(), seen, names, len(before & set(names)))


def _prepare(cell: Variation, common: TrackRun, scene_ids: Sequence[int], folder: Path) -> _Prepared:
    try:
        units, stated = units_of(run_of(cell, common, folder), scene_ids)
    except TrackerError as error:
        return _Prepared([], {}, str(error))
    return _Prepared(units, stated, "")
