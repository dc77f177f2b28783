"""The tracker: all objects of a camera, frame by frame. What is done for each is on the page of `Track.step`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor

from tracker.camera_motion import CameraMotion
from tracker.claims import claimed_by_others, in_one_place
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, FrameError, LateFrameError
from tracker.found import Attempt
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.lockstep import lockstep
from tracker.places import Moment
from tracker.pointing import Pointer
from tracker.result import TrackResult
from tracker.reviews import Answered, Reviews
from tracker.saliency import Query, Saliency, SaliencyBackend, open_backend
from tracker.stopwatch import Stopwatch
from tracker.track import Track
from tracker.view import ObjectView


class ObjectTracker:
    """Follows objects through the frames of one camera.

    models: one concept model an object. backend: the one that made them; None opens it by name. worker: of one thread,
    where the backend finds concepts while the tracker goes on by surface and colours alone: with a slow one it keeps
    the frame rate. None: every frame that needs concepts waits for them. It is the caller's to shut down.

    Raises ModelError where a model is of another backend, ConfigError where two models are of the same object.
    """

    def __init__(
        self,
        models: ConceptModel | Sequence[ConceptModel],
        config: TrackerConfig | None = None,
        backend: SaliencyBackend | None = None,
        worker: Executor | None = None,
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
        self._reviews = Reviews(worker) if worker else None
        self._tracks = [Track(model, config) for model in models]
        self._camera = CameraMotion()
        self._config, self._last_stamp_ns, self._placed_ns = config, -1, -1
        self._answers: dict[str, tuple[ObjectView, Saliency]] = {}

    def place(self, object_id: str, T_cam_obj: Pose, stamp_ns: int) -> None:
        """Tell where an object is, roughly: the next frame looks there first, and elsewhere where it is not there.

        What was known of its motion is forgotten. stamp_ns: of the pose, not before the last frame nor after the next.
        Raises ConfigError where there is no model of the object or the tracker has no prior, FrameError where the time
        is past.
        """
        track = self._track_of(object_id)
        if not self._config.prior:
            raise ConfigError(f"object {object_id!r} cannot be placed: with prior off every frame is searched anew")
        if not isinstance(stamp_ns, int) or stamp_ns < max(self._last_stamp_ns, 0):
            raise FrameError(
                f"the pose of object {object_id!r} is of {stamp_ns!r} ns: expected whole nanoseconds, not before the "
                f"last frame's {max(self._last_stamp_ns, 0)} ns"
            )
        track.place(T_cam_obj, stamp_ns)
        self._placed_ns = max(self._placed_ns, stamp_ns)

    def point_out(self, object_id: str, there: Pointer) -> None:
        """Tell where an object is in the next frame: a `Box` around it or a `Click` on it, in pixels. What was known of
        it is forgotten, and it is looked for there alone, and around there in the frames after that.

        Raises ConfigError where there is no model of the object, or masks are given by every frame.
        """
        track = self._track_of(object_id)
        if self._config.masks != "carried":
            raise ConfigError(
                f"object {object_id!r} cannot be pointed out: every frame's mask says where it is; "
                'with masks="carried" the tracker goes on by itself'
            )
        track.point_out(there)

    def exchange(self, model: ConceptModel) -> None:
        """Take a model that knows more of an object for the one that there is; it is tracked on from where it is.

        Raises ConfigError where there is no model of the object, ModelError where this one is of another backend.
        """
        model.require_backend(self._backend)
        self._track_of(model.object_id).exchange(model)

    def step(self, frame: Frame) -> tuple[TrackResult, ...]:
        """Every model's result, in their order.

        Raises LateFrameError, a FrameError, where time does not advance: late, out of order or sent twice. The tracker
        is as before then, so that such a frame can be left out; `tracker.in_order` does that for a whole source.
        """
        if frame.stamp_ns <= self._last_stamp_ns or frame.stamp_ns < self._placed_ns:
            before, what = max((self._last_stamp_ns, "the last one"), (self._placed_ns, "the pose that was told"))
            raise LateFrameError(
                f"frame {frame.index} of {frame.provenance.source}: its stamp {frame.stamp_ns} ns is not after "
                f"{what}, {before} ns"
            )
        self._last_stamp_ns = frame.stamp_ns
        if self._reviews:
            self._reviews.collect(self._camera)
        self._camera.advance(frame)
        claimed = claimed_by_others([track.shown for track in self._tracks])
        moments = [Moment(frame, self._camera, others, Stopwatch()) for others in claimed]
        steps = [track.step(now) for track, now in zip(self._tracks, moments, strict=True)]
        results = lockstep(steps, dict.fromkeys if self._reviews else self._saliency(self._tracks, moments))
        if self._config.masks == "carried":
            results = self._one_at_a_place(results, moments)
        if self._reviews:
            self._review(self._reviews, moments)
        return tuple(results)

    def attempt(self, object_id: str) -> Attempt:
        """How an object was looked for in the last frame, to see why it was not found. Raises ConfigError where there
        is no model of it."""
        return self._track_of(object_id).attempt

    @property
    def frames_without_concepts(self) -> int:
        """In which an object asked for them while the worker was busy with an earlier frame."""
        return self._reviews.skipped if self._reviews else 0

    def last_answer(self, object_id: str) -> tuple[ObjectView, Saliency] | None:
        """What was looked at of an object when its concepts were asked for last, and where they were; None if they
        never were. From any thread."""
        return self._answers.get(object_id)

    def _review(self, reviews: Reviews, moments: Sequence[Moment]) -> None:
        """What the worker is to look at next, if it has time."""
        offered = [(track, track.review(now), now) for track, now in zip(self._tracks, moments, strict=True)]
        wanted = [(track, review, now) for track, review, now in offered if review]
        answered = self._saliency([track for track, _, _ in wanted], [now for _, _, now in wanted])
        reviews.offer([(track, review) for track, review, _ in wanted], answered)

    def _one_at_a_place(self, results: Sequence[TrackResult], moments: Sequence[Moment]) -> list[TrackResult]:
        """Of two objects that explain the same pixels the surer one does; what is said of the other one instead."""
        corrected: dict[int, TrackResult] = {}
        for pair in in_one_place([track.shown for track in self._tracks]):
            kept, refused = sorted(pair, key=lambda k: self._tracks[k].surest, reverse=True)
            if refused not in corrected and kept not in corrected:
                other = self._tracks[kept].object_id
                corrected[refused] = self._tracks[refused].withdrawn(moments[refused], other)
        return [corrected.get(k, result) for k, result in enumerate(results)]

    def _track_of(self, object_id: str) -> Track:
        tracks = {track.object_id: track for track in self._tracks}
        if object_id not in tracks:
            raise ConfigError(f"there is no model of object {object_id!r}; there are {', '.join(tracks)}")
        return tracks[object_id]

    def _saliency(self, tracks: Sequence[Track], moments: Sequence[Moment]) -> Answered:
        """Of what these objects look at, by position, in one batch; each bears its part of the time."""

        def answered(views: Mapping[int, ObjectView]) -> dict[int, Saliency | None]:
            queries = [Query(view, tracks[k].labels) for k, view in views.items()]
            with Stopwatch.shared([moments[k].clock for k in views], "saliency"):
                answers = self._backend(queries)
            for k, query, answer in zip(views, queries, answers, strict=True):
                self._answers[tracks[k].object_id] = query.view, answer
            return dict(zip(views, answers, strict=True))

        return answered
