"""What happened in each frame of a scenario: the truth of it, and what the tracker said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from eval.reliability import right_within

LEAST_IN_SIGHT, HALF = 0.05, 0.5  # visible fractions: of an object in sight, and of one that a tracker has to find
ASTRAY_M = 0.05
TRACKING = "tracking"


@dataclass(frozen=True, slots=True)
class FrameLog:
    """One frame, in values that JSON has.

    visible: share of the object's silhouette that can be seen, in [0, 1]. has_depth: whether any pixel does. jumped:
    whether object and camera are all at once elsewhere to each other. state, confidence, reason: as in the result.
    error_m, error_deg: of the object's middle, and the least angle over its symmetries; None without a pose.
    sigma_rad, sigma_m: (3,) standard deviations of turn and shift, from the covariance; None without a pose.
    evidence: by name, None without a pose. tracking_ms, rendering_ms: what the frame cost.
    """

    index: int
    visible: float
    has_depth: bool
    jumped: bool
    state: str
    confidence: float
    reason: str
    error_m: float | None = None
    error_deg: float | None = None
    sigma_rad: Sequence[float] | None = None
    sigma_m: Sequence[float] | None = None
    evidence: dict[str, float] | None = None
    tracking_ms: float = 0.0
    rendering_ms: float = 0.0

    @property
    def tracking(self) -> bool:
        return self.state == TRACKING

    @property
    def in_sight(self) -> bool:
        """A twentieth or more of the object can be seen, and depth is measured."""
        return self.has_depth and self.visible >= LEAST_IN_SIGHT

    @property
    def half_in_sight(self) -> bool:
        return self.has_depth and self.visible >= HALF

    @property
    def astray(self) -> bool:
        """A pose is told that is more than 5 cm off."""
        return self.tracking and self.error_m is not None and self.error_m > ASTRAY_M

    @property
    def on_object(self) -> bool:
        """A pose is told, the object is in sight, and the pose is at most 5 cm off."""
        return self.tracking and self.in_sight and not self.astray

    @property
    def right(self) -> bool:
        """Less than 2 cm and 10 degrees off, of an object of which something can be seen, be it in colour alone."""
        if self.error_m is None or self.error_deg is None or self.visible < LEAST_IN_SIGHT:
            return False
        return right_within(self.error_m, self.error_deg)
