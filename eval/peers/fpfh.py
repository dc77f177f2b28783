"""Peer `fpfh`: open3d's FPFH features, RANSAC over their matches, point-to-plane ICP. Every frame anew.

Frame and model are thinned to 1.5 % of the diameter; mutual nearest features (all nearest ones where few are
mutual); open3d's RANSAC (three points, point to point, edge lengths, distances and normals checked); then the ICP. The
geometry of most objects nearly repeats, so RANSAC runs several times with other seeds and the best fit counts.
Confidence is its fitness: the share of the seen points that lie on the model.
"""

from __future__ import annotations

from collections.abc import Sequence

import open3d as o3d
from pydantic import BaseModel, ConfigDict, Field

from eval.peers.peer_tracker import PeerTracker
from eval.peers.surfaces import Fit, ModelSurface, SeenSurface, open3d_cloud
from tracker.closest_points import ClosestPointsConfig
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.geometry import Pose
from tracker.saliency import SaliencyBackend
from tracker.stopwatch import Stopwatch

registration = o3d.pipelines.registration


class FpfhConfig(BaseModel):
    """voxel: of both clouds, feature_radius: neighbourhood of a feature, threshold: distance at which matched points
    meet, all as shares of the diameter. neighbours: of a feature, at most. mutual: both must be the other's nearest.
    iterations, confidence: of one RANSAC. edge_similarity, normal_rad: of its checks. seeds: of the runs. icp_steps,
    icp_reach_start, icp_reach_end: of the polish, shares of the diameter. good_fitness: at which no other run is tried.
    least_fitness: under which there is no pose."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    voxel: float = Field(default=0.015, gt=0)
    feature_radius: float = Field(default=0.2, gt=0)
    neighbours: int = Field(default=200, ge=3)
    mutual: bool = True
    threshold: float = Field(default=0.04, gt=0)
    iterations: int = Field(default=20_000, ge=1)
    confidence: float = Field(default=0.999, gt=0, le=1)
    edge_similarity: float = Field(default=0.9, ge=0, le=1)
    normal_rad: float = Field(default=0.6, gt=0)
    seeds: tuple[int, ...] = (0, 1, 2)
    icp_steps: int = Field(default=12, ge=0)
    icp_reach_start: float = Field(default=0.12, gt=0)
    icp_reach_end: float = Field(default=0.025, gt=0)
    good_fitness: float = Field(default=0.97, ge=0, le=1)
    least_fitness: float = Field(default=0.1, ge=0, le=1)


class FpfhPose:
    """Fulfils `eval.peers.peer_tracker.PoseEstimator`."""

    def __init__(self, model: ConceptModel, config: FpfhConfig) -> None:
        self._config, self._diameter_m = config, model.diameter_m
        self._model, self._features = self._described(open3d_cloud(model.points, model.normals, model.colours))
        polish = ClosestPointsConfig(
            steps=config.icp_steps, reach_start=config.icp_reach_start, reach_end=config.icp_reach_end
        )
        self._surface = ModelSurface(model, polish)

    def __call__(self, seen: SeenSurface, T_last: Pose | None, clock: Stopwatch) -> Fit | str:  # noqa: ARG002
        with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):  # it prints how many are mutual
            best = self._best(seen, clock)
        if best is None or best.fitness < self._config.least_fitness:
            return f"poor fit: {best.fitness if best else 0:.2f} of the seen points lie on the model"
        return best

    def _best(self, seen: SeenSurface, clock: Stopwatch) -> Fit | None:
        with clock("features"):
            cloud, features = self._described(seen.cloud())
        best = None
        for seed in self._config.seeds:
            with clock("registration"):
                T_start = self._registered(cloud, features, seed)
            with clock("icp"):
                fit = None if T_start is None else self._surface.icp(T_start, seen)
            if fit is not None and (best is None or fit.fitness > best.fitness):
                best = fit
            if best is not None and best.fitness > self._config.good_fitness:
                break
        return best

    def _described(self, cloud: o3d.geometry.PointCloud) -> tuple[o3d.geometry.PointCloud, registration.Feature]:
        config = self._config
        thinned = cloud.voxel_down_sample(config.voxel * self._diameter_m)
        thinned.normalize_normals()
        near = o3d.geometry.KDTreeSearchParamHybrid(config.feature_radius * self._diameter_m, config.neighbours)
        return thinned, registration.compute_fpfh_feature(thinned, near)  # pyright: ignore[reportCallIssue]

    def _registered(self, cloud: o3d.geometry.PointCloud, features: registration.Feature, seed: int) -> Pose | None:
        """T_cam_obj, None where no three matches fit together."""
        config, threshold_m = self._config, self._config.threshold * self._diameter_m
        o3d.utility.random.seed(seed)
        result = registration.registration_ransac_based_on_feature_matching(
            self._model, cloud, self._features, features, config.mutual, threshold_m,
            registration.TransformationEstimationPointToPoint(False), 3,
            [
                registration.CorrespondenceCheckerBasedOnEdgeLength(config.edge_similarity),
                registration.CorrespondenceCheckerBasedOnDistance(threshold_m),
                registration.CorrespondenceCheckerBasedOnNormal(config.normal_rad),
            ],
            registration.RANSACConvergenceCriteria(config.iterations, config.confidence),
        )  # fmt: skip
        return Pose.from_matrix(result.transformation) if len(result.correspondence_set) else None


def open_fpfh(models: Sequence[ConceptModel], config: TrackerConfig, backend: SaliencyBackend) -> PeerTracker:  # noqa: ARG001
    return PeerTracker(models, config, lambda model: FpfhPose(model, FpfhConfig()))
