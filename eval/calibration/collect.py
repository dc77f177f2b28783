"""One run: every pose that the tracker tells, and whether it is right."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace

from eval.calibration.rows import JudgedPose
from eval.calibration.runs import CalibrationRun
from eval.datasets.synthetic import SyntheticDataset
from eval.metrics import translation_error_m
from eval.reliability import right_within
from eval.scenarios.frame_log import LEAST_IN_SIGHT
from eval.scenarios.run import BACKEND, clean_model
from eval.symmetric_errors import symmetric_rotation_error_deg
from eval.symmetries import ObjectSymmetries
from eval.track_run import opened_backend
from reference.onboard import onboard, read_reference_frames
from tracker.concept import ConceptModel
from tracker.errors import OnboardingError
from tracker.first_masks import FirstMasks
from tracker.frame import Mask
from tracker.geometry import Pose
from tracker.pipeline import ObjectTracker
from tracker.saliency import BackendOptions
from tracker.sources import Sighting
from tracker.sources.synthetic import SyntheticScene, open_scene
from tracker.threads import torch_threads

log = logging.getLogger(__name__)


def collect(run: CalibrationRun) -> list[JudgedPose]:
    """Of all the scene's objects of which a model can be made; none of a frame that a model was made of.

    Raises SourceError where there is no such scene or size.
    """
    scene = open_scene(run.request)
    with torch_threads(1):
        models, known = _models(run, scene)
        if not models:
            return []
        dataset = SyntheticDataset(scene)
        symmetries = {name: dataset.model(name).symmetries for name in scene.object_ids}
        if run.stranger:
            models.append(clean_model(run.stranger, run.seed, run.size, run.views))
        tracker = ObjectTracker(models, run.config, opened_backend(BACKEND, BackendOptions()))
        first_masks = FirstMasks()
        poses = []
        for index in range(0, len(scene), run.every):
            frame = scene[index]
            if run.masks == "mistaken":
                frame = replace(frame, masks=mistaken(frame.masks))
            for result in tracker.step(first_masks(frame) if run.masks == "carried" else frame):
                name = result.object_id
                if result.pose is None or result.grounds is None or (index, name) in known:
                    continue
                right = name != run.stranger and pose_is_right(
                    result.pose, scene.sightings(name)[index], symmetries[name]
                )
                poses.append(JudgedPose(run.scene, run.name, name, index, right, result.grounds))
    return poses


def _models(run: CalibrationRun, scene: SyntheticScene) -> tuple[list[ConceptModel], set[tuple[int, str]]]:
    """The models, and (frame, object) of the scene's own frames that they were made of.

    The object of a scene of its own is known from a clean scene; those of a crowded one are among the others there too.
    """
    models: list[ConceptModel] = []
    known: set[tuple[int, str]] = set()
    alone = len(scene.object_ids) == 1
    for object_id in scene.object_ids:
        try:
            if alone:
                models.append(clean_model(object_id, run.seed, run.size, run.views))
                continue
            frames = read_reference_frames(scene, object_id, run.views)
            models.append(onboard(frames, opened_backend(BACKEND, BackendOptions())))
            known.update((posed.frame.index, object_id) for posed in frames)
        except OnboardingError as error:
            log.warning("%s: %s", run.name, error)
    return models, known


def mistaken(masks: Mapping[str, Mask]) -> dict[str, Mask]:
    """Each object has the mask of the one after it."""
    names = list(masks)
    return {name: masks[other] for name, other in zip(names, names[1:] + names[:1], strict=True)}


def pose_is_right(pose: Pose, sighting: Sighting, symmetries: ObjectSymmetries) -> bool:
    """A pose of an object that cannot be seen is wrong, however near: nothing spoke for it."""
    error_m = float(translation_error_m([pose], [sighting.T_cam_obj])[0])
    error_deg = float(symmetric_rotation_error_deg(symmetries, [pose], [sighting.T_cam_obj])[0])
    return sighting.visible_fraction >= LEAST_IN_SIGHT and right_within(error_m, error_deg)
