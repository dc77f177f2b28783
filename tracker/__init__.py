"""Few-shot 6-DoF object tracking in RGB-D video by named concepts.

Metres, radians, nanoseconds, RGB; `points_cam = T_cam_obj @ points_obj`. The names below are the public ones; they are
loaded when they are first used, so that `import tracker` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tracker.concept import ConceptModel
    from tracker.config import TrackerConfig, read_config
    from tracker.errors import TrackerError
    from tracker.frame import Frame, PosedFrame
    from tracker.geometry import Intrinsics, Pose
    from tracker.pipeline import ObjectTracker
    from tracker.pointing import Click
    from tracker.result import TrackResult, TrackState
    from tracker.saliency import open_backend
    from tracker.sources import open_source
    from tracker.view import Box

_HOME = {
    "Box": "tracker.view",
    "Click": "tracker.pointing",
    "ConceptModel": "tracker.concept",
    "Frame": "tracker.frame",
    "Intrinsics": "tracker.geometry",
    "ObjectTracker": "tracker.pipeline",
    "Pose": "tracker.geometry",
    "PosedFrame": "tracker.frame",
    "TrackResult": "tracker.result",
    "TrackState": "tracker.result",
    "TrackerConfig": "tracker.config",
    "TrackerError": "tracker.errors",
    "open_backend": "tracker.saliency",
    "open_source": "tracker.sources",
    "read_config": "tracker.config",
}

__all__ = [
    "Box",
    "Click",
    "ConceptModel",
    "Frame",
    "Intrinsics",
    "ObjectTracker",
    "Pose",
    "PosedFrame",
    "TrackResult",
    "TrackState",
    "TrackerConfig",
    "TrackerError",
    "open_backend",
    "open_source",
    "read_config",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'tracker' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
