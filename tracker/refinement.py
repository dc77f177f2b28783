"""A rough pose -> a fine one with its information matrix.

Two stages of iteratively reweighted least squares, both on surfaces and colours that were lifted from the picture:
closest points first, which pulls from afar; then direct alignment, in which every model point meets the pixel that it
projects to, in depth (point to plane) and in colour. Colour holds what geometry leaves free: a can's turn about its
axis, a box's slide along its face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import small_gicp
from pydantic import BaseModel, ConfigDict, Field
from scipy.spatial.transform import Rotation

from tracker.appearance import ModelAppearance, ViewAppearance, model_appearance
from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.geometry import Floats, Pose
from tracker.matching import Correspondences
from tracker.projection import interpolate, nearest_pixels, project
from tracker.view import ObjectView

LEAST_POINTS = 20  # of either stage; fewer do not carry six degrees of freedom
FACING_LEAST = 0.15  # cosine: more grazing surfaces have no depth and no colour worth using


class RefinementConfig(BaseModel):
    """cloud_points, model_points: how many take part in the two stages. closest_steps: iterations of the first;
    reach_start, reach_end: distance at which a closest point stops counting, as shares of the diameter.
    direct_coarse, direct_fine: iterations of the second on smoothed and on fine colours. depth_sigma_m: noise of the
    pooled depth at the end, at the start it is depth_sigma_start times that. lab_sigma: least noise assumed in colour.
    colour_weight: of the colour terms against the depth term. correlation: share of the residuals that are independent
    of one another, which scales the information matrix."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cloud_points: int = Field(700, ge=50)
    model_points: int = Field(1000, ge=50)
    closest_steps: int = Field(8, ge=0)
    reach_start: float = Field(0.12, gt=0)
    reach_end: float = Field(0.04, gt=0)
    direct_coarse: int = Field(4, ge=0)
    direct_fine: int = Field(4, ge=1)
    depth_sigma_m: float = Field(0.0015, gt=0)
    depth_sigma_start: float = Field(2.7, ge=1)
    lab_sigma: float = Field(2.0, gt=0)
    colour_weight: float = Field(1.0, ge=0)
    correlation: float = Field(0.05, gt=0, le=1)


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """information: (6, 6) inverse covariance of (rotation vector about the object's origin in camera axes, radians;
    translation, metres). residual_m: median distance of the aligned pixels to the model's surface. aligned: how many
    model points met their pixel."""

    T_cam_obj: Pose
    information: Floats
    residual_m: float
    aligned: int


