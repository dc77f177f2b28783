"""Loop 1 of an evaluation: run the tracker, or a peer, over a dataset and keep what it said.

It sees frames, and of the truth at most one pose an object and scene, where the protocol says so.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

import numpy as np

from eval.bop_results import Estimate
from eval.datasets import Dataset, MaskKind, category_of
from eval.frame_record import FrameRecord
from eval.instances import ObjectInImage
from eval.peers import Method, method_kind, open_method
from eval.summary import TrackingCounts
from eval.symmetries import Motions
from reference.completion import Completion
from reference.onboard import onboard, read_reference_frames
from reference.unposed import onboard_unposed, read_unposed_frames
from reference.vocabulary import VocabularySet
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, OnboardingError
from tracker.first_masks import FirstMasks
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.in_order import InOrder
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult, TrackState
from tracker.saliency import SaliencyBackend
from tracker.smoothing import smooth_results
from tracker.sources import PosedSource
from tracker.viewer import NullViewer, Viewer

log = logging.getLogger(__name__)

DRAWN_STEPS = 180  # turns about an axis among which a true box is drawn

Progress = Callable[[Iterable[Frame], int, str], Iterable[Frame]]


@dataclass(frozen=True, slots=True)
class Protocol:
    """How a dataset is tracked. views: reference frames an object and scene, picked from its own frames.
    poses: which of a result's poses count. vocabularies: the concepts of each object, None for the backend's own.
    smooth: "offline" smooths the filtered poses over each scene.
    concepts: only the first so many of them, all where there are fewer. method: "ours", or a peer as `eval.peers` has
    it. initialisation: "gt" tells the method each object's true pose, once a scene, in the first frame where the object
    is visible. masks: which the dataset's frames have, those that models are made of too. unposed: reference frames are
    spread over the scene, and of their poses only the first one's is told, which sets the object frame. complete:
    models grow by frames of which the tracker is sure, once those are tracked.

    Raises ConfigError where the method does not exist, or cannot do with that initialisation, with no view or concept,
    or where there are no filtered poses to smooth."""

    backend: SaliencyBackend
    config: TrackerConfig
    views: int
    poses: Literal["filtered", "raw"] = "filtered"
    vocabularies: VocabularySet | None = None
    method: str = "ours"
    initialisation: Literal["estimated", "gt"] = "estimated"
    concepts: int | None = None
    masks: MaskKind = "visib"
    smooth: Literal["off", "offline"] = "off"
    unposed: bool = False
    complete: bool = False

    def __post_init__(self) -> None:
        if self.views < 1:
            raise ConfigError(f"--views: at least one reference frame is needed, got {self.views}")
        if self.concepts is not None and self.concepts < 1:
            raise ConfigError(f"--concepts: at least one concept is needed, got {self.concepts}")
        if self.config.masks == "carried" and self.method != "ours":
            raise ConfigError(
                f"method {self.method} is given the masks of every frame: --masks carried is of no use to it"
            )
        if self.complete and self.method != "ours":
            raise ConfigError(f"method {self.method} has a model once and for all: --complete is of no use to it")
        if self.smooth != "off" and (self.method != "ours" or self.poses != "filtered" or not self.config.prior):
            raise ConfigError(
                f"--smooth {self.smooth} smooths this tracker's filtered poses: it needs --method ours, "
                "--poses filtered and --prior on"
            )
        start = method_kind(self.method).start
        if start == "needed" and self.initialisation != "gt":
            raise ConfigError(f"method {self.method} goes on from a pose that it is told: it needs --init gt")
        if start == "used" and self.initialisation == "gt" and not self.config.prior:
            raise ConfigError(f"method {self.method} uses no start with the prior off: --init gt needs --prior on")

    def labels_of(self, object_id: str, category: str | None = None) -> tuple[str, ...] | None:
        """The concepts to look for on an object; None leaves the choice to the backend."""
        labels = self.vocabularies.for_object(object_id, category).labels if self.vocabularies else None
        return labels if self.concepts is None else (labels or self.backend.labels_for(None))[: self.concepts]


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """estimates: one for every frame and object with a pose. reference_frames: those that models were made of.
    counts: by object. timings_ms: of every step, stage -> milliseconds. refused: "scene/object" -> why no model could
    be made of it; its poses are missing. records: of every step, in the order of the timings."""

    estimates: list[Estimate] = field(default_factory=list)
    reference_frames: set[ObjectInImage] = field(default_factory=set)
    counts: dict[str, TrackingCounts] = field(default_factory=dict)
    timings_ms: list[dict[str, float]] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    records: list[FrameRecord] = field(default_factory=list)

    @classmethod
    def joined(cls, parts: Iterable[Tracked]) -> Tracked:
        """Several scenes as one, in their order; an object's counts are summed."""
        whole = cls()
        for part in parts:
            whole.estimates.extend(part.estimates)
            whole.reference_frames.update(part.reference_frames)
            whole.timings_ms.extend(part.timings_ms)
            whole.refused.update(part.refused)
            whole.records.extend(part.records)
            for object_id, counts in part.counts.items():
                whole.counts[object_id] = counts + whole.counts.get(object_id, TrackingCounts(0, 0, 0))
        return whole

    def latency_ms(self) -> dict[str, object]:
        """Median and 95th percentile of an object's whole step, and the median of every stage where it ran."""
        if not self.timings_ms:
            return {}
        totals = [timings["total"] for timings in self.timings_ms]
        stages = sorted({stage for timings in self.timings_ms for stage in timings} - {"total"})
        medians = {s: float(np.median([t[s] for t in self.timings_ms if s in t])) for s in stages}
        return {"median": float(np.median(totals)), "p95": float(np.percentile(totals, 95)), "stages": medians}


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
    models = _onboard(dataset, scene_id, wanted, protocol, tracked)
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
        _record(tracked, dataset, scene_id, index, results, seen, protocol)
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


def _onboard(
    dataset: Dataset, scene_id: int, object_ids: Sequence[str], protocol: Protocol, tracked: Tracked
) -> list[ConceptModel]:
    """Models of the objects of which one can be made; the others are noted in `tracked.refused`."""
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


def _record(
    tracked: Tracked,
    dataset: Dataset,
    scene_id: int,
    index: int,
    results: Sequence[TrackResult],
    seen: Sequence[bool],
    protocol: Protocol,
) -> None:
    image_id = dataset.image_ids(scene_id)[index]
    time_s = sum(result.timings_ms["total"] for result in results) / 1000  # of the whole image, as BOP has it
    for result, visible in zip(results, seen, strict=True):
        tracked.timings_ms.append(result.timings_ms)
        tracked.records.append(FrameRecord.of(scene_id, image_id, result))
        before = tracked.counts.get(result.object_id, TrackingCounts(0, 0, 0))
        lost, unseen = result.state is TrackState.LOST, result.pose is not None and not visible
        tracked.counts[result.object_id] = before + TrackingCounts(1, int(lost), int(unseen))
        pose = result.pose if protocol.poses == "filtered" else result.raw_pose
        if pose is not None:
            number = dataset.number(result.object_id)
            tracked.estimates.append(Estimate(scene_id, image_id, number, result.confidence, pose, time_s))
