"""Peer `icp`: point-to-plane ICP with Tukey's loss, from the last pose.

The steps between frames may be larger than the object, so there are two starts, the last pose and the last pose shifted
to where the object's middle is seen, and the reach shrinks from most of the diameter to a fortieth; the better fit
counts. Confidence is the fitness: the share of the seen points that lie on the model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from eval.peers.peer_tracker import PeerTracker
from eval.peers.surfaces import Fit, ModelSurface, SeenSurface
from tracker.closest_points import ClosestPointsConfig
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.geometry import Floats, Pose
from tracker.saliency import SaliencyBackend
from tracker.stopwatch import Stopwatch


class IcpConfig(BaseModel):
    """points: of the frame, that take part. steps: iterations, over which the reach shrinks from reach_start to
    reach_end, shares of the diameter. good_fitness: at which the second start is not tried. least_fitness: under which
    there is no pose."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    points: int = Field(default=1000, ge=50)
    steps: int = Field(default=30, ge=1)
    reach_start: float = Field(default=0.8, gt=0)
    reach_end: float = Field(default=0.025, gt=0)
    good_fitness: float = Field(default=0.9, ge=0, le=1)
    least_fitness: float = Field(default=0.5, ge=0, le=1)

    @property
    def closest_points(self) -> ClosestPointsConfig:
        return ClosestPointsConfig(
            cloud_points=self.points, steps=self.steps, reach_start=self.reach_start, reach_end=self.reach_end
        )


class LastPoseIcp:
    """Fulfils `eval.peers.peer_tracker.PoseEstimator`."""

    def __init__(self, model: ConceptModel, config: IcpConfig) -> None:
        self._model, self._config, self._surface = model, config, ModelSurface(model, config.closest_points)

    def __call__(self, seen: SeenSurface, T_last: Pose | None, clock: Stopwatch) -> Fit | str:
        if T_last is None:
            return "no pose to start from was given"
        with clock("icp"):
            best = self.best(T_last, seen)
        if best is None or best.fitness < self._config.least_fitness:
            return f"poor fit: {best.fitness if best else 0:.2f} of the seen points lie on the model"
        return best

    def best(self, T_last: Pose, seen: SeenSurface) -> Fit | None:
        """The better fit of the two starts, None where neither is near the model."""
        best = None
        for T_start in self._starts(T_last, seen.points):
            fit = self._surface.icp(T_start, seen)
            if fit is not None and (best is None or fit.fitness > best.fitness):
                best = fit
            if best is not None and best.fitness > self._config.good_fitness:
                break
        return best

    def _starts(self, T_last: Pose, points: Floats) -> Iterator[Pose]:
        yield T_last
        model_points = T_last @ self._model.points
        facing = ((self._model.normals @ T_last.rotation.T) * model_points).sum(axis=1) < 0
        if facing.any():
            shift_m = np.median(points, axis=0) - np.median(model_points[facing], axis=0)
            yield Pose(T_last.rotation, T_last.translation_m + shift_m)


def open_icp(models: Sequence[ConceptModel], config: TrackerConfig, backend: SaliencyBackend) -> PeerTracker:  # noqa: ARG001
    return PeerTracker(models, config, lambda model: LastPoseIcp(model, IcpConfig()))
