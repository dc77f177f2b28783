"""Runs a method over pairs: a model of the anchor alone, then the query as its first and only frame, with no prior."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from eval.bop_results import Estimate
from eval.datasets import Dataset, category_of
from eval.instances import measure_answers
from eval.pairs import Pair, View
from eval.peers import method_kind, open_method
from eval.score import Scores, summarise
from reference.onboard import onboard
from reference.vocabulary import VocabularySet
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, OnboardingError
from tracker.frame import PosedFrame
from tracker.geometry import Pose
from tracker.saliency import SaliencyBackend

log = logging.getLogger(__name__)

Progress = Callable[[Iterable[int], int, str], Iterable[int]]
Place = tuple[int, str, int]  # scene, object, image of an anchor


@dataclass(frozen=True, slots=True)
class OneShot:
    """How pairs are answered: by which method, with which concepts of each object (None for the backend's own). The
    configuration's prior is off, whatever it says.

    Raises ConfigError where the method does not exist, or goes on from a pose that it is told."""

    backend: SaliencyBackend
    config: TrackerConfig = field(default_factory=TrackerConfig)
    vocabularies: VocabularySet | None = None
    method: str = "ours"

    def __post_init__(self) -> None:
        if method_kind(self.method).start == "needed":
            raise ConfigError(f"method {self.method} goes on from a pose that it is told, which a pair does not have")
        object.__setattr__(self, "config", self.config.model_copy(update={"prior": False}))


@dataclass(frozen=True, slots=True, eq=False)
class PairAnswer:
    """T_query_anchor: coordinates of the anchor's camera -> of the query's; None where there is none, for the reason
    that is told. confidence: in [0, 1]. timings_ms: of the query's stages, empty where there was no model."""

    T_query_anchor: Pose | None
    confidence: float
    reason: str
    timings_ms: dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Answered:
    """answers: one a pair, in their order. refused: "scene/object/image" of an anchor -> why no model could be made of
    it; the poses of its pairs are missing."""

    answers: tuple[PairAnswer, ...]
    refused: dict[str, str]


def answer_pairs(
    dataset: Dataset,
    pairs: Sequence[Pair],
    one_shot: OneShot,
    progress: Progress = lambda items, total, what: items,  # noqa: ARG005
) -> Answered:
    """Every anchor is onboarded once, whatever the order of the pairs; no answer depends on another one.

    Raises SourceError where a picture cannot be read.
    """
    by_anchor: dict[Place, list[int]] = {}
    for k, pair in enumerate(pairs):
        by_anchor.setdefault(_place(pair.anchor), []).append(k)
    order = [k for of_anchor in by_anchor.values() for k in of_anchor]
    answers: dict[int, PairAnswer] = {}
    refused: dict[str, str] = {}
    onboarded: tuple[Place, ConceptModel | OnboardingError] | None = None
    for k in progress(order, len(order), "pairs"):
        anchor = _place(pairs[k].anchor)
        if onboarded is None or onboarded[0] != anchor:
            onboarded = anchor, _model(dataset, pairs[k].anchor, one_shot)
        model = onboarded[1]
        if isinstance(model, OnboardingError):
            refused["/".join(map(str, anchor))] = str(model)
            answers[k] = PairAnswer(None, 0.0, f"no model of the anchor: {model}", {})
        else:
            answers[k] = _answer(dataset, pairs[k], model, one_shot)
    return Answered(tuple(answers[k] for k in range(len(pairs))), refused)


def estimates_of(pairs: Sequence[Pair], answers: Sequence[PairAnswer], dataset: Dataset) -> list[Estimate | None]:
    """T_cam_obj of every query: the relative pose composed with the anchor's true pose; None where it is missing."""
    estimates: list[Estimate | None] = []
    for pair, answer in zip(pairs, answers, strict=True):
        query, relative = pair.query, answer.T_query_anchor
        place = query.scene_id, query.target.image_id, dataset.number(pair.object_id)
        absolute = None if relative is None else relative @ pair.anchor.target.T_cam_obj
        estimates.append(None if absolute is None else Estimate(*place, answer.confidence, absolute))
    return estimates


def score_pairs(
    dataset: Dataset,
    pairs: Sequence[Pair],
    answers: Sequence[PairAnswer],
    protocol: dict[str, object],
    symmetric: Sequence[str] | None = None,
    with_vsd: bool = False,
) -> Scores:
    """Every pair is an instance, also where a query is in several; `Scores.instances` is in the order of the pairs.

    protocol, symmetric, with_vsd: as for `eval.score.score`. Raises SourceError as that does.
    """
    estimates = estimates_of(pairs, answers, dataset)
    by_number = sorted(range(len(pairs)), key=lambda k: dataset.number(pairs[k].object_id))  # the order of a table
    questions = [(pairs[k].query.scene_id, pairs[k].query.target) for k in by_number]
    measured = measure_answers(dataset, questions, [estimates[k] for k in by_number], symmetric, with_vsd)
    scene_ids = sorted({scene_id for scene_id, _ in questions})
    scores = summarise(dataset, measured, scene_ids, protocol, {}, symmetric is not None, with_vsd)
    own = {"frames": "the queries of the pairs", "reference_frames": "an anchor is never its own query"}
    in_order = dict(zip(by_number, scores.instances, strict=True))
    return Scores(
        protocol={**scores.protocol, **own},
        pooled=scores.pooled,
        mean_of_objects=scores.mean_of_objects,
        per_object=scores.per_object,
        instances=tuple(in_order[k] for k in range(len(pairs))),
    )


def _place(anchor: View) -> Place:
    return anchor.scene_id, anchor.target.object_id, anchor.target.image_id


def _model(dataset: Dataset, anchor: View, one_shot: OneShot) -> ConceptModel | OnboardingError:
    object_id = anchor.target.object_id
    frame = dataset.scene(anchor.scene_id)[anchor.target.index]
    if object_id not in frame.masks:
        return OnboardingError(f"{frame.provenance.source} has no mask of object {object_id!r}")
    posed = PosedFrame(frame, object_id, anchor.target.T_cam_obj, frame.masks[object_id])
    labels = None
    if one_shot.vocabularies:
        labels = one_shot.vocabularies.for_object(object_id, category_of(dataset, object_id)).labels
    try:
        return onboard([posed], one_shot.backend, one_shot.config.view, one_shot.config.cloud, labels)
    except OnboardingError as error:
        log.info("scene %d, image %d: %s", anchor.scene_id, anchor.target.image_id, error)
        return error


def _answer(dataset: Dataset, pair: Pair, model: ConceptModel, one_shot: OneShot) -> PairAnswer:
    """The method is a new one, so that it knows nothing of another query."""
    method = open_method(one_shot.method, [model], one_shot.config, one_shot.backend)
    (result,) = method.step(dataset.scene(pair.query.scene_id)[pair.query.target.index])
    relative = None if result.pose is None else result.pose @ pair.anchor.target.T_cam_obj.inverse()
    return PairAnswer(relative, result.confidence, result.reason, result.timings_ms)
