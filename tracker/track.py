"""One object from frame to frame: whether what is found of it is believed, and what that says about its pose."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TypeGuard

import numpy as np

from tracker.belief import MOST_DOUBTFUL, believed, doubt, doubtful
from tracker.camera_motion import CameraMotion
from tracker.concept import ConceptModel
from tracker.confidence import confidence
from tracker.config import TrackerConfig
from tracker.found import Attempt, Found, Look
from tracker.frame import Mask
from tracker.geometry import Pose
from tracker.looking import Asking, Looking
from tracker.places import Moment, Places
from tracker.pointing import Pointer
from tracker.pose_filter import PoseFilter
from tracker.result import Surface, TrackResult, TrackState
from tracker.reviews import Review, SecondLook
from tracker.rivals import rival

logger = logging.getLogger(__name__)

SO_LONG = 300  # frames after which it may look otherwise, in another light
PLACED_SIGMA_RAD, PLACED_SIGMA_M = 0.1, 0.01  # how surely an object is where `place` says


class Track:
    """One object's stages, and what is remembered of it between frames.

    shown: (H, W) bool, the pixels by which it was found in the last frame, None where it was not. surest: to compare
    by, whether it has been followed for more than a frame, and how likely its pose is right.
    """

    def __init__(self, model: ConceptModel, config: TrackerConfig) -> None:
        self._model, self._config = model, config
        self._look, self._places = Looking(model, config), Places(model, config)
        self._second_look: SecondLook | None = None
        self._filter = PoseFilter(config.filter)
        self._state = TrackState.INITIALISING
        self._frames_lost, self._frames_followed, self._frames_doubtful, self._forgotten = 0, 0, 0, 0
        self._looked: list[Look | str] = []
        self._raw: Pose | None = None
        self.shown: Mask | None = None
        self.surest = False, 0.0

    @property
    def object_id(self) -> str:
        return self._model.object_id

    @property
    def attempt(self) -> Attempt:
        """Of the last frame."""
        return Attempt(tuple(self._looked), tuple(self._look.tried))

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
        self._look.forget()
        self._places.point_out(there)
        self._state = TrackState.INITIALISING

    def exchange(self, model: ConceptModel) -> None:
        """For one that knows more of the same object, in the same object frame. It goes on where it is."""
        self._model = model
        self._look, self._second_look = Looking(model, self._config), None
        self._places.exchange(model)

    def step(self, now: Moment) -> Asking[TrackResult]:
        predicted = self._filter.predict(now.frame.stamp_ns) if self._config.prior else None
        self._look.waiting, self._looked = False, []
        self._look.tried.clear()

        # 1. Is it where it is said, or expected, to be?
        looks = self._places.looks(now, predicted, self._followed, self._look)
        found = yield from self._look.best(self._noted(looks), now.frame, now.clock)

        # 2. If not, is it anywhere in the picture? That takes a second frame to be believed.
        suspected = None
        if self._searched and not self._believed(found) and self._frames_lost % self._config.search_every == 0:
            elsewhere = yield from self._places.anywhere(now, self._look)
            suspected = elsewhere.hypothesis.refined.T_cam_obj if self._believed(elsewhere) else None

        # 3. What does that say about its pose, given where it has been?
        if self._believed(found):
            return self._tracked(now, found, predicted)
        if self._carried:
            self._places.not_found(now, suspected)
        again = "seen again: the next frame has to confirm it"
        return self._lost(now, again if suspected else doubt(found, self._trusted, self._config))

    def review(self, now: Moment) -> Review | None:
        """Of the frame of the last step, where it went without concepts that it asked for."""
        if not self._look.waiting:
            return None
        self._second_look = self._second_look or SecondLook(self._model, self._config)
        places = self._places if self._searched else None
        again = self._second_look(self._looked, places, now, self._trusted, self._look.told_apart)
        return Review(again, self._raw, now.camera.now, self._forgotten)

    def reviewed(self, review: Review, found: Found, camera: CameraMotion) -> None:
        """What was found of it in the frame of a review says where it is now, as where it has been followed since then
        its motion is known; and how surely it is told from what is turned otherwise."""
        T_then_obj = found.hypothesis.refined.T_cam_obj
        if review.forgotten != self._forgotten:
            return
        if self._raw is None:
            self._places.suspected(T_then_obj, review.landmarks, camera)
        elif review.believed is not None:
            T_then_obj = self._model.symmetry.nearest(T_then_obj, review.believed)
            self._look.concepts_asked()
            if self._places.same(T_then_obj, review.believed):
                self._look.tells_apart(found)
            else:
                self._places.suspected(self._raw @ review.believed.inverse() @ T_then_obj, camera.now, camera)

    def withdrawn(self, now: Moment, other_id: str) -> TrackResult:
        """What was found in this frame is another object."""
        self._forget()
        return self._lost(now, f"what is seen there is object {other_id!r}")

    def _forget(self) -> None:
        """Where it was, and how it moved."""
        self._filter = PoseFilter(self._config.filter)
        self._places.forget()
        self._forgotten += 1

    def _noted(self, looks: Iterable[Look | str]) -> Iterator[Look | str]:
        for look in looks:
            self._looked.append(look)
            yield look

    @property
    def _followed(self) -> bool:
        return self._state is TrackState.TRACKING

    @property
    def _trusted(self) -> bool:
        """Whether less is asked of a pose, so that a state does not flicker."""
        return self._followed and self._frames_doubtful < MOST_DOUBTFUL

    @property
    def _carried(self) -> bool:
        return self._config.masks == "carried"

    @property
    def _searched(self) -> bool:
        """Whether the whole picture is, where nobody says where it is."""
        return self._carried and not self._places.pointed_out

    def _believed(self, found: Found | str) -> TypeGuard[Found]:
        return believed(found, self._trusted, self._config)

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
        self._raw = raw
        self._frames_doubtful = self._frames_doubtful + 1 if doubtful(found, self._config) else 0
        self.shown, self.surest = view.mask, (self._frames_followed > 1, found.confidence)
        self._look.came_of_it(found)
        grounds = replace(found.grounds, told_apart=self._look.told_apart)
        self._places.found(refined, now)
        better = rival(found, self._look.tried, self._model) if self._config.prior else None
        if better:
            self._places.suspected(better, now.camera.now, now.camera)
        return TrackResult(
            stamp_ns=stamp_ns,
            object_id=self._model.object_id,
            pose=filtered.T_cam_obj,
            state=self._state,
            confidence=confidence(grounds),
            covariance=filtered.covariance,
            reason=f"found by {found.hypothesis.origin}",
            raw_pose=raw,
            grounds=grounds,
            timings_ms=now.clock.timings_ms(),
            surface=Surface(
                self._model, np.where(view.inside, view.depth_m, np.float32(0)), view.camera, found.saliency
            ),
            mask=view.mask,
            step=filtered.step,
        )

    def _lost(self, now: Moment, reason: str) -> TrackResult:
        self._frames_lost, self._frames_followed, self._frames_doubtful = self._frames_lost + 1, 0, 0
        self._raw, self.shown = None, None
        if self._frames_lost == SO_LONG:
            self._look.forget()
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
