"""`python -m eval calibrate`: where the weights of the confidence come from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tracker.terminal import STDERR, hush, progress

if TYPE_CHECKING:
    from eval.calibration.rows import JudgedPose


@dataclass
class Calibrate:
    """Track rendered scenes, following wrong poses too, and fit the weights of the confidence to what is right there:
    `tracker/confidence.py` holds them."""

    seeds: int = 4
    """Runs of each scenario; the crowded scenes come on top."""
    first_seed: int = 1000
    """The first of the seeds, which follow each other: far from those of eval scenarios, whose runs stay unseen."""
    size: str = "320x240"
    """Of the pictures, WIDTHxHEIGHT."""
    rows: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Fit to the poses of a file that --json wrote, and track nothing."""
    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """File for all poses: what spoke for each, and whether it is right."""
    overwrite: bool = False
    """Replace the file if it exists."""
    jobs: int = 1
    """Processes that run side by side; -1 is one a core."""
    quiet: bool = False
    """Nothing on the terminal but warnings and errors."""

    def __call__(self) -> None:
        from eval.calibration.cross_validation import held_out_chances, judge, judge_by_scene
        from eval.calibration.logistic import chances, fit
        from eval.calibration.report import judgement_table, pasted, reliability_table
        from eval.calibration.rows import read_poses, training_set
        from tracker.confidence import MEASURES, WEIGHTS
        from tracker.errors import ConfigError
        from tracker.output import require_free

        hush(self.quiet)
        if self.rows and self.json:
            raise ConfigError("--rows and --json: what was read from a file is not written again")
        if self.seeds < 1 or self.first_seed < 0:
            raise ConfigError(f"--seeds is at least 1, --first-seed at least 0, got {self.seeds} and {self.first_seed}")
        if self.json:
            require_free(self.json, self.overwrite)
        rows = training_set(read_poses(self.rows) if self.rows else self._collected())
        weights = fit(rows.measures, rows.right, rows.weights)
        by_scene, by_object = (held_out_chances(rows, groups) for groups in (rows.scenes, rows.object_ids))
        pooled = judge("all, by fits to the other scenes", by_scene, rows.right)
        ways = [
            pooled,
            judge("all, by fits to the other objects", by_object, rows.right),
            judge("all, by this fit", chances(rows.measures, weights), rows.right),
            judge("all, by the weights as they are", chances(rows.measures, WEIGHTS), rows.right),
        ]
        STDERR.print(
            judgement_table([*judge_by_scene(by_scene, rows), *ways], "each kind by a fit to the other scenes")
        )
        STDERR.print(
            reliability_table(pooled.reliability, "confidence by a fit to the other scenes, and what is right")
        )
        STDERR.print(pasted(MEASURES, weights), highlight=False, markup=False, soft_wrap=True)

    def _collected(self) -> list[JudgedPose]:
        from eval.calibration.collect import collect
        from eval.calibration.rows import write_poses
        from eval.calibration.runs import BELIEVE, REGAIN, calibration_runs
        from eval.spread import Spreading, spread

        runs = calibration_runs(self.first_seed, self.seeds, self.size)
        found = dict(progress(spread(collect, runs, Spreading(self.jobs)), len(runs), "scenes"))
        poses = [pose for place in range(len(runs)) for pose in found[place]]
        if self.json:
            protocol = {"runs": [run.name for run in runs], "believe": BELIEVE, "regain": REGAIN}
            write_poses(self.json, protocol, poses)
            STDERR.print(f"{len(poses)} poses written to {self.json}", highlight=False)
        return poses
