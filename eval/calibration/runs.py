"""What is tracked to fit to: easy and hard, with one object and with many, in all the ways that a tracker is used."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count, product
from typing import Literal

from eval.scenarios.run import SCENARIOS
from tracker.config import TrackerConfig
from tracker.sources.synthetic.things.objects import OBJECTS

CROWDED = ("tabletop", "shelf")  # six objects each
LEAVING = "leave"
BELIEVE, REGAIN = 0.02, 0.05  # so little that wrong poses are followed too: a fit has to see them


@dataclass(frozen=True, slots=True)
class CalibrationRun:
    """One tracking of one rendered scene. size: WIDTHxHEIGHT. views: reference frames. noise: of the sensor, 1 is the
    usual. every: of so many frames one is tracked. masks, prior: as in `TrackerConfig`. object_id: in scenes of one
    object, None for the seed's."""

    scene: str
    seed: int
    size: str
    views: int
    noise: float = 1.0
    every: int = 1
    masks: Literal["given", "carried"] = "carried"
    prior: bool = True
    object_id: str | None = None

    @property
    def request(self) -> str:
        """The scene, as `open_scene` reads it."""
        hero = f"&object={self.object_id}" if self.object_id else ""
        return f"{self.scene}?seed={self.seed}&size={self.size}&noise={self.noise:g}{hero}"

    @property
    def name(self) -> str:
        how = "" if self.prior else ", no prior"
        return f"{self.request}, every {self.every}, {self.views} views, masks {self.masks}{how}"

    @property
    def config(self) -> TrackerConfig:
        return TrackerConfig(prior=self.prior, masks=self.masks, believe=BELIEVE, regain=REGAIN)


def calibration_runs(first_seed: int, seeds: int, size: str) -> list[CalibrationRun]:
    """All runs, no two of the same seed, from `first_seed` on. seeds: runs of each scenario."""
    seed = count(first_seed)
    scenarios = [CalibrationRun(name, next(seed), size, 4) for name in SCENARIOS for _ in range(seeds)]
    leaving = [CalibrationRun(LEAVING, next(seed), size, 4, object_id=object_id) for object_id in OBJECTS]
    return [*scenarios, *leaving, *_crowded(seed, size)]


def _crowded(seed: Iterator[int], size: str) -> Iterator[CalibrationRun]:
    for scene in CROWDED:
        yield CalibrationRun(scene, next(seed), size, 2)
        for noise in (1, 2, 3):
            yield CalibrationRun(scene, next(seed), size, 2, noise=noise, every=3)
        for views, prior in product((1, 2, 4), (True, False)):
            yield CalibrationRun(scene, next(seed), size, views, every=6, masks="given", prior=prior)
