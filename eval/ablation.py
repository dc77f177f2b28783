"""Runs the cells of a preset: what is finished is not tracked again, what cannot be run says why."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from eval.datasets import Dataset
from eval.kept_units import KeptUnits
from eval.occlusion import Occlusion, occlusion
from eval.predict import Progress, Tracked
from eval.preset import Preset, Variation, over
from eval.score import Scores, score
from eval.spread import Spreading
from eval.track_run import TrackRun
from eval.units import Unit, UnitsShown, track_units, units_of
from reference.vocabulary import read_vocabulary
from tracker.config import parse_config
from tracker.errors import TrackerError

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
    dataset: Dataset,
    scene_ids: Sequence[int],
    kept: KeptUnits,
    folder: Path,
    spreading: Spreading | None = None,
    with_vsd: bool = False,
    frames_shown: Progress | None = None,
    units_shown: UnitsShown | None = None,
) -> list[CellResult]:
    """Every cell of the preset, in its order. The scenes of all cells are spread together.

    common: the run that the cells differ from. A cell that raises a TrackerError is a result with that failure.
    """
    cells, before = preset.cells(), set(kept.names())
    prepared = [_prepare(cell, common, scene_ids, folder) for cell in cells]
    units = [unit for each in prepared for unit in each.units]
    outcomes = iter(track_units(units, kept, spreading, frames_shown, units_shown, stop=False))
    results = []
    for cell, each in zip(cells, prepared, strict=True):
        found = [next(outcomes) for _ in each.units]
        failure = each.failure or "; ".join(str(one) for one in found if isinstance(one, TrackerError))
        if failure:
            log.warning("cell %r could not be run: %s", cell.name, failure)
            results.append(CellResult(cell, failure))
            continue
        tracked = Tracked.joined(one for one in found if isinstance(one, Tracked))
        scores = score(
            dataset,
            tracked.estimates,
            scene_ids=scene_ids,
            object_ids=common.object_ids,
            exclude=tracked.reference_frames,
            protocol={**each.stated, "models_refused": tracked.refused},
            tracking=tracked.counts,
            with_vsd=with_vsd,
        )
        names = tuple(unit.fingerprint for unit in each.units)
        seen = occlusion(dataset, scores.instances) if preset.analysis == "occlusion" else None
        results.append(CellResult(cell, "", scores, tracked.latency_ms(), seen, names, len(before & set(names))))
    return results


def _prepare(cell: Variation, common: TrackRun, scene_ids: Sequence[int], folder: Path) -> _Prepared:
    try:
        units, stated = units_of(run_of(cell, common, folder), scene_ids)
    except TrackerError as error:
        return _Prepared([], {}, str(error))
    return _Prepared(units, stated, "")
