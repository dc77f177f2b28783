"""One object in one frame: whether its pose is wrong, and which stage it was lost in.

The truth is used as no tracker can: the stages are started from it, and what they make of it is compared with what was
found without it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from eval.datasets import ObjectModel
from eval.metrics import add, adds
from tracker.cloud import lift
from tracker.concept import ConceptModel
from tracker.confidence import Grounds, confidence, turn_sigma_rad
from tracker.config import TrackerConfig
from tracker.frame import Frame, Mask
from tracker.geometry import Pose
from tracker.matching import Matcher
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult
from tracker.saliency import Query, SaliencyBackend
from tracker.search import Search, Sight
from tracker.silhouette import Silhouette
from tracker.stopwatch import Stopwatch
from tracker.view import ObjectView, view_object

WRONG_M = 0.01  # ADD, of a symmetric object ADD-S, from which on a pose counts as wrong
KNOWN = 0.5  # share of the object's pixels that the model explains at the true pose: less is a side that it lacks
SAME_PLACE = 0.1  # of the diameter: a match as near to the true place is right
ENOUGH_RIGHT = 0.05  # share of the matches that registration finds a pose in

CAUSES = {
    "little seen": "too little of it is in sight, even from the true pose",
    "unseen side": "at the true pose the model does not know most of what is seen",
    "mask": "with the pixels that the true pose gives, in the place of the given ones, it is found",
    "matching": "the true pose would win, but next to no match is right",
    "candidates": "the true pose would win and enough matches are right, but no search leads to it",
    "turn": "from the true pose refinement leads to one that differs by what the shape leaves free",
    "refinement": "from the true pose refinement leads elsewhere",
    "colour": "another pose wins by its colours",
    "surface": "another pose wins by its surface",
}


@dataclass(frozen=True, slots=True)
class Loss:
    """error_m: ADD, of a symmetric object ADD-S; infinite without a pose. cause: one of `CAUSES` where the pose is
    wrong, else None."""

    object_id: str
    error_m: float
    cause: str | None


class Tracer:
    """For one model. Every frame stands alone (prior off), with the object's mask given."""

    def __init__(
        self, model: ConceptModel, shape: ObjectModel, backend: SaliencyBackend, config: TrackerConfig
    ) -> None:
        config = config.model_copy(update={"prior": False, "masks": "given"})
        self._model, self._shape, self._backend, self._config = model, shape, backend, config
        self._tracker, self._again = (ObjectTracker(model, config, backend) for _ in range(2))
        self._search = Search(model, config)
        self._match = Matcher(model, config.matching, config.torch_device)
        self._silhouette = Silhouette(model, config.silhouette, config.view.pixels_across)

    def __call__(self, frame: Frame, mask: Mask, truth: Pose) -> Loss:
        """mask: the object's pixels. truth: T_cam_obj. Frames come in the order of their times."""
        found = self._found(self._tracker, frame, mask)
        error_m = self._error_m(found.pose, truth)
        cause = self._cause(frame, mask, truth, found) if error_m > WRONG_M else None
        return Loss(self._model.object_id, error_m, cause)

    def _found(self, tracker: ObjectTracker, frame: Frame, mask: Mask) -> TrackResult:
        (result,) = tracker.step(replace(frame, masks={self._model.object_id: mask}))
        return result

    def _error_m(self, pose: Pose | None, truth: Pose) -> float:
        if pose is None:
            return float("inf")
        measure = add if self._shape.symmetries.trivial else adds
        return float(measure(self._shape.points_m, [pose], [truth])[0])

    def _cause(self, frame: Frame, mask: Mask, truth: Pose, found: TrackResult) -> str:
        view = view_object(frame, mask, self._model.diameter_m, self._config.view)
        if view is None:
            return "little seen"
        sight = Sight.of(view, masked=True)
        at_truth = self._search.continued(truth, sight, Stopwatch())
        at_truth = at_truth and self._search.settled(at_truth, sight, Stopwatch())  # as what is found from scratch is
        if at_truth is None:
            return "little seen"
        if at_truth.evidence.explained < KNOWN:
            return "unseen side"
        outline = self._silhouette(truth, frame, known=True)
        if not isinstance(outline, str):
            again = self._found(self._again, frame, outline)
            if self._error_m(again.pose, truth) <= WRONG_M:
                return "mask"
        reached = at_truth.refined.T_cam_obj
        if self._error_m(reached, truth) > WRONG_M:
            alike = adds(self._shape.points_m, [reached], [truth])[0] <= WRONG_M
            return "turn" if alike else "refinement"
        told = found.grounds
        sigma_rad = turn_sigma_rad(at_truth.refined, self._model.symmetry)
        likely = confidence(Grounds(at_truth.evidence, sigma_rad))
        if told is None or likely > confidence(Grounds(told.evidence, told.turn_sigma_rad)):
            return "matching" if self._right_share(view, truth) < ENOUGH_RIGHT else "candidates"
        seen, known = told.evidence, at_truth.evidence
        return "colour" if seen.surface <= known.surface else "surface"

    def _right_share(self, view: ObjectView, truth: Pose) -> float:
        (saliency,) = self._backend([Query(view, self._model.labels)])
        cloud = lift(view, saliency, self._config.cloud)
        matches = self._match(cloud)
        true_places = truth.inverse() @ cloud.points[matches.query_index]
        off_m = np.linalg.norm(true_places - self._model.points[matches.model_index], axis=1)
        return float(np.mean(off_m < SAME_PLACE * self._model.diameter_m))
