"""One object from frame to frame: whether what is found of it is believed, and what that says about its pose."""

from __future__ import annotations

import logging
from typing import TypeGuard

import numpy as np

from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Mask
from tracker.geometry import Pose
from tracker.looking import Asking, Found, Looking
from tracker.places import Moment, Places
from tracker.pointing import Pointer
from tracker.pose_filter import PoseFilter
from tracker.result import Surface, TrackResult, TrackState

logger = logging.getLogger(__name__)

PLACED_SIGMA_RAD, PLACED_SIGMA_M = 0.1, 0.01  # how surely an object is where `place` says
LEAST_SURFACE = 0.2  # of what should be seen: where less is in place, its colours prove nothing


class Track:
    """One object's stages, and what is remembered of it between frames.

    shown: (H, W) bool, the pixels by which it was found in the last frame, None where it was not. surest: to compare
    by, whether it has been followed for more than a frame, and how likely its pose is right.
    """

    def __init__(self, model: ConceptModel, config: TrackerConfig) -> None:
        self._model, self._config = model, config
        self._look, self._places = Looking(model, config), Places(model, config)
        self._filter = PoseFilter(config.filter)
        self._state = TrackState.INITIALISING
        self._frames_lost, self._frames_followed = 0, 0
        self.shown: Mask | None = None
        self.surest = False, 0.0

    @property
    def object_id(self) -> str:
        return self._model.object_id

    @property
    def labels(self) -> tuple[str, ...]:
        return self._model.labels

    def place(self, T_cam_obj: Pose, stamp_ns: int) -> None:
        information = np.diag([PLACED_SIGMA_RAD**-2] * 3 + [PLACED_SIGMA_M**-2] * 3)
        self._filter.start(T_cam_obj, information, stamp_ns)
        self._places.told(T_cam_obj)

    def point_out(self, there: Pointer) -> None:
        """In the next frame. What was known until then is not."""
        self._forget()
        self._places.point_out(there)
        self._state = TrackState.INITIALISING

    def step(self, now: Moment) -> Asking[TrackResult]:
        predicted = self._filter.predict(now.frame.stamp_ns) if self._config.prior else None

        # 1. Is it where it is said, or expected, to be?
        looks = self._places.looks(now, predicted, self._state is TrackState.TRACKING, self._look)
        found = yield from self._look.best(looks, now.frame, now.clock)

        # 2. If not, is it anywhere in the picture? That takes a second frame to be believed.
        suspected = None
        if self._carried and not self._believed(found) and self._frames_lost % self._config.search_every == 0:
            places = yield from self._places.anywhere(now)
            if not isinstance(places, str):
                elsewhere = yield from self._look.best(places, now.frame, now.clock)
                suspected = elsewhere.hypothesis.refined.T_cam_obj if self._believed(elsewhere) else None

        # 3. What does that say about its pose, given where it has been?
        if self._believed(found):
            return self._tracked(now, found, predicted)
        if self._carried:
            self._places.not_found(now, suspected)
        return self._lost(now, "seen again: the next frame has to confirm it" if suspected else self._why_not(found))

    def withdrawn(self, now: Moment, other_id: str) -> TrackResult:
        """What was found in this frame is another object."""
        self._forget()
        return self._lost(now, f"what is seen there is object {other_id!r}")

    def _forget(self) -> None:
        """Where it was, and how it moved."""
        self._filter = PoseFilter(self._config.filter)
        self._places.forget()

    @property
    def _carried(self) -> bool:
        return self._config.masks == "carried"

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

    @staticmethod
    def _why_not(found: Found | str) -> str:
        if isinstance(found, str):
            return found
        if found.missed:
            return found.missed
        judged = f"explains {found.score:.2f} of it" if found.masked else f"is right at {found.confidence:.0%}"
        return f"poor fit: the best pose {judged}"

    def _tracked(self, now: Moment, found: Found, predicted: Pose | None) -> TrackResult:
        stamp_ns, view = now.frame.stamp_ns, found.hypothesis.view
        with now.clock("filter"):
            refined = found.hypothesis.refined
            refined = refined if predicted is None else refined.nearest(predicted, self._model.symmetry)
            raw, information = refined.T_cam_obj, refined.information
            filtered = self._filter.update(raw, information, stamp_ns) if self._config.prior else None
            if filtered is None or not filtered.within_gate:  # verified, so the motion model is wrong, not the pose
                filtered = self._filter.start(raw, information, stamp_ns)
        self._state, self._frames_lost, self._frames_followed = TrackState.TRACKING, 0, self._frames_followed + 1
        self.shown, self.surest = view.mask, (self._frames_followed > 1, found.confidence)
        self._look.came_of_it(found.score)
        self._places.found(raw, now)
        return TrackResult(
            stamp_ns=stamp_ns,
            object_id=self._model.object_id,
            pose=filtered.T_cam_obj,
            state=self._state,
            confidence=found.confidence,
            covariance=filtered.covariance,
            reason=f"found by {found.hypothesis.origin}",
            raw_pose=raw,
            grounds=found.grounds,
            timings_ms=now.clock.timings_ms(),
            surface=Surface(self._model, np.where(view.inside, view.depth_m, np.float32(0)), view.camera),
            step=filtered.step,
        )

    def _lost(self, now: Moment, reason: str) -> TrackResult:
        self._frames_lost, self._frames_followed, self.shown = self._frames_lost + 1, 0, None
        if self._state is TrackState.TRACKING:
            logger.info("object %r lost at frame %d: %s", self._model.object_id, now.frame.index, reason)
            self._state = TrackState.LOST
            self._look.came_of_it(None)
        return TrackResult(
            stamp_ns=now.frame.stamp_ns,
            object_id=self._model.object_id,
            pose=None,
            state=self._state,
            confidence=0.0,
            covariance=None,
            reason=reason,
            raw_pose=None,
            grounds=None,
            timings_ms=now.clock.timings_ms(),
        )
