"""One object from frame to frame: where to look for it, and whether what is found there is believed."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from typing import TypeGuard

import numpy as np

from tracker.camera_motion import CameraMotion
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame, Mask
from tracker.geometry import Pose
from tracker.looking import Asking, Found, Look, Looking
from tracker.pointing import Pointer
from tracker.pose_filter import PoseFilter
from tracker.proposals import Proposals
from tracker.result import Surface, TrackResult, TrackState
from tracker.stopwatch import Stopwatch
from tracker.whereabouts import Whereabouts

logger = logging.getLogger(__name__)

PLACED_SIGMA_RAD, PLACED_SIGMA_M = 0.1, 0.01  # how surely an object is where `place` says
SAME_RAD, SAME_SHARE = 0.05, 0.03  # poses nearer than this angle and share of the diameter are looked at once
MOVED_ON = 0.4  # diameters that it may have moved while nobody saw it
LEAST_SURFACE = 0.2  # of what should be seen: where less is in place, its colours prove nothing


class Track:
    """One object's stages, and what is remembered of it between frames."""

    def __init__(self, model: ConceptModel, config: TrackerConfig) -> None:
        self._model, self._config = model, config
        self._look = Looking(model, config)
        self._proposals = Proposals(model, config.proposals, config.matching, config.torch_device)
        self._filter = PoseFilter(config.filter)
        self._centre_m = model.points.mean(axis=0)
        self._state = TrackState.INITIALISING
        self._where = Whereabouts()
        self._frames_lost = 0
        self._pointer: Pointer | None = None

    @property
    def object_id(self) -> str:
        return self._model.object_id

    @property
    def labels(self) -> tuple[str, ...]:
        return self._model.labels

    def place(self, T_cam_obj: Pose, stamp_ns: int) -> None:
        information = np.diag([PLACED_SIGMA_RAD**-2] * 3 + [PLACED_SIGMA_M**-2] * 3)
        self._filter.start(T_cam_obj, information, stamp_ns)
        self._where.told(T_cam_obj)

    def point_out(self, there: Pointer) -> None:
        """In the next frame. What was known until then is not."""
        self._pointer, self._state, self._frames_lost = there, TrackState.INITIALISING, 0
        self._filter, self._where = PoseFilter(self._config.filter), Whereabouts()

    def step(self, frame: Frame, camera: CameraMotion, clock: Stopwatch) -> Asking[TrackResult]:
        # 1. Is it where it is said, or expected, to be?
        there, masked = self._pointed_out(frame)
        found = yield from self._look.best(self._looks(there, masked, frame, camera, clock), frame, clock)

        # 2. If not, is it anywhere in the picture? That takes a second frame to be believed.
        if self._carried and there is None and not self._believed(found) and self._search_due:
            elsewhere = yield from self._anywhere(frame, clock)
            if self._believed(elsewhere):
                self._where.carry(camera, elsewhere.hypothesis.refined.T_cam_obj)
                return self._lost(frame, "seen again: the next frame has to confirm it", clock)

        # 3. What does that say about its pose, given where it has been?
        if self._believed(found):
            return self._tracked(frame, found, camera, clock)
        if self._carried:
            self._where.carry(camera)
            if there is not None:
                self._where.point_out(there, frame, camera)
        return self._lost(frame, self._why_not(found), clock)

    def _pointed_out(self, frame: Frame) -> tuple[Mask | None, bool]:
        """Pixels (H, W) where somebody says that it is, and whether all of them are known to be its own."""
        pointer, self._pointer = self._pointer, None
        mask = frame.masks.get(self._model.object_id)
        if mask is None and pointer is not None:
            return self._proposals.pointed_out(pointer, frame), False
        return mask, True

    @staticmethod
    def _why_not(found: Found | str) -> str:
        if isinstance(found, str):
            return found
        if found.missed:
            return found.missed
        judged = f"explains {found.score:.2f} of it" if found.masked else f"is right at {found.confidence:.0%}"
        return f"poor fit: the best pose {judged}"

    @property
    def _carried(self) -> bool:
        return self._config.masks == "carried"

    def _looks(
        self, there: Mask | None, masked: bool, frame: Frame, camera: CameraMotion, clock: Stopwatch
    ) -> Iterator[Look | str]:
        """Where to look, one after the other until it is found; or why nowhere. there, masked: where somebody says."""
        predicted = self._filter.predict(frame.stamp_ns) if self._config.prior else None
        if there is not None and masked:
            expected = () if predicted is None else (predicted,)
            yield Look(there, predicted, expected, masked=True) if there.any() else "out of view: the mask is empty"
        elif there is not None:
            yield Look(there, None)
        elif not self._carried:
            yield f"no mask of object {self._model.object_id!r} was given"
        elif self._where.known:
            yield from self._where_it_may_be(self._expected(predicted, camera), frame, clock)
        elif (place_m := self._where.pointed_out_m(camera)) is not None:
            yield Look(self._proposals.around(place_m, frame), None)
        else:
            yield "not seen yet"

    def _where_it_may_be(self, expected: Iterable[Pose], frame: Frame, clock: Stopwatch) -> Iterator[Look | str]:
        """Near each pose, of which there is one at least; where it is clearly at none, anywhere around the first."""
        near: list[Pose] = []
        for pose in expected:
            if not any(self._same(pose, other) for other in near):
                near.append(pose)
                outline = self._look.outline(pose, frame, clock)
                yield outline if isinstance(outline, str) else Look(outline, pose, tuple(near))
        around = self._proposals.around((near[0] @ self._centre_m[None])[0], frame, MOVED_ON)
        yield Look(around, None, tuple(near))

    def _expected(self, predicted: Pose | None, camera: CameraMotion) -> Iterator[Pose]:
        """Where it is if it moves on as it did; where it is if it stands still and the camera moved."""
        if predicted is not None and self._state is TrackState.TRACKING:
            yield predicted
        yield from self._where.expected(camera)

    def _same(self, a: Pose, b: Pose) -> bool:
        return a.angle_to_rad(b) < SAME_RAD and a.distance_to_m(b) < SAME_SHARE * self._model.diameter_m

    def _anywhere(self, frame: Frame, clock: Stopwatch) -> Asking[Found | str]:
        picture = self._proposals.picture(frame)
        if picture is None:
            return "no depth in the whole picture"
        saliency = yield picture
        with clock("proposals"):
            masks = self._proposals.masks(picture, saliency, self._config.cloud)
        return (yield from self._look.best((Look(mask, None) for mask in masks), frame, clock))

    def _believed(self, found: Found | str) -> TypeGuard[Found]:
        """Of pixels that are said to be the object's a pose has to explain enough. Elsewhere it has to be likely: less
        is asked where it was expected while it is tracked than of what is seen again or has jumped, so that a state
        does not flicker."""
        if isinstance(found, str):
            return False
        if found.masked:
            return found.score >= self._config.accept
        goes_on = self._state is TrackState.TRACKING and found.hypothesis.origin != "search"
        likely = found.confidence >= (self._config.believe if goes_on else self._config.regain)
        return likely and found.hypothesis.evidence.surface >= LEAST_SURFACE

    @property
    def _search_due(self) -> bool:
        return self._frames_lost % self._config.search_every == 0

    def _tracked(self, frame: Frame, found: Found, camera: CameraMotion, clock: Stopwatch) -> TrackResult:
        with clock("filter"):
            predicted = self._filter.predict(frame.stamp_ns) if self._config.prior else None
            refined = found.hypothesis.refined
            refined = refined if predicted is None else refined.nearest(predicted, self._model.symmetry)
            raw, information = refined.T_cam_obj, refined.information
            filtered = self._filter.update(raw, information, frame.stamp_ns) if self._config.prior else None
            if filtered is None or not filtered.within_gate:  # verified, so the motion model is wrong, not the pose
                filtered = self._filter.start(raw, information, frame.stamp_ns)
        self._state, self._frames_lost = TrackState.TRACKING, 0
        self._look.came_of_it(found.score)
        self._where.found(raw, camera)
        view = found.hypothesis.view
        return TrackResult(
            stamp_ns=frame.stamp_ns,
            object_id=self._model.object_id,
            pose=filtered.T_cam_obj,
            state=self._state,
            confidence=found.confidence,
            covariance=filtered.covariance,
            reason=f"found by {found.hypothesis.origin}",
            raw_pose=raw,
            grounds=found.grounds,
            timings_ms=clock.timings_ms(),
            surface=Surface(self._model, np.where(view.inside, view.depth_m, np.float32(0)), view.camera),
            step=filtered.step,
        )

    def _lost(self, frame: Frame, reason: str, clock: Stopwatch) -> TrackResult:
        self._frames_lost += 1
        if self._state is TrackState.TRACKING:
            logger.info("object %r lost at frame %d: %s", self._model.object_id, frame.index, reason)
            self._state = TrackState.LOST
            self._look.came_of_it(None)
        return TrackResult(
            stamp_ns=frame.stamp_ns,
            object_id=self._model.object_id,
            pose=None,
            state=self._state,
            confidence=0.0,
            covariance=None,
            reason=reason,
            raw_pose=None,
            grounds=None,
            timings_ms=clock.timings_ms(),
        )
