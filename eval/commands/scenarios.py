"""`python -m eval scenarios`: does the tracker know when it is lost, and does it come back?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tracker.terminal import STDERR, hush, progress

if TYPE_CHECKING:
    from eval.scenarios.run import ScenarioRun


@dataclass
class Scenarios:
    """Track objects that are hidden, taken away, touched, jerked past, relit, without depth or swapped, in scenes that
    are rendered: pointed out in the first frame only, then carried."""

    names: tyro.conf.Positional[tuple[str, ...]] = ()
    """Which scenarios: hidden, away, gone, hand, jerk, lights, blind, swapped. Default: all."""
    seeds: int = 6
    """How many runs a scenario, each with an object, paths, clutter and times of its own; six have an object each."""
    first_seed: int = 0
    """The first of the seeds, which follow each other."""
    views: int = 4
    """Reference frames, of a scene in which the object alone turns once all around."""
    size: str = "320x240"
    """Of the pictures, WIDTHxHEIGHT."""
    config: Path | None = None
    """YAML file with settings that differ from the defaults; masks are carried in any case."""
    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """File for every frame's state, confidence, evidence, error and what can be seen of the object."""
    overwrite: bool = False
    """Replace the file if it exists."""
    jobs: int = 1
    """Processes that run side by side; -1 is one a core."""
    quiet: bool = False
    """Nothing on the terminal but warnings and errors."""

    def __call__(self) -> None:
        from eval.scenarios.confidence import confidence_quality
        from eval.scenarios.report import confidence_line, cost_line, table, write_runs
        from eval.scenarios.run import run_scenario
        from eval.scenarios.summary import pooled_frames, summarise
        from eval.spread import Spreading, spread
        from tracker.output import require_free

        hush(self.quiet)
        if self.json:
            require_free(self.json, self.overwrite)
        spreading, runs = Spreading(self.jobs), self._runs()
        logs = dict(progress(spread(run_scenario, runs, spreading), len(runs), "scenarios"))
        ordered = [logs[place] for place in range(len(runs))]
        names = list(dict.fromkeys(run.scenario for run in runs))
        summaries = [summarise(name, [log for log in ordered if log.scenario == name]) for name in names]
        quality = confidence_quality(pooled_frames(ordered))
        if self.json:
            protocol: dict[str, object] = {
                "masks": "carried from the first frame",
                "views": self.views,
                "size": self.size,
                "seeds": list(range(self.first_seed, self.first_seed + self.seeds)),
                "config": runs[0].config.model_dump(mode="json"),
            }
            write_runs(self.json, protocol, summaries, quality, ordered)
        STDERR.print(table(summaries, f"{self.seeds} seeds from {self.first_seed}, {self.size}, {self.views} views"))
        for line in (confidence_line(quality), cost_line(ordered)):
            STDERR.print(line, highlight=False)
        if self.json:
            STDERR.print(f"written to {self.json}")

    def _runs(self) -> list[ScenarioRun]:
        """Raises ConfigError where there is nothing to run, or no such scenario."""
        from eval.scenarios.run import SCENARIOS, ScenarioRun
        from tracker.config import parse_config, read_config
        from tracker.errors import ConfigError

        for name in self.names:
            if name not in SCENARIOS:
                raise ConfigError(f"there is no scenario {name!r}; there is {', '.join(SCENARIOS)}")
        if self.seeds < 1 or self.first_seed < 0 or self.views < 1:
            raise ConfigError(
                f"--seeds and --views are at least 1 and --first-seed at least 0, got {self.seeds}, {self.views} and "
                f"{self.first_seed}"
            )
        config = parse_config({**read_config(self.config).model_dump(), "masks": "carried"}, "eval scenarios")
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        names = dict.fromkeys(self.names or SCENARIOS)
        return [ScenarioRun(name, seed, self.size, self.views, config) for name in names for seed in seeds]
