"""What a run said of an object in a frame beside its pose."""

from __future__ import annotations

from dataclasses import dataclass

from tracker.result import TrackResult


@dataclass(frozen=True, slots=True)
class FrameRecord:
    """One object in one image, in values that JSON has.

    state: initialising, tracking or lost. confidence: in [0, 1]. reason: why there is no pose, or how it came about.
    """

    scene_id: int
    image_id: int
    object_id: str
    state: str
    confidence: float
    reason: str

    @classmethod
    def of(cls, scene_id: int, image_id: int, result: TrackResult) -> FrameRecord:
        state, confidence = result.state.value, float(result.confidence)
        return cls(scene_id, image_id, result.object_id, state, confidence, result.reason)
