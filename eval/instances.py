"""Estimates meet targets: a row of errors for every target."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from eval.answers import best_estimates, targets_of
from eval.bop_results import Estimate
from eval.datasets import Dataset, ObjectModel, Target
from eval.object_errors import PoseErrors, missing_pose, pose_errors
from eval.pictures import Cameras, PosePair, surface_errors, why_no_cameras
from eval.visible_surface import TAUS

log = logging.getLogger(__name__)

ObjectInImage = tuple[int, str, int]  # scene, object, image


@dataclass(frozen=True, slots=True)
class InstanceError:
    """The errors of one target (`PoseErrors` says which); all are infinite where its pose is missing, and iou is 0.

    diameter_m: the object's. symmetric: whether ADD(-S) takes its ADD-S; None where nobody says. vsd: at the ten
    misalignments, None where it was not asked for or the object has no mesh.
    """

    scene_id: int
    image_id: int
    object_id: str
    diameter_m: float
    add_m: float
    adds_m: float
    rotation_deg: float
    translation_m: float
    missing: bool
    symmetric_rotation_deg: float
    mssd_m: float
    mspd_px: float
    iou: float
    symmetric: bool | None
    vsd: tuple[float, ...] | None


@dataclass(frozen=True, slots=True, eq=False)
class Instances:
    """errors: a row a target, by the object's number, then by scene and image, or in the order that was asked for.

    symmetric: those of the objects that count as symmetric for ADD(-S); None where nobody declares anything.
    excluded: targets left out on demand. ignored: estimates where there is no target. surplus: estimates beside one
    of a better score of the same object in the same image. no_cameras: why MSPD could not be measured, None where it
    was. without_mesh: objects of which no picture can be rendered, so that they have no VSD.
    """

    errors: tuple[InstanceError, ...]
    symmetric: tuple[str, ...] | None
    excluded: int
    ignored: int
    surplus: int
    no_cameras: str | None
    without_mesh: tuple[str, ...]


def measure(
    dataset: Dataset,
    estimates: Iterable[Estimate],
    scene_ids: Sequence[int] | None = None,
    object_ids: Sequence[str] | None = None,
    exclude: Collection[ObjectInImage] = frozenset(),
    symmetric: Collection[str] | None = None,
    with_vsd: bool = False,
) -> Instances:
    """The errors of every target of the scenes and objects (all unless given) but those in `exclude`.

    symmetric: the objects whose ADD(-S) is ADD-S, instead of those that the dataset declares. with_vsd: read the depth
    of every image for VSD. Raises SourceError where the dataset does not have such a scene or object, or lacks a model,
    or a picture for VSD.
    """
    found = targets_of(dataset, scene_ids, object_ids)
    numbers = {object_id: dataset.number(object_id) for object_id in {t.object_id for _, t in found}}
    best, surplus = best_estimates(estimates)
    ignored = len(best.keys() - {(scene_id, t.image_id, numbers[t.object_id]) for scene_id, t in found})
    if ignored:
        log.info("%d estimates are of no target and are ignored", ignored)

    left_out = frozenset(exclude)
    kept: dict[str, list[tuple[int, Target]]] = {}
    for scene_id, t in sorted(found, key=lambda pair: numbers[pair[1].object_id]):
        if (scene_id, t.object_id, t.image_id) not in left_out:
            kept.setdefault(t.object_id, []).append((scene_id, t))
    questions = [(scene_id, t) for targets in kept.values() for scene_id, t in targets]
    answers = [best.get((scene_id, t.image_id, numbers[t.object_id])) for scene_id, t in questions]
    measured = measure_answers(dataset, questions, answers, symmetric, with_vsd)
    return replace(measured, excluded=len(found) - len(questions), ignored=ignored, surplus=surplus)


def measure_answers(
    dataset: Dataset,
    questions: Sequence[tuple[int, Target]],
    answers: Sequence[Estimate | None],
    symmetric: Collection[str] | None = None,
    with_vsd: bool = False,
) -> Instances:
    """The errors of one answer a question, in the order of the questions (scene, target), of which any may be there
    several times; None is a missing pose. The rest is as in `measure`."""
    models = {object_id: dataset.model(object_id) for object_id in dict.fromkeys(t.object_id for _, t in questions)}
    declared = _symmetric(models, symmetric)
    cameras = Cameras(dataset)
    no_cameras = why_no_cameras(cameras, [(scene_id, t.index) for scene_id, t in questions])
    errors = _errors(models, questions, answers, cameras if no_cameras is None else None)
    surfaces = _surfaces(dataset, models, questions, answers) if with_vsd else {}
    rows = [
        InstanceError(
            scene_id,
            t.image_id,
            t.object_id,
            models[t.object_id].diameter_m,
            **asdict(errors[k]),
            missing=answers[k] is None,
            symmetric=None if declared is None else t.object_id in declared,
            vsd=surfaces.get(k),
        )
        for k, (scene_id, t) in enumerate(questions)
    ]
    return Instances(
        errors=tuple(rows),
        symmetric=declared,
        excluded=0,
        ignored=0,
        surplus=0,
        no_cameras=no_cameras,
        without_mesh=tuple(object_id for object_id, model in models.items() if model.triangles is None),
    )


def _symmetric(models: Mapping[str, ObjectModel], told: Collection[str] | None) -> tuple[str, ...] | None:
    """Of the objects, those that somebody declares symmetric; None where nobody says."""
    if told is not None:
        if unknown := sorted(set(told) - models.keys()):
            log.warning("told to be symmetric, but not among the objects that are scored: %s", ", ".join(unknown))
        return tuple(object_id for object_id in models if object_id in told)
    if any(model.symmetric is None for model in models.values()):
        return None
    return tuple(object_id for object_id, model in models.items() if model.symmetric)


def _errors(
    models: Mapping[str, ObjectModel],
    questions: Sequence[tuple[int, Target]],
    answers: Sequence[Estimate | None],
    cameras: Cameras | None,
) -> list[PoseErrors]:
    """One a question, in their order. cameras: None where they are not known."""
    errors = [missing_pose(cameras is not None)] * len(questions)
    for object_id, model in models.items():
        asked = [k for k, (_, t) in enumerate(questions) if t.object_id == object_id]
        log.info("measuring %d poses of object %s", len(asked), object_id)
        pairs = [(k, answer.T_cam_obj) for k in asked if (answer := answers[k]) is not None]
        places = [(questions[k][0], questions[k][1].index) for k, _ in pairs]
        of_images = cameras and [cameras(*place) for place in places]
        found = pose_errors(model, [e for _, e in pairs], [questions[k][1].T_cam_obj for k, _ in pairs], of_images)
        for (k, _), each in zip(pairs, found, strict=True):
            errors[k] = each
    return errors


def _surfaces(
    dataset: Dataset,
    models: Mapping[str, ObjectModel],
    questions: Sequence[tuple[int, Target]],
    answers: Sequence[Estimate | None],
) -> dict[int, tuple[float, ...]]:
    """VSD by the position of the question; infinite where the pose is missing, nothing where the object has no mesh."""
    pairs = [
        PosePair(scene_id, t.index, t.object_id, answer.T_cam_obj, t.T_cam_obj, k)
        for k, ((scene_id, t), answer) in enumerate(zip(questions, answers, strict=True))
        if answer is not None
    ]
    log.info("reading the depth of the images of %d poses for VSD", len(pairs))
    missing = {
        k: (np.inf,) * len(TAUS)
        for k, (_, t) in enumerate(questions)
        if answers[k] is None and models[t.object_id].triangles is not None
    }
    return missing | surface_errors(dataset, pairs, models)
