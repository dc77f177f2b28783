"""Estimates meet targets: which estimate answers which target, and the errors that it has."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eval.bop_results import Estimate
from eval.datasets import Dataset, ObjectModel, Target, require
from eval.metrics import add, adds, rotation_error_deg, translation_error_m
from tracker.geometry import Pose

log = logging.getLogger(__name__)

ObjectInImage = tuple[int, str, int]  # scene, object, image


@dataclass(frozen=True, slots=True)
class InstanceError:
    """The errors of one target; all are infinite where its pose is missing. diameter_m is the object's."""

    scene_id: int
    image_id: int
    object_id: str
    diameter_m: float
    add_m: float
    adds_m: float
    rotation_deg: float
    translation_m: float
    missing: bool


@dataclass(frozen=True, slots=True, eq=False)
class Instances:
    """errors: a row a target, by the object's number, then by scene and image.

    symmetric: those of the objects that the dataset declares symmetric; None where it declares nothing.
    excluded: targets left out on demand. ignored: estimates where there is no target. surplus: estimates beside one
    of a better score of the same object in the same image.
    """

    errors: tuple[InstanceError, ...]
    symmetric: tuple[str, ...] | None
    excluded: int
    ignored: int
    surplus: int


def measure(
    dataset: Dataset,
    estimates: Iterable[Estimate],
    scene_ids: Sequence[int] | None = None,
    object_ids: Sequence[str] | None = None,
    exclude: Collection[ObjectInImage] = frozenset(),
) -> Instances:
    """The errors of every target of the scenes and objects (all unless given) but those in `exclude`.

    Raises SourceError where the dataset does not have such a scene or object, or lacks a model.
    """
    found = _targets(dataset, scene_ids, object_ids)
    numbers = {object_id: dataset.number(object_id) for object_id in {t.object_id for _, t in found}}
    best, surplus = _best(estimates)
    ignored = len(best.keys() - {(scene_id, t.image_id, numbers[t.object_id]) for scene_id, t in found})
    if ignored:
        log.info("%d estimates are of no target and are ignored", ignored)

    left_out = frozenset(exclude)
    kept: dict[str, list[tuple[int, Target]]] = {}
    for scene_id, t in sorted(found, key=lambda pair: numbers[pair[1].object_id]):
        if (scene_id, t.object_id, t.image_id) not in left_out:
            kept.setdefault(t.object_id, []).append((scene_id, t))
    models = {object_id: dataset.model(object_id) for object_id in kept}
    errors: list[InstanceError] = []
    for object_id, targets in kept.items():
        log.info("measuring %d poses of object %s", len(targets), object_id)
        answers = [best.get((scene_id, t.image_id, numbers[object_id])) for scene_id, t in targets]
        errors += _errors(models[object_id], targets, [answer and answer.T_cam_obj for answer in answers])
    return Instances(tuple(errors), _symmetric(models), len(found) - len(errors), ignored, surplus)


def _targets(
    dataset: Dataset, scene_ids: Sequence[int] | None, object_ids: Sequence[str] | None
) -> list[tuple[int, Target]]:
    """(scene, target) of the scenes and objects, all unless given."""
    for object_id in object_ids or ():
        require("object", object_id, dataset.object_ids, dataset.name)
    return [
        (scene_id, target)
        for scene_id in (dataset.scene_ids if scene_ids is None else sorted(set(scene_ids)))
        for target in dataset.targets(scene_id)
        if object_ids is None or target.object_id in object_ids
    ]


def _symmetric(models: Mapping[str, ObjectModel]) -> tuple[str, ...] | None:
    if any(model.symmetric is None for model in models.values()):
        return None
    return tuple(object_id for object_id, model in models.items() if model.symmetric)


def _best(estimates: Iterable[Estimate]) -> tuple[dict[tuple[int, int, int], Estimate], int]:
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


def _errors(
    model: ObjectModel, targets: Sequence[tuple[int, Target]], answers: Sequence[Pose | None]
) -> list[InstanceError]:
    """One row a target, in their order; `answers` holds None where the pose is missing."""
    columns = np.full((4, len(targets)), np.inf)
    given = [k for k, answer in enumerate(answers) if answer is not None]
    estimated = [answer for answer in answers if answer is not None]
    truth = [targets[k][1].T_cam_obj for k in given]
    columns[0, given] = add(model.points_m, estimated, truth)
    columns[1, given] = adds(model.points_m, estimated, truth)
    columns[2, given] = rotation_error_deg(estimated, truth)
    columns[3, given] = translation_error_m(estimated, truth)
    return [
        InstanceError(
            scene_id, t.image_id, t.object_id, model.diameter_m, *map(float, column), missing=answers[k] is None
        )
        for k, ((scene_id, t), column) in enumerate(zip(targets, columns.T, strict=True))
    ]
