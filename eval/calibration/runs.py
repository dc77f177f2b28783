"""What is tracked to fit to: easy and hard, with one object and with many, in all the ways that a tracker is used."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count, pairwise, product
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
    usual. every: of so many frames one is tracked. masks, prior: as in `TrackerConfig`, and "mistaken" for those of
    other objects. object_id: in scenes of one object, None for the seed's. stranger: an object that is not in the scene
    and is looked for there."""

    scene: str
    seed: int
    size: str
    views: int
    noise: float = 1.0
    every: int = 1
    masks: Literal["given", "mistaken", "carried"] = "carried"
    prior: bool = True
    object_id: str | None = None
    stranger: str | None = None

    @property
    def request(self) -> str:
        """The scene, as `open_scene` reads it."""
        hero = f"&object={self.object_id}" if self.object_id else ""
        return f"{self.scene}?seed={self.seed}&size={self.size}&noise={self.noise:g}{hero}"

    @property
    def name(self) -> str:
        how = ("" if self.prior else ", no prior") + (f", {self.stranger} looked for" if self.stranger else "")
        return f"{self.request}, every {self.every}, {self.views} views, masks {self.masks}{how}"

    @property
    def config(self) -> TrackerConfig:
        lenient = TrackerConfig(prior=self.prior, believe=BELIEVE, regain=REGAIN)
        of_nowhere = {"sure": REGAIN} if self.stranger else {}
        return lenient.model_copy(update={"masks": "carried" if self.masks == "carried" else "given", **of_nowhere})


def calibration_runs(first_seed: int, seeds: int, size: str) -> list[CalibrationRun]:
    """All runs, no two of the same seed, from `first_seed` on. seeds: runs of each scenario."""
    seed = count(first_seed)
    scenarios = [CalibrationRun(name, next(seed), size, 4) for name in SCENARIOS for _ in range(seeds)]
    leaving = [CalibrationRun(LEAVING, next(seed), size, 4, object_id=object_id) for object_id in OBJECTS]
    return [*scenarios, *leaving, *_crowded(seed, size), *_strange(seed, size)]


def _crowded(seed: Iterator[int], size: str) -> Iterator[CalibrationRun]:
    for scene in CROWDED:
        yield CalibrationRun(scene, next(seed), size, 2)
        for noise in (1, 2, 3):
            yield CalibrationRun(scene, next(seed), size, 2, noise=noise, every=3)
        for views, prior in product((1, 2, 4), (True, False)):
            yield CalibrationRun(scene, next(seed), size, views, every=6, masks="given", prior=prior)


def _strange(seed: Iterator[int], size: str) -> Iterator[CalibrationRun]:
    """Nothing that is found there is right."""
    for scene, views in product(CROWDED, (2, 4)):
        yield CalibrationRun(scene, next(seed), size, views, every=6, masks="mistaken", prior=False)
    for shown, looked_for in pairwise((*OBJECTS, next(iter(OBJECTS)))):
        yield CalibrationRun(LEAVING, next(seed), size, 4, object_id=shown, stranger=looked_for)
