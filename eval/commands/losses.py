"""`python -m eval losses`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from tracker.terminal import STDERR, hush, progress


@dataclass
class Losses:
    """Say what the points are lost to that are lacking from 100: for every wrong pose (over 1 cm), the first stage that
    would have to do better. Every frame stands alone, as with --prior off."""

    dataset: str
    """bop:PATH, ycb-video:PATH, nocs:PATH, ycbineoat:PATH or synthetic:NAME."""
    views: int = 2
    """Reference frames an object and scene."""
    scenes: tuple[int, ...] | None = None
    """Only these scenes."""
    objects: tuple[str, ...] | None = None
    """Only these objects."""
    backend: str = "attributes"
    """Which saliency backend finds the concepts."""
    config: Path | None = None
    """YAML file with settings that differ from the defaults."""
    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """File for the points by object and cause."""
    overwrite: bool = False
    """Replace the file if it exists."""
    jobs: int = 1
    """Processes that work on scenes side by side; -1 is one a core."""
    quiet: bool = False
    """Nothing on the terminal but warnings and errors."""

    def __call__(self) -> None:
        from eval.datasets import open_dataset
        from eval.environment import write_figures
        from eval.losses.cause import CAUSES
        from eval.losses.scene import LossRun, loss_table, losses_of, points_lost
        from eval.spread import Spreading, spread
        from tracker.config import read_config
        from tracker.errors import SourceError
        from tracker.output import require_free

        hush(self.quiet)
        if self.json:
            require_free(self.json, self.overwrite)
        config, spreading = read_config(self.config), Spreading(self.jobs)
        scene_ids = self.scenes or tuple(open_dataset(self.dataset).scene_ids)
        runs = [
            LossRun(self.dataset, scene_id, self.views, config, self.backend, self.objects) for scene_id in scene_ids
        ]
        losses = [
            loss for _, found in progress(spread(losses_of, runs, spreading), len(runs), "scenes") for loss in found
        ]
        if not losses:
            raise SourceError(f"{self.dataset} has no target of these scenes and objects")
        STDERR.print(loss_table(losses, f"{self.dataset}, {self.views} views: points lost"))
        for cause in CAUSES:
            if any(loss.cause == cause for loss in losses):
                STDERR.print(f"{cause}: {CAUSES[cause]}", highlight=False)
        if self.json:
            names = sorted({loss.object_id for loss in losses})
            by_object = {name: points_lost([loss for loss in losses if loss.object_id == name]) for name in names}
            write_figures(self.json, {"pooled": points_lost(losses), "objects": by_object, "instances": len(losses)})
