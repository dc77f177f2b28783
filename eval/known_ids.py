"""Whether a dataset has the scene, the image and the object that an estimate is of."""

from __future__ import annotations

from collections.abc import Callable

from eval.bop_results import Estimate
from eval.datasets import Dataset, require
from tracker.errors import SourceError


def known_to(dataset: Dataset) -> Callable[[Estimate], None]:
    """A check that raises SourceError, with what there is, where an estimate is of an unknown scene, image or object,
    or of a scene in which there is nothing to estimate.

    An image or an object that the dataset has but no target names passes: a method may have been run on every frame.
    """
    images: dict[int, frozenset[int]] = {}
    object_ids = dataset.object_ids

    def check(estimate: Estimate) -> None:
        scene_id = estimate.scene_id
        if scene_id not in images:
            require("scene", scene_id, dataset.scene_ids, dataset.name)
            if not dataset.targets(scene_id):
                raise SourceError(f"{dataset.name}: scene {scene_id} has no target ({dataset.target_rule})")
            images[scene_id] = frozenset(dataset.image_ids(scene_id))
        known = images[scene_id]
        if estimate.image_id not in known:
            raise SourceError(
                f"{dataset.name}: scene {scene_id} has no image {estimate.image_id}; it has {len(known)}, "
                f"{min(known)} to {max(known)}"
            )
        require("object", dataset.object_with(estimate.object_id), object_ids, dataset.name)

    return check
