"""A model that grows while its object is tracked, by sides that it does not know yet."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from reference.growing import GrowingModel, Registration, name_of
from reference.keyframes import LEAST_VISIBLE_PX
from reference.viewsphere import view_direction
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame, Mask, PosedFrame
from tracker.geometry import Floats, Pose
from tracker.result import TrackResult
from tracker.saliency import SaliencyBackend
from tracker.symmetry import Symmetry

logger = logging.getLogger(__name__)

MOST_VIEWS = 12
WATCHED, MOST_FALLEN = 15, 0.15  # results before and after a frame joined, and how far their mean confidence may fall


@dataclass(frozen=True, slots=True, eq=False)
class Growth:
    """What may join a model. views: that it is made of, at most. apart_rad: how far from all of them a frame has to be
    seen. again_rad: the same of frames that were refused. least_confidence: of a pose by which a frame joins. mask_of:
    the object's pixels (H, W) in a frame by those that the tracker says; by default they are these, which end where
    the model that it has does."""

    views: int = MOST_VIEWS
    apart_rad: float = np.radians(20)
    again_rad: float = np.radians(20)
    least_confidence: float = 0.9
    mask_of: Callable[[Frame, Mask], Mask] = lambda _, mask: mask


class Completion:
    """Of one model. Frames join it in which its object is surely where the tracker says, seen from elsewhere than in
    those that it is made of, and that contradict none of them. Where the tracker is less sure of its poses afterwards,
    the frame is taken out again.

    symmetry: of the object; None looks for it in every model anew, as a few views may not show it. Unless it is given,
    it is that of the first model.

    model: the last one. views: that it is made of. proven: no frame has joined so lately that it may be taken out
    again. refused: frames that did not join or were taken out, by name and with the reason.
    """

    def __init__(
        self,
        model: ConceptModel,
        backend: SaliencyBackend,
        config: TrackerConfig | None = None,
        growth: Growth | None = None,
        symmetry: Symmetry | Literal["as it is"] | None = "as it is",
    ) -> None:
        config = (config or TrackerConfig()).model_copy(update={"prior": False, "masks": "given"})
        symmetry = model.symmetry if symmetry == "as it is" else symmetry
        self._growth = growth or Growth()
        self._registration = Registration(backend, config, model.labels, symmetry, self._growth.least_confidence)
        self._growing = GrowingModel(self._registration, model.references, model)
        self._refused_from: list[Floats] = []
        self._before: deque[float] = deque(maxlen=WATCHED)
        self._since: list[float] = []
        self._smaller: GrowingModel | None = None

    @property
    def model(self) -> ConceptModel:
        return self._growing.model

    @property
    def views(self) -> int:
        return len(self._growing.frames)

    @property
    def proven(self) -> bool:
        return self._smaller is None

    @property
    def refused(self) -> tuple[str, ...]:
        return tuple(self._growing.left_out)

    def consider(self, frame: Frame, result: TrackResult) -> ConceptModel | None:
        """result: of the frame. The model to go on with, for `ObjectTracker.exchange`, where it is another one now."""
        if result.raw_pose is None or result.mask is None:
            return None
        if self._smaller is not None:
            return self._watched(result.confidence)
        self._before.append(result.confidence)
        if not self._teaches(result.raw_pose, result.mask, result.confidence):
            return None
        smaller = self._growing.copy()
        mask = self._growth.mask_of(frame, result.mask)
        if not self._growing.join(PosedFrame(frame, result.object_id, result.raw_pose, mask)):
            self._refused_from.append(view_direction(result.raw_pose))
            return None
        logger.info("the model of object %r grows by %s", result.object_id, name_of(frame))
        self._smaller, self._since = smaller, []
        return self.model

    def _teaches(self, T_cam_obj: Pose, mask: Mask, confidence: float) -> bool:
        """Whether it is surely there, and a side is seen that the model may not know."""
        growth, here = self._growth, view_direction(T_cam_obj)
        known = (self._growing.model.view_directions @ here > np.cos(growth.apart_rad)).any()
        tried = any(refused @ here > np.cos(growth.again_rad) for refused in self._refused_from)
        elsewhere = len(self._growing.frames) < growth.views and not known and not tried
        return bool(elsewhere) and confidence >= growth.least_confidence and int(mask.sum()) >= LEAST_VISIBLE_PX

    def _watched(self, confidence: float) -> ConceptModel | None:
        """The way back."""
        self._since.append(confidence)
        if len(self._since) < WATCHED:
            return None
        smaller, self._smaller = self._smaller, None
        fallen = float(np.mean(self._before) - np.mean(self._since))
        if smaller is None or fallen <= MOST_FALLEN:
            return None
        taken_out = self._growing.frames[-1].frame
        self._refused_from.append(view_direction(self._growing.frames[-1].T_cam_obj))
        smaller.left_out.append(f"{name_of(taken_out)}: with it, poses are less sure by {fallen:.2f}")
        logger.info("the model of object %r is the smaller one again: %s", self.model.object_id, smaller.left_out[-1])
        self._growing = smaller
        return self.model