class Refiner:
    """Holds what refinement needs of a model: a tree of its points and the colours to align by."""

    def __init__(self, model: ConceptModel, config: RefinementConfig, pixels_across: int) -> None:
        self._config, self._model = config, model
        self._tree = small_gicp.KdTree(model.points)
        appearance = model_appearance(model, pixels_across)
        chosen = np.random.default_rng(0).permutation(len(model))[: config.model_points]
        self._points, self._normals = model.points[chosen], model.normals[chosen]
        self._appearance = ModelAppearance((appearance.lab[0][chosen], appearance.lab[1][chosen]))

    def __call__(
        self, T_start: Pose, cloud: PointCloud, view: ObjectView, appearance: ViewAppearance
    ) -> Refined | None:
        """None where too few model points meet the object's pixels."""
        T_cam_obj = self.closest_points(T_start, cloud)
        return None if T_cam_obj is None else self._direct(T_cam_obj, view, appearance)

    def pull(self, T_cam_obj: Pose, correspondences: Correspondences, cloud: PointCloud) -> Pose:
        """Move a pose by the concept correspondences near it: point-to-point, reweighted, with shrinking reach."""
        points = cloud.points[correspondences.query_index]
        model_points = self._model.points[correspondences.model_index]
        normals, model_normals = (
            cloud.normals[correspondences.query_index],
            self._model.normals[correspondences.model_index],
        )
        for reach_m in np.geomspace(0.3, 0.06, 6) * self._model.diameter_m:
            arms = model_points @ T_cam_obj.rotation.T
            residual_m = points - arms - T_cam_obj.translation_m
            same_side = np.einsum("ni,ni->n", model_normals @ T_cam_obj.rotation.T, normals) > 0.3
            weights = same_side * _tukey(np.linalg.norm(residual_m, axis=1), reach_m)
            if np.count_nonzero(weights) < LEAST_POINTS:
                return T_cam_obj
            c, d = np.average(arms, axis=0, weights=weights), np.average(points, axis=0, weights=weights)
            u, _, vt = np.linalg.svd((weights[:, None] * (points - d)).T @ (arms - c))
            turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
            T_cam_obj = Pose(turn @ T_cam_obj.rotation, d - turn @ c)
        return T_cam_obj

    def closest_points(self, T_cam_obj: Pose, cloud: PointCloud) -> Pose | None:
        """Point-to-plane ICP from the cloud to the model, with Tukey weights of shrinking reach."""
        step = max(1, len(cloud) // self._config.cloud_points)
        points, normals = cloud.points[::step], cloud.normals[::step]
        reaches = np.geomspace(self._config.reach_start, self._config.reach_end, self._config.closest_steps)
        for reach_m in reaches * self._model.diameter_m:
            points_obj = (points - T_cam_obj.translation_m) @ T_cam_obj.rotation
            nearest, squared = self._tree.batch_nearest_neighbor_search(points_obj)
            nearest, distance_m = np.asarray(nearest, np.intp), np.sqrt(np.asarray(squared))
            model_normals = self._model.normals[nearest] @ T_cam_obj.rotation.T
            arms = self._model.points[nearest] @ T_cam_obj.rotation.T
            residual_m = ((points - arms - T_cam_obj.translation_m) * model_normals).sum(axis=1)
            same_side = (model_normals * normals).sum(axis=1) > 0.3
            weights = same_side * _tukey(distance_m, 2 * reach_m) * _tukey(residual_m, reach_m)
            if np.count_nonzero(weights) < LEAST_POINTS:
                return None
            normal_equations = _Normal()
            normal_equations.add(arms, model_normals, residual_m, weights)
            T_cam_obj = normal_equations.step(T_cam_obj)
        return T_cam_obj

    def _direct(self, T_cam_obj: Pose, view: ObjectView, appearance: ViewAppearance) -> Refined | None:
        config = self._config
        sigmas = np.geomspace(config.depth_sigma_start, 1, config.direct_coarse + config.direct_fine)
        levels = (1,) * config.direct_coarse + (0,) * config.direct_fine
        aligned = None
        for sigma_m, level in zip(sigmas * config.depth_sigma_m, levels, strict=True):
            aligned = self._align(T_cam_obj, view, appearance, float(sigma_m), level)
            if aligned is None:
                return None
            T_cam_obj = aligned.normal.step(T_cam_obj)
        assert aligned is not None  # direct_fine is at least 1
        return Refined(T_cam_obj, aligned.normal.matrix * config.correlation, aligned.residual_m, aligned.count)

    def _align(
        self, T_cam_obj: Pose, view: ObjectView, appearance: ViewAppearance, sigma_m: float, level: int
    ) -> _Aligned | None:
        """One linearisation: model points against the pixels that they project to."""
        at = project(self._points, self._normals, T_cam_obj, view.camera)
        usable = np.flatnonzero(at.within(view.camera, 2) & (at.facing > FACING_LEAST))
        rows, columns = (pixels[usable] for pixels in nearest_pixels(at, view.camera))
        measured_m = view.depth_m[rows, columns]
        gap_m = measured_m - at.points_cam[usable, 2]
        met = view.has_depth[rows, columns] & (np.abs(gap_m) < 6 * sigma_m + 0.004)
        usable, rows, columns = usable[met], rows[met], columns[met]
        if len(usable) < LEAST_POINTS:
            return None
        points, normals, facing = at.points_cam[usable], at.normals_cam[usable], at.facing[usable]
        arms = points - T_cam_obj.translation_m
        measured = view.camera.unproject(columns, rows, measured_m[met].astype(np.float64))
        residual_m = ((measured - points) * normals).sum(axis=1)
        normal = _Normal()
        normal.add(arms, normals, residual_m, facing * _tukey(residual_m, 4 * sigma_m) / sigma_m**2)
        if self._config.colour_weight > 0:
            lab = interpolate(appearance.lab[level], at.columns[usable], at.rows[usable])
            gradient = interpolate(appearance.gradient[level], at.columns[usable], at.rows[usable])
            expected = self._appearance.lab[level][usable]
            for channel in range(3):
                pull = _pixel_to_point(gradient[:, [channel, channel + 3]], points, view)
                residual, weights = self._colour_residual(lab[:, channel], expected[:, channel], facing)
                normal.add(arms, pull, residual, weights)
        return _Aligned(normal, float(np.median(np.abs(residual_m))), len(usable))

    def _colour_residual(self, seen: Floats, expected: Floats, weights: Floats) -> tuple[Floats, Floats]:
        """Residual (N,) and weights of one channel, after the gain and offset between the two pictures are removed.

        The offset is exposure and white balance; residuals are weighed by Geman and McClure's function.
        """
        robust, sigma, residual = weights, self._config.lab_sigma, expected - seen
        for _ in range(2):
            total = robust.sum() + 1e-9
            mean_seen, mean_expected = (robust * seen).sum() / total, (robust * expected).sum() / total
            variance = (robust * (expected - mean_expected) ** 2).sum() / total
            together = (robust * (expected - mean_expected) * (seen - mean_seen)).sum() / total
            gain = np.clip((together + 20) / (variance + 20), 0.6, 1.6)  # 20: a plain surface has no gain to be seen
            residual = gain * (expected - mean_expected) + mean_seen - seen
            sigma = max(1.4826 * float(np.median(np.abs(residual))), self._config.lab_sigma)
            robust = weights / (1 + (residual / (2 * sigma)) ** 2) ** 2
        return residual, self._config.colour_weight * robust / sigma**2


@dataclass(frozen=True, slots=True, eq=False)
class _Aligned:
    normal: _Normal
    residual_m: float
    count: int


class _Normal:
    """Normal equations of a small motion: rotation about the object's origin in camera axes, then translation."""

    def __init__(self) -> None:
        self.matrix, self._vector = np.zeros((6, 6)), np.zeros(6)

    def add(self, arms: Floats, directions: Floats, residuals: Floats, weights: Floats) -> None:
        """Residuals (N,) that a motion d of the point (object origin + arm) reduces by direction . d. Shapes (N, 3)."""
        jacobian = np.concatenate((np.cross(arms, directions), directions), axis=1)
        weighted = jacobian * weights[:, None]
        self.matrix += weighted.T @ jacobian
        self._vector += weighted.T @ residuals

    def step(self, T_cam_obj: Pose) -> Pose:
        """The pose after the damped least-squares motion. Damping keeps still what the data leave free."""
        scale = np.sqrt(np.maximum(np.diag(self.matrix), 1e-12))
        damped = self.matrix / np.outer(scale, scale) + 1e-3 * np.eye(6)
        motion = np.linalg.solve(damped, self._vector / scale) / scale
        turn = Rotation.from_rotvec(motion[:3]).as_matrix()
        return Pose(turn @ T_cam_obj.rotation, T_cam_obj.translation_m + motion[3:])


def _tukey(residuals: Floats, reach: float) -> Floats:
    """Tukey's biweight, 0 beyond reach."""
    return np.maximum(1 - (residuals / reach) ** 2, 0) ** 2


def _pixel_to_point(gradient: Floats, points: Floats, view: ObjectView) -> Floats:
    """(N, 3) change of a channel a metre of a point's motion, from its change a pixel (N, 2)."""
    along_x = gradient[:, 0] * view.camera.fx / points[:, 2]
    along_y = gradient[:, 1] * view.camera.fy / points[:, 2]
    along_z = -(along_x * points[:, 0] + along_y * points[:, 1]) / points[:, 2]
    return np.stack((along_x, along_y, along_z), axis=1)
