"""A model that grows by frames whose poses nobody knows: the tracker itself finds how they belong together.

The frame that is registered most surely to what there is joins it, then the next one, to what there is by then. It has
to agree with those before it. Where three or more are together, each is registered once more, to a model of all the
others: what went wrong along a chain shows where its ends meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from reference.cross_check import cross_check
from reference.fusion import DEPTH_SLACK
from reference.onboard import joined_model, surface_of
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import OnboardingError
from tracker.frame import Frame, PosedFrame
from tracker.geometry import Pose
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult
from tracker.saliency import SaliencyBackend
from tracker.symmetry import Symmetry

# Of the surface that two frames can judge. True poses: none of it where rendered, 9 % at most in a recording whose
# masks and depth are a camera's. Poses that are 20 degrees or 2 centimetres off: mostly 20 to 50 %.
MOST_DENIED = 0.1
# By how much a frame may lower how well an earlier one's colours agree with the model: true poses take 0.06 at most, in
# changing light and in that recording.
MOST_FADED = 0.1
SAME_RAD, SAME_M = np.radians(10), 0.02  # what the confidence calls right


@dataclass(frozen=True, slots=True)
class Registration:
    """How a model is made of frames, and frames are registered to it. config: of the tracker, with the prior off.
    least_confidence: from which a pose is believed."""

    backend: SaliencyBackend
    config: TrackerConfig
    vocabulary: Sequence[str] | None
    symmetry: Symmetry | None
    least_confidence: float

    def model(self, frames: Sequence[PosedFrame]) -> ConceptModel:
        """Raises OnboardingError where the frames do not make one."""
        config = self.config
        return joined_model(frames, self.backend, config.view, config.cloud, self.vocabulary, self.symmetry)

    def register(self, model: ConceptModel, frames: Sequence[PosedFrame]) -> list[TrackResult]:
        """Each frame by itself, whatever its stamp and its pose."""
        tracker = ObjectTracker(model, self.config, self.backend)
        alone = [replace(f.frame, stamp_ns=k, masks={f.object_id: f.mask}) for k, f in enumerate(frames)]
        return [tracker.step(frame)[0] for frame in alone]

    def sure(self, result: TrackResult) -> Pose | None:
        return result.raw_pose if result.confidence >= self.least_confidence else None

    def surface_denied(self, a: PosedFrame, b: PosedFrame, diameter_m: float) -> float:
        """In [0, 1], the larger share of the surface in one frame that the other one sees not to be there."""
        shares = []
        for shown, other in ((a, b), (b, a)):
            points = surface_of(shown, self.config.view, self.config.cloud)
            votes = cross_check(points, [other], DEPTH_SLACK * diameter_m)
            shares.append(votes.denied.sum() / max(int((votes.denied + votes.confirmed).sum()), 1))
        return float(max(shares))


class GrowingModel:
    """frames: those that are together. model: of them. left_out: the others, by name and with the reason."""

    def __init__(self, registration: Registration, frames: Sequence[PosedFrame], model: ConceptModel) -> None:
        """frames: those that the model was made of."""
        self._registration = registration
        self.frames, self.model = list(frames), model
        self.left_out: list[str] = []
        self._colours = self._colours_found_again(self.model, self.frames)

    def copy(self) -> GrowingModel:
        """As it is now."""
        other = copy(self)
        other.frames, other.left_out = list(self.frames), list(self.left_out)
        return other

    def take(self, waiting: Sequence[PosedFrame]) -> None:
        """Frames, whose poses are not looked at, as long as one of them is registered surely. The surest comes first:
        their order does not matter."""
        waiting = list(waiting)
        while waiting:
            results = self._registration.register(self.model, waiting)
            surest = max(range(len(waiting)), key=lambda k: results[k].confidence)
            T_cam_obj = self._registration.sure(results[surest])
            if T_cam_obj is None:
                for frame, result in zip(waiting, results, strict=True):
                    self._leave_out(frame, self._unsure(result))
                return
            self.join(replace(waiting.pop(surest), T_cam_obj=T_cam_obj))

    def settle(self) -> None:
        """Register each frame but the first to a model of the others. One that is surely elsewhere there contradicts
        them, and goes; the poses found there are taken if the model of them all explains its frames better."""
        if len(self.frames) < 3:
            return
        settled, contradicting = [self.frames[0]], []
        for k in range(1, len(self.frames)):
            frame, others = self.frames[k], [*settled, *self.frames[k + 1 :]]
            model = self._registration.model(others)
            found = self._registration.sure(self._registration.register(model, [frame])[0])
            found = frame.T_cam_obj if found is None else model.symmetry.nearest(found, frame.T_cam_obj)
            if _same(found, frame.T_cam_obj):
                settled.append(replace(frame, T_cam_obj=found))
            else:
                contradicting.append(frame)
                self._leave_out(frame, "the other frames place it elsewhere than where it joined them")
        if contradicting:
            self.frames = [frame for frame in self.frames if frame not in contradicting]
            self.model = self._registration.model(self.frames)
        model = self._registration.model(settled)
        if self._explained(model, settled) > self._explained(self.model, self.frames):
            self.frames, self.model = settled, model

    def join(self, frame: PosedFrame) -> bool:
        """A frame whose pose is known. False where it contradicts those that are together, and is left out."""
        for earlier in self.frames:
            denied = self._registration.surface_denied(frame, earlier, self.model.diameter_m)
            if denied > MOST_DENIED:
                self._leave_out(frame, f"{denied:.0%} of its surface and that in {name_of(earlier.frame)} contradict")
                return False
        try:
            model = self._registration.model([*self.frames, frame])
        except OnboardingError as error:
            self._leave_out(frame, str(error))
            return False
        colours = self._colours_found_again(model, [*self.frames, frame])
        for earlier, before, after in zip(self.frames, self._colours, colours, strict=False):
            if after < before - MOST_FADED:
                name, lost = name_of(earlier.frame), "is not found where it was"
                faded = f"agrees with the colours to {after:.2f} instead of {before:.2f}"
                self._leave_out(frame, f"with it, {name} {faded if after else lost}")
                return False
        self.frames, self.model, self._colours = [*self.frames, frame], model, colours
        return True

    def _colours_found_again(self, model: ConceptModel, frames: Sequence[PosedFrame]) -> list[float]:
        """How well the colours of each frame agree with the model's; 0 where it is not found at its own pose."""
        colours = []
        for frame, result in zip(frames, self._registration.register(model, frames), strict=True):
            evidence, pose = result.evidence, result.raw_pose
            here = pose is not None and _same(model.symmetry.nearest(pose, frame.T_cam_obj), frame.T_cam_obj)
            colours.append(evidence.colour if evidence and here else 0.0)
        return colours

    def _explained(self, model: ConceptModel, frames: Sequence[PosedFrame]) -> float:
        """Mean score of the evidence."""
        results = self._registration.register(model, frames)
        return float(np.mean([result.evidence.score if result.evidence else 0.0 for result in results]))

    def _unsure(self, result: TrackResult) -> str:
        if result.raw_pose is None:
            return result.reason
        least = self._registration.least_confidence
        return f"its best pose is right at {result.confidence:.0%} only, {least:.0%} are asked for"

    def _leave_out(self, frame: PosedFrame, reason: str) -> None:
        self.left_out.append(f"{name_of(frame.frame)}: {reason}")


def name_of(frame: Frame) -> str:
    return f"frame {frame.index} of {frame.provenance.source}"


def _same(a: Pose, b: Pose) -> bool:
    return a.angle_to_rad(b) < SAME_RAD and a.distance_to_m(b) < SAME_M
