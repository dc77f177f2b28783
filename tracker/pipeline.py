"""The tracker. The method on one page: `ObjectTracker.step` and `_Track.step`."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from tracker.appearance import ViewAppearance, view_appearance
from tracker.closest_points import ClosestPoints
from tracker.cloud import LEAST_POINTS, PointCloud, lift
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, FrameError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.matching import Correspondences, Matcher
from tracker.pose_filter import PoseFilter
from tracker.refinement import Refined, Refiner
from tracker.registration import Candidate, register
from tracker.result import Surface, TrackResult, TrackState
from tracker.saliency import Query, Saliency, SaliencyBackend, open_backend
from tracker.stopwatch import Stopwatch
from tracker.verification import Evidence, Verifier
from tracker.view import ObjectView, view_object

logger = logging.getLogger(__name__)


class ObjectTracker:
    """Follows objects through the frames of one camera.

    models: one concept model an object. backend: the one that made them; None opens it by name.
    Raises ModelError where a model is of another backend, ConfigError where two models are of the same object.
    """

    def __init__(
        self,
        models: ConceptModel | Sequence[ConceptModel],
        config: TrackerConfig | None = None,
        backend: SaliencyBackend | None = None,
    ) -> None:
        models = [models] if isinstance(models, ConceptModel) else list(models)
        if not models:
            raise ConfigError("a tracker needs at least one model")
        if len({model.object_id for model in models}) < len(models):
            raise ConfigError(f"two models are of one object: {', '.join(model.object_id for model in models)}")
        config = config or TrackerConfig()
        backend = backend or open_backend(models[0].backend)
        for model in models:
            model.require_backend(backend)
        self._backend = backend
        self._tracks = [_Track(model, config) for model in models]
        self._last_stamp_ns = -1

    def step(self, frame: Frame) -> tuple[TrackResult, ...]:
        """Every model's result, in their order. Raises FrameError where time does not advance; nothing is lost then."""
        if frame.stamp_ns <= self._last_stamp_ns:
            raise FrameError(
                f"frame {frame.index} of {frame.provenance.source}: its stamp {frame.stamp_ns} ns is not after "
                f"the last one, {self._last_stamp_ns} ns"
            )
        self._last_stamp_ns = frame.stamp_ns
        clocks = [Stopwatch() for _ in self._tracks]

        # What does the frame show of each object, and where are its concepts? One batch for all objects.
        views = [track.view(frame, clock) for track, clock in zip(self._tracks, clocks, strict=True)]
        saliency = self._saliency(views, clocks)

        # Where is each object?
        return tuple(
            track.step(frame, view, maps, clock)
            for track, view, maps, clock in zip(self._tracks, views, saliency, clocks, strict=True)
        )

    def _saliency(self, views: Sequence[ObjectView | str], clocks: Sequence[Stopwatch]) -> list[Saliency | None]:
        """Of every view that there is."""
        queries = {
            k: Query(view, self._tracks[k].labels) for k, view in enumerate(views) if isinstance(view, ObjectView)
        }
        found: dict[int, Saliency] = {}
        if queries:
            with Stopwatch.shared([clocks[k] for k in queries], "saliency"):
                found = dict(zip(queries, self._backend(list(queries.values())), strict=True))
        return [found.get(k) for k in range(len(views))]


@dataclass(frozen=True, slots=True, eq=False)
class _Sight:
    """What one frame shows of the object."""

    view: ObjectView
    cloud: PointCloud
    appearance: ViewAppearance


@dataclass(frozen=True, slots=True, eq=False)
class _Hypothesis:
    refined: Refined
    evidence: Evidence
    origin: str


