"""Poses of a tracker without a CAD model, whose object frame is its own, are moved into the dataset's object frame.

In one reference frame r the true pose is taken to be what the tracker says it is; every other estimate of the object in
the scene is moved along: `T_cam_obj_i = pred_i @ inv(pred_r) @ gt_r`. An error in r so becomes part of all the others.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from eval.answers import best_estimates, targets_of
from eval.bop_results import Estimate
from eval.datasets import Dataset
from eval.instances import ObjectInImage
from tracker.geometry import Pose

log = logging.getLogger(__name__)

ReferenceRule = Literal["first", "best-score"]
RULES: dict[ReferenceRule, str] = {"first": "the first estimated target", "best-score": "the target of the best score"}


@dataclass(frozen=True, slots=True, eq=False)
class Aligned:
    """estimates: as many as came, in their order; those of an object without a reference frame are as they were.

    reference_frames: one an object and scene, where the object's frame was aligned. alone: "scene/object" of those
    whose reference is their only answer to a target: nothing of them is left to score.
    """

    estimates: tuple[Estimate, ...]
    reference_frames: frozenset[ObjectInImage]
    alone: tuple[str, ...]
    rule: ReferenceRule

    def stated(self) -> dict[str, object]:
        """What a report's protocol says of it, JSON-ready."""
        return {
            "alignment": f"pred_i @ inv(pred_r) @ gt_r on one reference frame an object and scene, {RULES[self.rule]}",
            "alignment_frames": {f"{scene}/{object_id}": image for scene, object_id, image in self._sorted()},
            "alignment_only": list(self.alone),
        }

    def _sorted(self) -> Sequence[ObjectInImage]:
        return sorted(self.reference_frames)


def align(
    dataset: Dataset,
    estimates: Sequence[Estimate],
    rule: ReferenceRule = "first",
    scene_ids: Sequence[int] | None = None,
    object_ids: Sequence[str] | None = None,
) -> Aligned:
    """Estimates in object frames of their own -> in the dataset's, each object and scene for itself.

    rule: which of the targets with an estimate is the reference frame; of several estimates in it the best scored one
    counts, of equal scores the first. scene_ids, object_ids: only those, all unless given. Raises SourceError where the
    dataset does not have such a scene or object.
    """
    best, _ = best_estimates(estimates)
    answered: dict[tuple[int, int], list[tuple[Estimate, ObjectInImage, Pose]]] = {}
    for scene_id, t in targets_of(dataset, scene_ids, object_ids):
        number = dataset.number(t.object_id)
        if (estimate := best.get((scene_id, t.image_id, number))) is not None:
            place = scene_id, t.object_id, t.image_id
            answered.setdefault((scene_id, number), []).append((estimate, place, t.T_cam_obj))
    chosen = {key: _reference(answers, rule) for key, answers in answered.items()}
    motions = {key: estimate.T_cam_obj.inverse() @ truth for key, (estimate, _, truth) in chosen.items()}
    alone = tuple(f"{chosen[k][1][0]}/{chosen[k][1][1]}" for k, answers in answered.items() if len(answers) == 1)
    if alone:
        log.warning("only the reference frame of the alignment has an estimate, of scene/object %s", ", ".join(alone))
    return Aligned(
        estimates=tuple(_moved(estimate, motions) for estimate in estimates),
        reference_frames=frozenset(place for _, place, _ in chosen.values()),
        alone=alone,
        rule=rule,
    )


def _reference(
    answers: Sequence[tuple[Estimate, ObjectInImage, Pose]], rule: ReferenceRule
) -> tuple[Estimate, ObjectInImage, Pose]:
    """Targets come in the order of their images."""
    return answers[0] if rule == "first" else max(answers, key=lambda answer: answer[0].score)


def _moved(estimate: Estimate, motions: Mapping[tuple[int, int], Pose]) -> Estimate:
    motion = motions.get((estimate.scene_id, estimate.object_id))
    return estimate if motion is None else replace(estimate, T_cam_obj=estimate.T_cam_obj @ motion)
