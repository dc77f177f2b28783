"""`python -m eval bench scoring`: what the errors of ten thousand poses cost."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from eval.bench.measurement import Measurement
from tracker.terminal import progress

if TYPE_CHECKING:
    from eval.datasets import ObjectModel
    from tracker.geometry import Pose

ALL = 10_000


@dataclass
class ScoringBench(Measurement):
    """Measure every error but VSD of estimates of 21 objects, eight of them symmetric (up to 630 motions each), about
    a centimetre and five degrees off; then each error by itself on a tenth of them."""

    instances: int = ALL
    """How many poses; the time is scaled to 10,000."""
    vertices: int = 8000
    """Of each model."""

    def title(self) -> str:
        return "seconds for 10,000 poses of 21 objects"

    def rows(self, figures: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        for name, seconds in {"all": figures["seconds_for_10000"], **figures["parts"]}.items():
            yield name, f"{seconds:.1f}"

    def measured(self) -> dict[str, Any]:
        from eval.bench.scored_models import CAMERA, OBJECTS, model, poses
        from eval.object_errors import pose_errors

        each = max(1, round(self.instances / OBJECTS))
        numbers = range(1, OBJECTS + 1)
        models = {number: model(number, self.vertices) for number in numbers}
        given = {number: poses(number, models[number].symmetries, each) for number in numbers}
        scale = ALL / (each * OBJECTS)
        seconds, medians = 0.0, {}
        for number in progress(numbers, OBJECTS, "objects"):
            began = time.perf_counter()
            errors = pose_errors(models[number], *given[number], [CAMERA] * each)
            seconds += time.perf_counter() - began
            medians[number] = sorted(1000 * e.mssd_m for e in errors)[each // 2]
        few = max(1, each // 10)
        parts = {
            name: sum(_spent(part, models[n], given[n][0][:few], given[n][1][:few]) for n in numbers)
            for name, part in self._parts().items()
        }
        return {
            "seconds_for_10000": seconds * scale,
            "parts": {name: spent * scale * each / few for name, spent in parts.items()},
            "median_mssd_mm": medians,
            "settings": {"instances": each * OBJECTS, "objects": OBJECTS, "vertices": self.vertices},
        }

    def _parts(self) -> dict[str, Callable[[ObjectModel, list[Pose], list[Pose]], object]]:
        from eval.bench.scored_models import CAMERA
        from eval.box_overlap import NOCS_STEPS, box_iou
        from eval.metrics import add, adds
        from eval.symmetric_errors import mspd, mssd

        return {
            "add": lambda m, e, t: add(m.points_m, e, t),
            "adds": lambda m, e, t: adds(m.points_m, e, t),
            "mssd": lambda m, e, t: mssd(m.points_m, m.symmetries.motions(), e, t),
            "mspd": lambda m, e, t: mspd(m.points_m, m.symmetries.motions(), e, t, [CAMERA] * len(e)),
            "iou": lambda m, e, t: box_iou(m.points_m, m.symmetries.motions(NOCS_STEPS), e, t),
        }


def _spent(
    part: Callable[[ObjectModel, list[Pose], list[Pose]], object],
    model: ObjectModel,
    estimated: list[Pose],
    truth: list[Pose],
) -> float:
    began = time.perf_counter()
    part(model, estimated, truth)
    return time.perf_counter() - began
