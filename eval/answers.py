"""Which targets are asked for, and which of the estimates of an object in an image is the answer."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence

from eval.bop_results import Estimate
from eval.datasets import Dataset, Target, require

log = logging.getLogger(__name__)


def targets_of(
    dataset: Dataset, scene_ids: Sequence[int] | None, object_ids: Sequence[str] | None
) -> list[tuple[int, Target]]:
    """(scene, target) of the scenes and objects, all unless given. Raises SourceError where one is not there."""
    for object_id in object_ids or ():
        require("object", object_id, dataset.object_ids, dataset.name)
    return [
        (scene_id, target)
        for scene_id in (dataset.scene_ids if scene_ids is None else sorted(set(scene_ids)))
        for target in dataset.targets(scene_id)
        if object_ids is None or target.object_id in object_ids
    ]


def best_estimates(estimates: Iterable[Estimate]) -> tuple[dict[tuple[int, int, int], Estimate], int]:
    """The best-scored estimate of every (scene, image, object), the first of equals; and how many are beside it."""
    best: dict[tuple[int, int, int], Estimate] = {}
    surplus = 0
    for estimate in estimates:
        key = (estimate.scene_id, estimate.image_id, estimate.object_id)
        surplus += key in best
        if key not in best or estimate.score > best[key].score:
            best[key] = estimate
    if surplus:
        log.warning("%d estimates have a better one of the same object in the same image; only that is scored", surplus)
    return best, surplus
