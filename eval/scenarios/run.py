"""One run: a model from a clean scene of the object, then the scenario's frames, pointed out in the first one only."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np

from eval.datasets.synthetic import SyntheticDataset
from eval.metrics import translation_error_m
from eval.scenarios.frame_log import FrameLog
from eval.symmetric_errors import symmetric_rotation_error_deg
from eval.symmetries import ObjectSymmetries
from eval.track_run import opened_backend
from reference.onboard import onboard, read_reference_frames
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import OnboardingError
from tracker.first_masks import FirstMasks
from tracker.geometry import Pose
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult
from tracker.saliency import BackendOptions
from tracker.sources.synthetic import open_scene
from tracker.threads import torch_threads

SCENARIOS = ("hidden", "away", "gone", "hand", "jerk", "lights", "blind", "swapped")
BACKEND = "attributes"
REFERENCE_SCENE, REFERENCE_FRAMES = "turn", 284  # in which the object turns once all around
JUMP_RAD = 0.5  # turned by this much between two frames, object and camera have jumped: no hand is as fast


@dataclass(frozen=True, slots=True)
class ScenarioRun:
    """What is to be run. size: WIDTHxHEIGHT. views: reference frames. config: with masks carried."""

    scenario: str
    seed: int
    size: str
    views: int
    config: TrackerConfig


@dataclass(frozen=True, slots=True)
class RunLog:
    """What a run came to. refused: why no model could be made; there are no frames then."""

    scenario: str
    seed: int
    object_id: str
    frames: Sequence[FrameLog]
    refused: str = ""


def run_scenario(run: ScenarioRun) -> RunLog:
    """Raises SourceError where there is no such scenario or size."""
    scene = open_scene(f"{run.scenario}?seed={run.seed}&size={run.size}")
    (object_id,) = scene.object_ids
    symmetries = SyntheticDataset(scene).model(object_id).symmetries
    sightings = scene.sightings(object_id)
    turns_rad = [0.0, *(a.T_cam_obj.angle_to_rad(b.T_cam_obj) for a, b in pairwise(sightings))]
    with torch_threads(1):
        try:
            model = clean_model(object_id, run.seed, run.size, run.views)
        except OnboardingError as error:
            logging.getLogger(__name__).warning("%s, seed %d: %s", run.scenario, run.seed, error)
            return RunLog(run.scenario, run.seed, object_id, (), str(error))
        tracker = ObjectTracker(model, run.config, opened_backend(BACKEND, BackendOptions()))
        first_masks = FirstMasks()
        log = []
        for sighting in sightings:
            started = perf_counter()
            frame = scene[sighting.index]
            rendered = perf_counter()
            (result,) = tracker.step(first_masks(frame))
            log.append(
                FrameLog(
                    index=frame.index,
                    visible=sighting.visible_fraction,
                    has_depth=bool((frame.depth_m > 0).any()),
                    jumped=turns_rad[sighting.index] > JUMP_RAD,
                    rendering_ms=1000 * (rendered - started),
                    tracking_ms=1000 * (perf_counter() - rendered),
                    **_said(result, sighting.T_cam_obj, symmetries),
                )
            )
    return RunLog(run.scenario, run.seed, object_id, log)


def clean_model(object_id: str, seed: int, size: str, views: int) -> ConceptModel:
    """From a scene in which the object is alone and turns once all around. Raises OnboardingError where that fails."""
    scene = open_scene(f"{REFERENCE_SCENE}?object={object_id}&seed={seed}&size={size}&frames={REFERENCE_FRAMES}")
    return onboard(read_reference_frames(scene, object_id, views), opened_backend(BACKEND, BackendOptions()))


def _said(result: TrackResult, truth: Pose, symmetries: ObjectSymmetries) -> dict[str, Any]:
    """The part of a frame's log that the tracker answers for."""
    said: dict[str, Any] = {
        "state": result.state.value,
        "confidence": float(result.confidence),
        "reason": result.reason,
    }
    if result.pose is not None:
        said["error_m"] = float(translation_error_m([result.pose], [truth])[0])
        said["error_deg"] = float(symmetric_rotation_error_deg(symmetries, [result.pose], [truth])[0])
    if result.covariance is not None:
        sigmas = np.sqrt(np.diag(result.covariance)).tolist()
        said["sigma_rad"], said["sigma_m"] = sigmas[:3], sigmas[3:]
    if result.evidence is not None:
        said["evidence"] = {name: float(value) for name, value in asdict(result.evidence).items()}
    return said
