"""What a frame tells about an object."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from tracker.geometry import Floats, Pose
from tracker.verification import Evidence


class TrackState(Enum):
    """INITIALISING: not seen yet. TRACKING: the pose is known. LOST: it was, and is not."""

    INITIALISING = "initialising"
    TRACKING = "tracking"
    LOST = "lost"


@dataclass(frozen=True, slots=True, eq=False)
class TrackResult:
    """stamp_ns, object_id: of which frame and object. pose: T_cam_obj after the filter, None unless TRACKING.
    state: see TrackState. confidence: in [0, 1], the share of the model's surface that should be seen and is, in place
    and in colour; 0 without a pose. covariance: (6, 6) of `pose`, of (turn, radians; shift, metres) in camera axes
    about the object's origin. reason: why there is no pose, or how it came about. raw_pose: T_cam_obj of this frame
    alone, before the filter. evidence: what the confidence was judged by. timings_ms: stage -> milliseconds."""

    stamp_ns: int
    object_id: str
    pose: Pose | None
    state: TrackState
    confidence: float
    covariance: Floats | None
    reason: str
    raw_pose: Pose | None
    evidence: Evidence | None
    timings_ms: dict[str, float]
