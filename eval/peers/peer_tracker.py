"""The frame loop of every peer: who sees what, what it says of it, and what state that leaves an object in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from eval.peers.surfaces import Fit, SeenSurface, see_surface
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, FrameError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.result import TrackResult, TrackState
from tracker.stopwatch import Stopwatch


class PoseEstimator(Protocol):
    """A peer's method for one object."""

    def __call__(self, seen: SeenSurface, T_last: Pose | None, clock: Stopwatch) -> Fit | str:
        """The pose in a frame and how well it fits, or the reason why there is none. T_last: the last good T_cam_obj,
        or the one that was told; None before either."""
        ...


@dataclass(slots=True, eq=False)
class _Followed:
    """An object and what is known of it between frames."""

    model: ConceptModel
    estimate: PoseEstimator
    T_last: Pose | None = None
    state: TrackState = TrackState.INITIALISING


class PeerTracker:
    """Fulfils `eval.peers.Method`. A result's confidence is the estimator's fitness; its pose and raw pose are the
    same and have no covariance. A frame without a pose leaves the last good one where it was."""

    def __init__(
        self,
        models: Sequence[ConceptModel],
        config: TrackerConfig,
        estimator: Callable[[ConceptModel], PoseEstimator],
    ) -> None:
        self._config = config
        self._followed = {model.object_id: _Followed(model, estimator(model)) for model in models}
        self._last_stamp_ns = -1

    def place(self, object_id: str, T_cam_obj: Pose, stamp_ns: int) -> None:
        if object_id not in self._followed:
            raise ConfigError(f"there is no model of object {object_id!r}; there are {', '.join(self._followed)}")
        if stamp_ns < self._last_stamp_ns:
            raise FrameError(f"a pose at {stamp_ns} ns is before the last frame, at {self._last_stamp_ns} ns")
        self._followed[object_id].T_last = T_cam_obj

    def step(self, frame: Frame) -> tuple[TrackResult, ...]:
        """Raises FrameError where time does not advance."""
        if frame.stamp_ns <= self._last_stamp_ns:
            raise FrameError(f"a frame at {frame.stamp_ns} ns is not after the last one, at {self._last_stamp_ns} ns")
        self._last_stamp_ns = frame.stamp_ns
        return tuple(self._followed_in(frame, followed) for followed in self._followed.values())

    def _followed_in(self, frame: Frame, followed: _Followed) -> TrackResult:
        clock = Stopwatch()
        with clock("surface"):
            seen = see_surface(frame, followed.model, self._config)
        found = seen if isinstance(seen, str) else followed.estimate(seen, followed.T_last, clock)
        if isinstance(found, str):
            tracked = followed.state is TrackState.TRACKING
            followed.state = TrackState.LOST if tracked else followed.state
        else:
            followed.T_last, followed.state = found.T_cam_obj, TrackState.TRACKING
        pose = None if isinstance(found, str) else found.T_cam_obj
        return TrackResult(
            stamp_ns=frame.stamp_ns,
            object_id=followed.model.object_id,
            pose=pose,
            state=followed.state,
            confidence=0.0 if isinstance(found, str) else found.fitness,
            covariance=None,
            reason=found if isinstance(found, str) else "found",
            raw_pose=pose,
            grounds=None,
            timings_ms=clock.timings_ms(),
        )
