"""The models of a scene's objects, made of its own frames."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from eval.datasets import Dataset, category_of
from eval.protocol import Protocol
from eval.tracked import Tracked
from reference.onboard import onboard, read_reference_frames
from reference.unposed import onboard_unposed, read_unposed_frames
from tracker.concept import ConceptModel
from tracker.errors import OnboardingError
from tracker.frame import Frame
from tracker.sources import PosedSource

log = logging.getLogger(__name__)


def scene_models(
    dataset: Dataset, scene_id: int, object_ids: Sequence[str], protocol: Protocol, tracked: Tracked
) -> list[ConceptModel]:
    """Models of the objects of which one can be made, their reference frames noted in `tracked.reference_frames`; the
    others with the reason in `tracked.refused`."""
    models = []
    source = dataset.scene(scene_id, protocol.masks)
    make = _unposed if protocol.unposed else _posed
    for object_id in object_ids:
        try:
            labels = protocol.labels_of(object_id, category_of(dataset, object_id))
            model, frames = make(source, object_id, protocol, labels)
        except OnboardingError as error:
            log.warning("scene %d: %s", scene_id, error)
            tracked.refused[f"{scene_id}/{object_id}"] = str(error)
            continue
        image_ids = dataset.image_ids(scene_id)
        tracked.reference_frames.update((scene_id, object_id, image_ids[frame.index]) for frame in frames)
        models.append(model)
    return models


def _posed(
    source: PosedSource, object_id: str, protocol: Protocol, labels: Sequence[str] | None
) -> tuple[ConceptModel, list[Frame]]:
    """A model, and the frames that it was made of."""
    posed, config = read_reference_frames(source, object_id, protocol.views), protocol.config
    model = onboard(posed, protocol.backend, config.view, config.cloud, labels)
    return model, [each.frame for each in posed]


def _unposed(
    source: PosedSource, object_id: str, protocol: Protocol, labels: Sequence[str] | None
) -> tuple[ConceptModel, list[Frame]]:
    """A model, and the frames that were given to make it of, whether they joined or not."""
    frames = read_unposed_frames(source, object_id, protocol.views)
    first = frames[0][0]
    told = next((s.T_cam_obj for s in source.sightings(object_id) if s.index == first.index), None)
    if told is None:
        raise OnboardingError(f"{first.provenance.source} has no pose of object {object_id!r} to set the object frame")
    model = onboard_unposed(frames, object_id, protocol.backend, protocol.config, labels, T_cam_obj=told)
    return model, [frame for frame, _ in frames]
