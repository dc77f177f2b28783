"""`python -m eval ablate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tracker.terminal import ALWAYS, STDERR, hush, progress

if TYPE_CHECKING:
    from eval.preset import Preset


@dataclass
class Ablate:
    """Track a dataset in several ways, as a preset lists them, and compare: one table of the paper a preset."""

    preset: tyro.conf.Positional[str | None] = None
    """A preset that comes along (--list), or a YAML file."""
    list_presets: Annotated[bool, tyro.conf.arg(name="list")] = False
    """Say which presets come along."""
    dataset: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """bop:PATH, ycb-video:PATH, nocs:PATH, ycbineoat:PATH or synthetic:NAME. Given several times, they stand side
    by side in one table."""
    out: Path | None = None
    """Folder for ablation.json, ablation.md and ablation.html, and for finished scenes (cells/): started again, only
    what is missing or has changed is tracked."""
    scenes: tuple[int, ...] | None = None
    """Only these scenes; every dataset has to have them."""
    objects: tuple[str, ...] | None = None
    """Only these objects; every dataset has to have them."""
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
    quiet: bool = False
    """Nothing on the terminal but warnings and errors."""

    def __call__(self) -> None:
        from eval.preset import preset_path, read_preset, shipped_presets
        from tracker.errors import ConfigError

        hush(self.quiet)
        if self.list_presets:
            for name in shipped_presets():
                ALWAYS.print(f"{name}: {read_preset(name).title}", highlight=False)
            return
        if self.preset is None or not self.dataset or self.out is None:
            raise ConfigError("eval ablate needs a PRESET (--list has them), --dataset and --out DIR")
        self._run(read_preset(self.preset), preset_path(self.preset).parent, self.out)

    def _run(self, preset: Preset, folder: Path, out: Path) -> None:
        from eval.ablation import run_cells
        from eval.ablation_report import write_ablation
        from eval.ablation_table import dataset_labels, terminal_table
        from eval.datasets import open_dataset
        from eval.kept_units import KeptUnits
        from eval.spread import Spreading
        from eval.track_run import TrackRun
        from reference.vocabulary import read_vocabulary
        from tracker.config import read_config
        from tracker.errors import ConfigError, OutputError

        if out.is_file() or (out.is_dir() and any(out.iterdir()) and not (out / "cells").is_dir()):
            raise OutputError(f"{out} holds something that is no ablation; give another folder")
        labels = dataset_labels(self.dataset)
        spreading = Spreading(self.jobs, self.cluster)
        common = TrackRun(
            dataset=self.dataset[0],
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
        datasets = {name: open_dataset(name) for name in self.dataset}
        kept = KeptUnits(out / "cells")
        found = run_cells(preset, common, datasets, self.scenes, kept, folder, spreading, self.vsd, progress, progress)
        results = [result for of_dataset in found for result in of_dataset.results]
        failed = [
            (label, result)
            for label, of_dataset in zip(labels, found, strict=True)
            for result in of_dataset.results
            if result.failure
        ]
        if len(failed) == len(results):
            raise ConfigError(f"no cell of {self.preset} could be run: {failed[0][1].failure}")
        where = f"{spreading.cluster or spreading.jobs} (times hold this share of the machine)"
        write_ablation(out, preset, found, {"side by side": where})
        STDERR.print(terminal_table(preset, found))
        before, whole = sum(r.kept for r in results), sum(len(r.fingerprints) for r in results)
        STDERR.print(f"{before} of {whole} scenes of the cells were finished before; written to {out}", highlight=False)
        if failed:
            names = ", ".join(f"{result.cell.name!r}{f' on {label}' if label else ''}" for label, result in failed)
            raise ConfigError(
                f"{len(failed)} of {len(results)} cells were not run: {names}; {out}/ablation.md says why"
            )
