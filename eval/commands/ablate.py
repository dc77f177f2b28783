"""`python -m eval ablate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tracker.terminal import STDERR, progress

if TYPE_CHECKING:
    from eval.preset import Preset


@dataclass
class Ablate:
    """Track a dataset in several ways, as a preset lists them, and compare: one table of the paper a preset."""

    preset: tyro.conf.Positional[str | None] = None
    """A preset that comes along (--list), or a YAML file."""
    list_presets: Annotated[bool, tyro.conf.arg(name="list")] = False
    """Say which presets come along."""
    dataset: str | None = None
    """bop:PATH, ycb-video:PATH, nocs:PATH, ycbineoat:PATH or synthetic:NAME."""
    out: Path | None = None
    """Folder for ablation.json and ablation.md, and for finished scenes (cells/): started again, only what is missing
    or has changed is tracked."""
    scenes: tuple[int, ...] | None = None
    """Only these scenes."""
    objects: tuple[str, ...] | None = None
    """Only these objects."""
    backend: str = "attributes"
    """Saliency backend of the cells that do not say which."""
    weights: str | None = None
    """Weights of that backend."""
    device: str = "auto"
    """Where backends run."""
    vocabulary: str | None = None
    """Concepts of the cells that do not say which."""
    views: int = 2
    """Reference frames of the cells that do not say how many."""
    vsd: bool = False
    """Measure VSD too, and with it BOP's AR."""
    config: Path | None = None
    """YAML file with settings that differ from the defaults; the cells' differences are laid over them."""
    jobs: int = 1
    """Processes that track scenes of all cells side by side; -1 is one a core. Times grow where they share cores."""
    cluster: str | None = None
    """dask://HOST:PORT or ray://HOST:PORT, as for eval track."""
    threads: int = 1
    """Threads of torch in each process."""

    def __call__(self) -> None:
        from eval.preset import preset_path, read_preset, shipped_presets
        from tracker.errors import ConfigError

        if self.list_presets:
            for name in shipped_presets():
                STDERR.print(f"{name}: {read_preset(name).title}", highlight=False)
            return
        if self.preset is None or self.dataset is None or self.out is None:
            raise ConfigError("eval ablate needs a PRESET (--list has them), --dataset and --out DIR")
        self._run(read_preset(self.preset), preset_path(self.preset).parent, self.dataset, self.out)

    def _run(self, preset: Preset, folder: Path, dataset_name: str, out: Path) -> None:
        from eval.ablation import run_cells
        from eval.ablation_report import terminal_table, write_ablation
        from eval.datasets import open_dataset
        from eval.kept_units import KeptUnits
        from eval.spread import Spreading
        from eval.track_run import TrackRun
        from reference.vocabulary import read_vocabulary
        from tracker.config import read_config
        from tracker.errors import ConfigError, OutputError

        if out.is_file() or (out.is_dir() and any(out.iterdir()) and not (out / "cells").is_dir()):
            raise OutputError(f"{out} holds something that is no ablation; give another folder")
        spreading = Spreading(self.jobs, self.cluster)
        common = TrackRun(
            dataset=dataset_name,
            config=read_config(self.config),
            backend=self.backend,
            weights=self.weights,
            device=self.device,
            vocabulary=self.vocabulary,
            vocabularies=read_vocabulary(self.vocabulary) if self.vocabulary else None,
            views=self.views,
            object_ids=self.objects,
            threads=self.threads,
        )
        dataset = open_dataset(dataset_name)
        scene_ids = tuple(dataset.scene_ids if self.scenes is None else self.scenes)
        kept = KeptUnits(out / "cells")
        results = run_cells(preset, common, dataset, scene_ids, kept, folder, spreading, self.vsd, progress, progress)
        facts: dict[str, object] = {
            "dataset": dataset_name,
            "scenes": list(scene_ids),
            "instances": next((int(r.scores.pooled["instances"]) for r in results if r.scores), 0),
            "side by side": f"{spreading.cluster or spreading.jobs} (times hold this share of the machine)",
        }
        failed = [result for result in results if result.failure]
        if len(failed) == len(results):
            raise ConfigError(f"no cell of {self.preset} could be run: {failed[0].failure}")
        write_ablation(out, preset, results, facts)
        STDERR.print(terminal_table(preset, results))
        found, whole = sum(r.kept for r in results), sum(len(r.fingerprints) for r in results)
        STDERR.print(f"{found} of {whole} scenes of the cells were finished before; written to {out}", highlight=False)
        if failed:
            names = ", ".join(repr(result.cell.name) for result in failed)
            raise ConfigError(
                f"{len(failed)} of {len(results)} cells were not run: {names}; {out}/ablation.md says why"
            )
