"""The tracker. The method on one page: `ObjectTracker.step` and `_Track.step`."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from tracker.cloud import LEAST_POINTS, lift
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, FrameError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.pose_filter import PoseFilter
from tracker.result import Surface, TrackResult, TrackState
from tracker.saliency import Query, Saliency, SaliencyBackend, open_backend
from tracker.search import Hypothesis, Search, Sight
from tracker.stopwatch import Stopwatch
from tracker.view import ObjectView, view_object

logger = logging.getLogger(__name__)

PLACED_SIGMA_RAD, PLACED_SIGMA_M = 0.1, 0.01  # how surely an object is where `place` says


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
        self._prior, self._last_stamp_ns, self._placed_ns = config.prior, -1, -1

    def place(self, object_id: str, T_cam_obj: Pose, stamp_ns: int) -> None:
        """Tell where an object is, roughly: the next frame looks there first, and elsewhere where it is not there.

        What was known of its motion is forgotten. stamp_ns: of the pose, not before the last frame nor after the next.
        Raises ConfigError where there is no model of the object or the tracker has no prior, FrameError where the time
        is past.
        """
        tracks = {track.object_id: track for track in self._tracks}
        if object_id not in tracks:
            raise ConfigError(f"there is no model of object {object_id!r} to place; there are {', '.join(tracks)}")
        if not self._prior:
            raise ConfigError(f"object {object_id!r} cannot be placed: with prior off every frame is searched anew")
        if not isinstance(stamp_ns, int) or stamp_ns < max(self._last_stamp_ns, 0):
            raise FrameError(
                f"the pose of object {object_id!r} is of {stamp_ns!r} ns: expected whole nanoseconds, not before the "
                f"last frame's {max(self._last_stamp_ns, 0)} ns"
            )
        tracks[object_id].place(T_cam_obj, stamp_ns)
        self._placed_ns = max(self._placed_ns, stamp_ns)

    def step(self, frame: Frame) -> tuple[TrackResult, ...]:
        """Every model's result, in their order. Raises FrameError where time does not advance; nothing is lost then."""
        if frame.stamp_ns <= self._last_stamp_ns or frame.stamp_ns < self._placed_ns:
            before, what = max((self._last_stamp_ns, "the last one"), (self._placed_ns, "the pose that was told"))
            raise FrameError(
                f"frame {frame.index} of {frame.provenance.source}: its stamp {frame.stamp_ns} ns is not after "
                f"{what}, {before} ns"
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


class _Track:
    """One object's stages and its state between frames."""

    def __init__(self, model: ConceptModel, config: TrackerConfig) -> None:
        self._model, self._config = model, config
        self._search = Search(model, config)
        self._filter = PoseFilter(config.filter)
        self._state = TrackState.INITIALISING

    @property
    def object_id(self) -> str:
        return self._model.object_id

    @property
    def labels(self) -> tuple[str, ...]:
        return self._model.labels

    def place(self, T_cam_obj: Pose, stamp_ns: int) -> None:
        information = np.diag([PLACED_SIGMA_RAD**-2] * 3 + [PLACED_SIGMA_M**-2] * 3)
        self._filter.start(T_cam_obj, information, stamp_ns)

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
            sight = Sight.of(view, lift(view, saliency, self._config.cloud))
        if len(sight.cloud) < LEAST_POINTS:
            few = f"too little to see: {len(sight.cloud)} usable points, {LEAST_POINTS} are needed"
            return self._lost(frame, few, clock)

        # 2. Which pose explains them, at best near the expected one?
        predicted = self._filter.predict(frame.stamp_ns) if self._config.prior else None
        found = self._search(sight, predicted, clock)
        if found is None or found.evidence.score < self._config.accept:
            score = found.evidence.score if found else 0.0
            return self._lost(frame, f"poor fit: the best pose explains {score:.2f} of what should be seen", clock)

        # 3. What does that say about its pose, given where it has been?
        return self._tracked(frame, found, predicted, view, clock)

    def _tracked(
        self, frame: Frame, found: Hypothesis, predicted: Pose | None, view: ObjectView, clock: Stopwatch
    ) -> TrackResult:
        with clock("filter"):
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
