"""Coarse refinement: the cloud is drawn onto the model's surface, by concepts first or by nearness alone."""

from __future__ import annotations

import numpy as np
import small_gicp
from pydantic import BaseModel, ConfigDict, Field

from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.geometry import Pose
from tracker.least_squares import MotionEquations, moved, tukey
from tracker.matching import Correspondences

LEAST_PAIRS = 20  # fewer do not carry six degrees of freedom
SAME_SIDE = 0.3  # least cosine between the normals of two points that may be the same


class ClosestPointsConfig(BaseModel):
    """cloud_points: how many take part. steps: iterations of ICP; reach_start, reach_end: distance at which a pair
    stops counting, as shares of the diameter, from the first to the last. concept_points, concept_steps,
    concept_reach_start, concept_reach_end: the same for the pull by concepts: where it is known about where the object
    is, a few correspondences say as much as many."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cloud_points: int = Field(default=700, ge=50)
    steps: int = Field(default=8, ge=0)
    reach_start: float = Field(default=0.12, gt=0)
    reach_end: float = Field(default=0.04, gt=0)
    concept_points: int = Field(default=500, ge=50)
    concept_steps: int = Field(default=6, ge=0)
    concept_reach_start: float = Field(default=0.3, gt=0)
    concept_reach_end: float = Field(default=0.06, gt=0)


class ClosestPoints:
    """Holds the tree of a model's points."""

    def __init__(self, model: ConceptModel, config: ClosestPointsConfig) -> None:
        self._config, self._model = config, model
        self._tree = small_gicp.KdTree(model.points)

    def pull(self, T_cam_obj: Pose, correspondences: Correspondences, cloud: PointCloud) -> Pose:
        """Move a pose by the concept correspondences that are near under it, point to point, with shrinking reach."""
        config = self._config
        points, normals = cloud.points[correspondences.query_index], cloud.normals[correspondences.query_index]
        model_points = self._model.points[correspondences.model_index]
        model_normals = self._model.normals[correspondences.model_index]
        reaches = np.geomspace(config.concept_reach_start, config.concept_reach_end, config.concept_steps)
        for reach_m in reaches * self._model.diameter_m:
            arms = model_points @ T_cam_obj.rotation.T
            distance_m = np.linalg.norm(points - arms - T_cam_obj.translation_m, axis=1)
            same_side = ((model_normals @ T_cam_obj.rotation.T) * normals).sum(axis=1) > SAME_SIDE
            weights = same_side * tukey(distance_m, reach_m)
            if np.count_nonzero(weights) < LEAST_PAIRS:
                return T_cam_obj
            arm, point = np.average(arms, axis=0, weights=weights), np.average(points, axis=0, weights=weights)
            u, _, vt = np.linalg.svd((weights[:, None] * (points - point)).T @ (arms - arm))
            turn = u @ np.diag((1.0, 1.0, np.linalg.det(u @ vt))) @ vt  # Umeyama, TPAMI 1991, Eq. 40
            T_cam_obj = Pose(turn @ T_cam_obj.rotation, point - turn @ arm)
        return T_cam_obj

    def align(self, T_cam_obj: Pose, cloud: PointCloud) -> Pose | None:
        """Point-to-plane ICP from the cloud to the model; None where too few points of the two are near.

        Tukey weights of shrinking reach; points whose normals disagree do not pair.
        """
        config = self._config
        step = max(1, len(cloud) // config.cloud_points)
        points, normals = cloud.points[::step], cloud.normals[::step]
        for reach_m in np.geomspace(config.reach_start, config.reach_end, config.steps) * self._model.diameter_m:
            points_obj = (points - T_cam_obj.translation_m) @ T_cam_obj.rotation
            nearest, squared = self._tree.batch_nearest_neighbor_search(points_obj)
            nearest, distance_m = np.asarray(nearest, np.intp), np.sqrt(np.asarray(squared))
            model_normals = self._model.normals[nearest] @ T_cam_obj.rotation.T
            arms = self._model.points[nearest] @ T_cam_obj.rotation.T
            residual_m = ((points - arms - T_cam_obj.translation_m) * model_normals).sum(axis=1)
            same_side = (model_normals * normals).sum(axis=1) > SAME_SIDE
            weights = same_side * tukey(distance_m, 2 * reach_m) * tukey(residual_m, reach_m)
            if np.count_nonzero(weights) < LEAST_PAIRS:
                return None
            equations = MotionEquations()
            equations.add(arms, model_normals, residual_m, weights)
            T_cam_obj = moved(T_cam_obj, *equations.without_offset(0.0))
        return T_cam_obj