class _Track:
    """One object's stages and its state between frames."""

    def __init__(self, model: ConceptModel, config: TrackerConfig) -> None:
        self._model, self._config = model, config
        self._device = config.torch_device
        self._match = Matcher(model, config.matching, self._device)
        self._closest = ClosestPoints(model, config.closest_points)
        self._refine = Refiner(model, config.refinement, config.view.pixels_across)
        self._verify = Verifier(model, config.verification, config.view.pixels_across)
        self._filter = PoseFilter(config.filter)
        self._state = TrackState.INITIALISING

    @property
    def labels(self) -> tuple[str, ...]:
        return self._model.labels

    def view(self, frame: Frame, clock: Stopwatch) -> ObjectView | str:
        """What the frame shows of the object, or the reason why it shows nothing."""
        mask = frame.masks.get(self._model.object_id)
        if mask is None:
            return f"no mask of object {self._model.object_id!r} was given"
        if not mask.any():
            return "out of view: the mask is empty"
        with clock("view"):
            view = view_object(frame, mask, self._model.diameter_m, self._config.view)
        return "no depth within the mask" if view is None else view

    def step(self, frame: Frame, view: ObjectView | str, saliency: Saliency | None, clock: Stopwatch) -> TrackResult:
        # 1. Which points of the object does the frame show, and what is each of them?
        if isinstance(view, str) or saliency is None:
            return self._lost(frame, str(view), clock)
        with clock("cloud"):
            cloud = lift(view, saliency, self._config.cloud)
            sight = _Sight(view, cloud, view_appearance(view))
        if len(cloud) < LEAST_POINTS:
            return self._lost(frame, f"too little to see: {len(cloud)} usable points, {LEAST_POINTS} are needed", clock)

        # 2. Which of its points is which point of the model?
        with clock("matching"):
            correspondences = self._match(sight.cloud)

        # 3. Is it where it was expected? If not clearly so: where do the correspondences agree that it is?
        found = self._expected(frame, sight, correspondences, clock)
        if found is None or found.evidence.score < self._config.trust:
            found = _preferred(found, self._searched(sight, correspondences, clock), self._config)
        if found is None or found.evidence.score < self._config.accept:
            score = found.evidence.score if found else 0.0
            return self._lost(frame, f"poor fit: the best pose explains {score:.2f} of what should be seen", clock)

        # 4. What does that say about its pose, given where it has been?
        return self._tracked(frame, found, view, clock)

    def _expected(
        self, frame: Frame, sight: _Sight, correspondences: Correspondences, clock: Stopwatch
    ) -> _Hypothesis | None:
        """The better of two poses near the prediction: by surfaces alone, and pulled by the concepts first."""
        predicted = self._filter.predict(frame.stamp_ns) if self._config.prior else None
        if predicted is None:
            return None
        with clock("closest points"):
            pulled = self._closest.align(self._closest.pull(predicted, correspondences, sight.cloud), sight.cloud)
            direct = self._closest.align(predicted, sight.cloud)
        found = self._refined(pulled, sight, "concepts", clock)
        if direct and pulled and self._alike(direct, pulled):
            return found
        return _better(self._refined(direct, sight, "prediction", clock), found)

    def _alike(self, a: Pose, b: Pose) -> bool:
        """So near that refinement brings them to the same pose."""
        return a.angle_to_rad(b) < 0.03 and a.distance_to_m(b) < 0.01 * self._model.diameter_m

    def _searched(self, sight: _Sight, correspondences: Correspondences, clock: Stopwatch) -> _Hypothesis | None:
        """The best of the poses on which correspondences agree, wherever that is."""
        with clock("registration"):
            generator = torch.Generator(self._device).manual_seed(self._config.seed)
            candidates = register(correspondences, sight.cloud, self._model, self._config.registration, generator)
            candidates = self._inequivalent(candidates)
        with clock("verification"):
            rough = [(self._verify(c.T_cam_obj, sight.view, sight.appearance).score, c) for c in candidates]
            rough.sort(key=lambda scored: -scored[0])
        best = None
        for _, candidate in rough[: self._config.verified]:
            with clock("closest points"):
                closer = self._closest.align(candidate.T_cam_obj, sight.cloud)
            best = _better(best, self._refined(closer, sight, "search", clock))
        return best

    def _inequivalent(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Those that the object's symmetry does not make the same as a better supported one."""
        alike = self._config.registration
        poses, distance_m = [c.T_cam_obj for c in candidates], alike.distinct_share * self._model.diameter_m
        return [candidates[k] for k in self._model.symmetry.distinct(poses, alike.distinct_rad, distance_m)]

    def _refined(self, T_start: Pose | None, sight: _Sight, origin: str, clock: Stopwatch) -> _Hypothesis | None:
        if T_start is None:
            return None
        with clock("refinement"):
            refined = self._refine(T_start, sight.view, sight.appearance)
        if refined is None:
            return None
        with clock("verification"):
            return _Hypothesis(refined, self._verify(refined.T_cam_obj, sight.view, sight.appearance), origin)

    def _tracked(self, frame: Frame, found: _Hypothesis, view: ObjectView, clock: Stopwatch) -> TrackResult:
        with clock("filter"):
            predicted = self._filter.predict(frame.stamp_ns) if self._config.prior else None
            refined = found.refined if predicted is None else found.refined.nearest(predicted, self._model.symmetry)
            raw, information = refined.T_cam_obj, refined.information
            filtered = self._filter.update(raw, information, frame.stamp_ns) if self._config.prior else None
            if filtered is None or not filtered.within_gate:  # verified, so the motion model is wrong, not the pose
                filtered = self._filter.start(raw, information, frame.stamp_ns)
        self._state = TrackState.TRACKING
        return TrackResult(
            stamp_ns=frame.stamp_ns,
            object_id=self._model.object_id,
            pose=filtered.T_cam_obj,
            state=self._state,
            confidence=found.evidence.score,
            covariance=filtered.covariance,
            reason=f"found by {found.origin}",
            raw_pose=raw,
            evidence=found.evidence,
            timings_ms=clock.timings_ms(),
            surface=Surface(self._model, np.where(view.inside, view.depth_m, np.float32(0)), view.camera),
        )

    def _lost(self, frame: Frame, reason: str, clock: Stopwatch) -> TrackResult:
        if self._state is TrackState.TRACKING:
            logger.info("object %r lost at frame %d: %s", self._model.object_id, frame.index, reason)
            self._state = TrackState.LOST
        return TrackResult(
            stamp_ns=frame.stamp_ns,
            object_id=self._model.object_id,
            pose=None,
            state=self._state,
            confidence=0.0,
            covariance=None,
            reason=reason,
            raw_pose=None,
            evidence=None,
            timings_ms=clock.timings_ms(),
        )


def _preferred(
    expected: _Hypothesis | None, elsewhere: _Hypothesis | None, config: TrackerConfig
) -> _Hypothesis | None:
    """The expected pose, unless it is not acceptable or the one found elsewhere is clearly better."""
    if expected is None or elsewhere is None or expected.evidence.score < config.accept:
        return _better(expected, elsewhere)
    return elsewhere if elsewhere.evidence.score > expected.evidence.score + config.jump else expected


def _better(a: _Hypothesis | None, b: _Hypothesis | None) -> _Hypothesis | None:
    """The one with the higher score, the first of equals."""
    if a is None or b is None:
        return a or b
    return a if a.evidence.score >= b.evidence.score else b
