"""An object that is turned before a camera, or that a camera goes around: its model grows while it is watched."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from reference.completion import MOST_VIEWS, Completion, Growth
from reference.onboard import joined_model
from reference.segment import segment
from reference.unposed import CENTRED, LEAST_CONFIDENCE, centred
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import OnboardingError
from tracker.frame import Frame, Mask
from tracker.pipeline import ObjectTracker
from tracker.pointing import Pointer
from tracker.result import TrackResult
from tracker.saliency import SaliencyBackend
from tracker.symmetry import Symmetry
from tracker.view import Box, bounding_box

logger = logging.getLogger(__name__)

ENOUGH_COVERAGE = 0.6  # of the viewing sphere; a turn about a standing object shows 75 % of it
# It starts from one view, whose pose gets worse the farther it is turned: the next ones are taken early, and where one
# is refused another is soon tried.
APART_RAD, AGAIN_RAD = np.radians(15), np.radians(5)
MARGIN, LEAST_SHARED = 0.15, 0.7  # of a mask's size, where its thing may go on; of a mask has to be that thing's
PATIENCE = 30  # frames in which a thing may be found first: a camera's first ones are dark


@dataclass(frozen=True, slots=True, eq=False)
class Progress:
    """coverage: share of the viewing sphere within 60 degrees of a view, in [0, 1]. views: keyframes of the model.
    grown: by this frame. result: what the tracker says of it. enough: nothing more is asked for."""

    coverage: float
    views: int
    grown: bool
    result: TrackResult
    enough: bool


def first_sight(frames: Iterator[Frame], there: Pointer | None) -> tuple[Frame, Mask]:
    """The first frame in which `segment` finds something, with its mask (H, W); later ones are left to be taken.

    Raises OnboardingError with the last reason where that is none of the first 30, or where there are none.
    """
    reason = OnboardingError("there are no frames; expected some that show the object")
    for _ in range(PATIENCE):
        frame = next(frames, None)
        if frame is None:
            break
        try:
            return frame, segment(frame, there)
        except OnboardingError as error:
            reason = error
    raise reason


def whole_of(frame: Frame, mask: Mask) -> Mask:
    """(H, W) bool, all of the thing that stands apart where a mask has most of its pixels; that mask where there is no
    such thing. A tracker's mask ends where the model does, and has a strip of what the thing stands on."""
    box = bounding_box(mask)
    if box is None:
        return mask
    margin_px = round(MARGIN * max(box.x1 - box.x0, box.y1 - box.y0))
    height, width = mask.shape
    wider = Box(
        max(box.x0 - margin_px, 0), max(box.y0 - margin_px, 0),
        min(box.x1 + margin_px, width), min(box.y1 + margin_px, height),
    )  # fmt: skip
    try:
        whole = segment(frame, wider)
    except OnboardingError:
        return mask
    return whole if (whole & mask).sum() > LEAST_SHARED * mask.sum() else mask


class TurnedObject:
    """Made by one frame and the object's mask (H, W) in it, whose centre and camera axes set the object frame. `see`
    every further frame; `model` is what is known by then, whole at any time.

    vocabulary, symmetry: as for `onboard`. config: of the tracker; its views and clouds make the model too. views:
    keyframes at most. coverage: share of the viewing sphere that is enough.

    Raises OnboardingError where the first frame makes no model.
    """

    def __init__(
        self,
        frame: Frame,
        mask: Mask,
        object_id: str,
        backend: SaliencyBackend,
        config: TrackerConfig | None = None,
        vocabulary: Sequence[str] | None = None,
        symmetry: Symmetry | None = None,
        views: int = MOST_VIEWS,
        coverage: float = ENOUGH_COVERAGE,
    ) -> None:
        config = (config or TrackerConfig()).model_copy(update={"prior": True, "masks": "carried"})
        first = centred(replace(frame, masks={}), mask, object_id, config)
        model = joined_model([first], backend, config.view, config.cloud, vocabulary, symmetry)
        self._views, self._coverage = views, coverage
        growth = Growth(views, APART_RAD, AGAIN_RAD, LEAST_CONFIDENCE, whole_of)
        self._completion = Completion(model, backend, config, growth, symmetry)
        self._tracker = ObjectTracker(model, config, backend)
        self._frames, self._source = 1, frame.provenance.source
        (result,) = self._tracker.step(replace(frame, masks={object_id: mask}))
        self.progress = self._progress(result, grown=False)

    def see(self, frame: Frame) -> Progress:
        """Masks that it may have are not looked at. Raises LateFrameError as `ObjectTracker.step` does."""
        frame = replace(frame, masks={})
        (result,) = self._tracker.step(frame)
        self._frames += 1
        views = self._completion.views
        model = self._completion.consider(frame, result)
        if model is not None:
            self._tracker.exchange(model)
        self.progress = self._progress(result, grown=self._completion.views > views)
        return self.progress

    @property
    def model(self) -> ConceptModel:
        """With `object_frame`, frames that were `left_out` and why, and how it `came_about` in its notes."""
        model = self._completion.model
        notes = {
            "object_frame": CENTRED,
            "left_out": list(self._completion.refused),
            "came_about": f"turned before the camera, {self._frames} frames from {self._source} on; the first one's "
            "mask by depth, the poses by tracking",
        }
        return replace(model, notes={**model.notes, **notes})

    def _progress(self, result: TrackResult, grown: bool) -> Progress:
        coverage, views = self._completion.model.notes["quality"]["coverage"], self._completion.views
        enough = coverage >= self._coverage or views >= self._views
        return Progress(coverage, views, grown, result, enough and self._completion.proven)
