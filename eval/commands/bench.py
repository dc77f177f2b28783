"""`python -m eval bench`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from eval.bench.filter import FilterBench
from eval.bench.registration import RegistrationBench
from eval.bench.saliency import SaliencyBench
from eval.bench.scoring import ScoringBench
from eval.bench.soak import SoakBench


@dataclass
class Bench:
    """Measure speed, of saliency and registration as ratios between ways of the same work in one run; how steady
    poses are over time; and whether a long run keeps its memory and speed."""

    what: tyro.conf.OmitArgPrefixes[
        Annotated[SaliencyBench, tyro.conf.subcommand("saliency", prefix_name=False)]
        | Annotated[RegistrationBench, tyro.conf.subcommand("registration", prefix_name=False)]
        | Annotated[ScoringBench, tyro.conf.subcommand("scoring", prefix_name=False)]
        | Annotated[FilterBench, tyro.conf.subcommand("filter", prefix_name=False)]
        | Annotated[SoakBench, tyro.conf.subcommand("soak", prefix_name=False)]
    ]

    def __call__(self) -> None:
        self.what()
