"""Loop 1 of an evaluation: run the tracker, or a peer, over a dataset and keep what it said.

It sees frames, and of the truth at most one pose an object and scene, where the protocol says so.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from eval.datasets import Dataset
from eval.peers import Method, open_method
from eval.protocol import Protocol
from eval.scene_models import scene_models
from eval.symmetries import Motions
from eval.tracked import Tracked
from reference.completion import Completion
from tracker.concept import ConceptModel
from tracker.first_masks import FirstMasks
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.in_order import InOrder
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult
from tracker.smoothing import smooth_results
from tracker.sources import PosedSource
from tracker.viewer import NullViewer, Viewer

log = logging.getLogger(__name__)

DRAWN_STEPS = 180  # turns about an axis among which a true box is drawn

Progress = Callable[[Iterable[Frame], int, str], Iterable[Frame]]


def track_dataset(
    dataset: Dataset,
    protocol: Protocol,
    scene_ids: Sequence[int] | None = None,
    object_ids: Sequence[str] | None = None,
    viewer: Callable[[int, Sequence[ConceptModel]], Viewer] = lambda scene_id, models: NullViewer(),  # noqa: ARG005
    progress: Progress = lambda frames, total, what: frames,  # noqa: ARG005
) -> Tracked:
    """Onboard every object of every scene (all unless given), then track it through all the frames in order.

    viewer: makes one a scene. Raises SourceError where the dataset does not have what is asked for.
    """
    return Tracked.joined(
        track_scene(dataset, scene_id, protocol, object_ids, partial(viewer, scene_id), progress)
        for scene_id in (dataset.scene_ids if scene_ids is None else scene_ids)
    )


def track_scene(
    dataset: Dataset,
    scene_id: int,
    protocol: Protocol,
    object_ids: Sequence[str] | None = None,
    viewer: Callable[[Sequence[ConceptModel]], Viewer] = lambda models: NullViewer(),  # noqa: ARG005
    progress: Progress = lambda frames, total, what: frames,  # noqa: ARG005
) -> Tracked:
    """The smallest part of a run that depends on no other: a tracker's state runs through the frames of a scene."""
    tracked = Tracked()
    source = dataset.scene(scene_id, protocol.masks)
    wanted = [o for o in source.object_ids if object_ids is None or o in object_ids]
    models = scene_models(dataset, scene_id, wanted, protocol, tracked)
    if not models:
        return tracked
    tracker = open_method(protocol.method, models, protocol.config, protocol.backend)
    truth, visible = _truth(source, [model.object_id for model in models])
    growing = _Growing(tracker, models, protocol) if protocol.complete else None
    first_masks = FirstMasks()
    untold = [model.object_id for model in models] if protocol.initialisation == "gt" else []
    shown = viewer(models)
    drawn = [] if isinstance(shown, NullViewer) else [model.object_id for model in models]
    alike = {object_id: dataset.model(object_id).symmetries.motions(DRAWN_STEPS) for object_id in drawn}
    frames = InOrder(progress(source, len(source), f"scene {scene_id}"))
    steps: list[tuple[int, Sequence[TrackResult]]] = []
    try:
        for frame in frames:
            for object_id in [o for o in untold if (frame.index, o) in visible]:
                tracker.place(object_id, truth[frame.index][object_id], frame.stamp_ns)
                untold.remove(object_id)
            given = frame if protocol.config.masks == "given" else first_masks(frame)
            results = tracker.step(given)
            shown.show(frame, results, _as_it_looks(truth[frame.index], results, alike))
            if growing:
                growing.take(frame, results)
            steps.append((frame.index, [result.slim() for result in results]))
    finally:
        shown.close()
    if frames.refused:
        log.warning("scene %d: %d frames left out, as time does not advance there", scene_id, frames.refused)
    for index, results in _smoothed(steps) if protocol.smooth == "offline" else steps:
        seen = [(index, result.object_id) in visible for result in results]
        tracked.add(dataset, scene_id, index, results, seen, protocol.poses)
    return tracked


def _as_it_looks(
    truth: Mapping[str, Pose], results: Sequence[TrackResult], alike: Mapping[str, Motions]
) -> dict[str, Pose]:
    """The true poses, each in the way that its object's symmetry makes the nearest to the estimate: a bowl's box that
    is turned about its axis is drawn on the estimated one, as nobody can see that it is turned. alike: of the objects
    that are drawn."""
    poses = dict(truth)
    for result in results:
        if result.pose is not None and result.object_id in truth and result.object_id in alike:
            T_cam_obj, motions = truth[result.object_id], alike[result.object_id]
            cosines = np.einsum("ij,sij->s", T_cam_obj.rotation.T @ result.pose.rotation, motions.turns)
            k = int(cosines.argmax())
            poses[result.object_id] = T_cam_obj @ Pose(motions.turns[k], motions.shifts_m[k])
    return poses


class _Growing:
    """The models of one scene, which the tracker goes on with as they grow."""

    def __init__(self, tracker: Method, models: Sequence[ConceptModel], protocol: Protocol) -> None:
        self._tracker = tracker
        self._completions = {m.object_id: Completion(m, protocol.backend, protocol.config) for m in models}

    def take(self, frame: Frame, results: Sequence[TrackResult]) -> None:
        for result in results:
            model = self._completions[result.object_id].consider(frame, result)
            if model is not None and isinstance(self._tracker, ObjectTracker):
                self._tracker.exchange(model)


def _smoothed(steps: Sequence[tuple[int, Sequence[TrackResult]]]) -> Iterator[tuple[int, Sequence[TrackResult]]]:
    """Of every frame the results, with the poses of each object smoothed over the scene."""
    smoothed = iter(smooth_results([result for _, results in steps for result in results]))
    for index, results in steps:
        yield index, [next(smoothed) for _ in results]


def _truth(source: PosedSource, object_ids: Sequence[str]) -> tuple[list[dict[str, Pose]], set[tuple[int, str]]]:
    """By frame the true poses of the objects, for the viewer; and (frame, object) where a pixel of it can be seen."""
    poses: list[dict[str, Pose]] = [{} for _ in range(len(source))]
    visible = set()
    for object_id in object_ids:
        for sighting in source.sightings(object_id):
            poses[sighting.index][object_id] = sighting.T_cam_obj
            if sighting.visible_px > 0:
                visible.add((sighting.index, object_id))
    return poses, visible
