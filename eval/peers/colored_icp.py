"""Peer `colored-icp`: open3d's colored ICP (Park, Zhou, Koltun, Colored Point Cloud Registration Revisited, ICCV 2017)
at several scales, from the last pose.

Its reach is short and steps between frames are large, so point-to-plane ICP comes first, from the same two starts as
the peer `icp`. Then colour and geometry together, from coarse to fine clouds, onto the model's points that face the
camera; the lengths are in diameters, as its balance of colour and geometry is made for scenes of metres. Where that
leaves the surface, the pose before it stands. Confidence is the fitness: the share of the seen points that lie on the
model.
"""

from __future__ import annotations

from collections.abc import Sequence

import open3d as o3d
from pydantic import BaseModel, ConfigDict, Field

from eval.peers.icp import IcpConfig, LastPoseIcp
from eval.peers.peer_tracker import PeerTracker
from eval.peers.surfaces import Fit, ModelSurface, SeenSurface, open3d_cloud
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.geometry import Pose
from tracker.saliency import SaliencyBackend
from tracker.stopwatch import Stopwatch

registration = o3d.pipelines.registration


class ColoredIcpConfig(BaseModel):
    """icp: of the approach. voxels: of the clouds from coarse to fine, and reaches: distances at which a pair stops
    counting, as shares of the diameter. steps: iterations at each. geometric: share of the geometry in what is
    minimised (open3d's lambda). fitness_lost: by how much the fitness may fall. least_fitness: under which there is no
    pose."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    icp: IcpConfig = IcpConfig()
    voxels: tuple[float, ...] = (0.06, 0.03, 0.016)
    reaches: tuple[float, ...] = (0.12, 0.06, 0.03)
    steps: int = Field(default=30, ge=1)
    geometric: float = Field(default=0.95, ge=0, le=1)
    fitness_lost: float = Field(default=0.05, ge=0, le=1)
    least_fitness: float = Field(default=0.5, ge=0, le=1)


class ColoredIcp:
    """Fulfils `eval.peers.peer_tracker.PoseEstimator`."""

    def __init__(self, model: ConceptModel, config: ColoredIcpConfig) -> None:
        self._model, self._config = model, config
        self._approach = LastPoseIcp(model, config.icp)
        self._surface = ModelSurface(model, config.icp.closest_points)

    def __call__(self, seen: SeenSurface, T_last: Pose | None, clock: Stopwatch) -> Fit | str:
        if T_last is None:
            return "no pose to start from was given"
        with clock("icp"):
            near = self._approach.best(T_last, seen)
        if near is None:
            return "poor fit: too few of the seen points are near the model"
        with clock("colored icp"):
            T_cam_obj = self._aligned(near.T_cam_obj, seen)
            fit = None if T_cam_obj is None else Fit(T_cam_obj, self._surface.fitness(T_cam_obj, seen))
        if fit is None or fit.fitness < near.fitness - self._config.fitness_lost:
            fit = near
        if fit.fitness < self._config.least_fitness:
            return f"poor fit: {fit.fitness:.2f} of the seen points lie on the model"
        return fit

    def _aligned(self, T_cam_obj: Pose, seen: SeenSurface) -> Pose | None:
        """None where it went so far that no pair is within reach any more."""
        model, config, diameter_m = self._model, self._config, self._model.diameter_m
        facing = ((model.normals @ T_cam_obj.rotation.T) * (T_cam_obj @ model.points)).sum(axis=1) < 0
        source = open3d_cloud(seen.points / diameter_m, seen.normals, seen.colours)
        target = open3d_cloud(model.points[facing] / diameter_m, model.normals[facing], model.colours[facing])
        moving = T_cam_obj.inverse().matrix
        moving[:3, 3] /= diameter_m
        for voxel, reach in zip(config.voxels, config.reaches, strict=True):
            coarse_source, coarse_target = (cloud.voxel_down_sample(voxel) for cloud in (source, target))
            try:
                found = registration.registration_colored_icp(
                    coarse_source, coarse_target, reach, moving,
                    registration.TransformationEstimationForColoredICP(config.geometric),
                    registration.ICPConvergenceCriteria(1e-6, 1e-6, config.steps),
                )  # fmt: skip
            except RuntimeError as error:
                if "No correspondences" not in str(error):
                    raise
                return None
            moving = found.transformation.copy()
        moving[:3, 3] *= diameter_m
        return Pose.from_matrix(moving).inverse()


def open_colored_icp(
    models: Sequence[ConceptModel],
    config: TrackerConfig,
    backend: SaliencyBackend,  # noqa: ARG001
) -> PeerTracker:
    return PeerTracker(models, config, lambda model: ColoredIcp(model, ColoredIcpConfig()))
