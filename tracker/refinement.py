"""Fine refinement: every model point meets the pixel that it projects to, in depth and in colour.

Depth counts by point-to-plane distance. Colour holds what geometry leaves free: a can's turn about its axis, a box's
slide along its face. Gauss-Newton on the picture's own gradients, smoothed first, then fine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from tracker.appearance import Smoothed, ViewAppearance, model_appearance
from tracker.concept import ConceptModel
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.least_squares import MotionEquations, free_directions, moved, tukey
from tracker.projection import interpolate, nearest_pixels, project
from tracker.symmetry import Symmetry
from tracker.view import Float32s, ObjectView

LEAST_POINTS = 20  # fewer do not carry six degrees of freedom
FACING_LEAST = 0.15  # cosine: more grazing surfaces have no depth and no colour worth using
PLAIN_VARIANCE = 20.0  # squared Lab units: a surface of less contrast than this has no gain to be seen
GAIN_RANGE = (0.6, 1.6)


class RefinementConfig(BaseModel):
    """model_points: how many take part. coarse_steps, fine_steps: iterations on smoothed and on fine colours, at most.
    coarse_settled_px, fine_settled_px: a step that moves the object by less, in view pixels, is the last one of these.
    settling_steps, settled_px: the same, on fine colours, of a pose that was found from scratch: what is followed goes
    on in the next frame.
    depth_sigma_m: noise of the pooled depth; it is taken to be depth_sigma_coarse times that in the coarse steps.
    lab_sigma: least noise assumed in colour. colour_weight: of the colour terms against the depth term.
    offset_information: how surely colour and depth are registered, in inverse squared view pixels."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    model_points: int = Field(default=1000, ge=50)
    coarse_steps: int = Field(default=4, ge=0)
    fine_steps: int = Field(default=8, ge=1)
    coarse_settled_px: float = Field(default=0.5, ge=0)
    fine_settled_px: float = Field(default=0.1, ge=0)
    settling_steps: int = Field(default=30, ge=1)
    settled_px: float = Field(default=0.02, ge=0)
    depth_sigma_m: float = Field(default=0.0015, gt=0)
    depth_sigma_coarse: float = Field(default=2.0, ge=1)
    lab_sigma: float = Field(default=2.0, gt=0)
    colour_weight: float = Field(default=1.0, ge=0)
    offset_information: float = Field(default=30.0, ge=0)


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """information: (6, 6) inverse covariance of (turn, radians; shift, metres) in camera axes about the object's
    origin, as far as noise makes it: biases of the camera and of the model come on top. free: (k, 6) motions that the
    data leave free, see `free_directions`: there the pose is where the search began. residual_m: median distance of the
    aligned pixels to the model's surface. aligned: how many model points met their pixel."""

    T_cam_obj: Pose
    information: Floats
    free: Floats
    residual_m: float
    aligned: int

    def nearest(self, to: Pose, symmetry: Symmetry) -> Refined:
        """The same result at the equivalent pose nearest to another one."""
        pose = symmetry.nearest(self.T_cam_obj, to)
        if pose is self.T_cam_obj:
            return self
        # A turn w and a shift v about the new origin are, about the old one at d from it, w and v + w x d.
        d_m, carried = self.T_cam_obj.translation_m - pose.translation_m, np.eye(6)
        carried[3:, :3] = np.cross(np.eye(3), d_m).T
        information, free = carried.T @ self.information @ carried, self.free @ np.linalg.inv(carried).T
        return replace(self, T_cam_obj=pose, information=information, free=free)


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    """lab: (3, N) of the points that are aligned, fine or smoothed. sigma_m: of depth. settled_m: see
    `RefinementConfig`."""

    lab: Floats
    fine: bool
    steps: int
    sigma_m: float
    settled_m: float


@dataclass(frozen=True, slots=True, eq=False)
class _Linearised:
    matrix: Floats
    vector: Floats
    residuals_m: Floats


class Refiner:
    """Holds the sample of a model's points that is aligned, and their colours."""

    def __init__(self, model: ConceptModel, config: RefinementConfig, pixels_across: int) -> None:
        self._config, self._radius_m = config, model.diameter_m / 2
        appearance = model_appearance(model, pixels_across)
        chosen = np.random.default_rng(0).permutation(len(model))[: config.model_points]
        self._points, self._normals = model.points[chosen], model.normals[chosen]
        coarse, fine = (np.ascontiguousarray(lab[chosen].T, np.float32) for lab in (appearance.coarse, appearance.fine))
        sigma_m, pixel_m = config.depth_sigma_m, model.diameter_m / pixels_across
        smoothed_sigma_m = config.depth_sigma_coarse * sigma_m
        self._levels = (
            _Level(coarse, False, config.coarse_steps, smoothed_sigma_m, config.coarse_settled_px * pixel_m),
            _Level(fine, True, config.fine_steps, sigma_m, config.fine_settled_px * pixel_m),
        )
        self._last = _Level(fine, True, config.settling_steps, sigma_m, config.settled_px * pixel_m)

    def __call__(self, T_cam_obj: Pose, view: ObjectView, appearance: ViewAppearance) -> Refined | None:
        """None where too few model points meet the object's pixels."""
        return self._descended(T_cam_obj, self._levels, view, appearance)

    def settled(self, T_cam_obj: Pose, view: ObjectView, appearance: ViewAppearance) -> Refined | None:
        """The same to the end, of a refined pose, so that what it comes to hardly depends on where the search began."""
        return self._descended(T_cam_obj, (self._last,), view, appearance)

    def _descended(
        self, T_cam_obj: Pose, levels: Sequence[_Level], view: ObjectView, appearance: ViewAppearance
    ) -> Refined | None:
        linear = None
        for level in levels:
            colours = appearance.fine if level.fine else appearance.coarse
            for _ in range(level.steps):
                linear = self._linearise(T_cam_obj, view, colours, level)
                if linear is None:
                    return None
                before, T_cam_obj = T_cam_obj, moved(T_cam_obj, linear.matrix, linear.vector)
                moved_m = T_cam_obj.distance_to_m(before) + T_cam_obj.angle_to_rad(before) * self._radius_m
                if moved_m < level.settled_m:
                    break
        if linear is None:
            return None
        free = free_directions(linear.matrix, self._radius_m)
        residual_m = float(np.median(np.abs(linear.residuals_m)))
        return Refined(T_cam_obj, linear.matrix, free, residual_m, len(linear.residuals_m))

    def _linearise(self, T_cam_obj: Pose, view: ObjectView, colours: Smoothed, level: _Level) -> _Linearised | None:
        at = project(self._points, self._normals, T_cam_obj, view.camera)
        usable = np.flatnonzero(at.within(view.camera, 2) & (at.facing > FACING_LEAST))
        rows, columns = (pixels[usable] for pixels in nearest_pixels(at, view.camera))
        measured_m = view.depth_m[rows, columns].astype(np.float64)
        near = np.abs(measured_m - at.points_cam[usable, 2]) < 6 * level.sigma_m + 0.004
        met = view.has_depth[rows, columns] & near
        usable, rows, columns, measured_m = usable[met], rows[met], columns[met], measured_m[met]
        if len(usable) < LEAST_POINTS:
            return None
        points, normals, facing = at.points_cam[usable], at.normals_cam[usable], at.facing[usable]
        arms = points - T_cam_obj.translation_m
        residual_m = ((view.camera.unproject(columns, rows, measured_m) - points) * normals).sum(axis=1)
        equations = MotionEquations()
        equations.add(arms, normals, residual_m, facing * tukey(residual_m, 4 * level.sigma_m) / level.sigma_m**2)

        seen = np.ascontiguousarray(interpolate(colours.lab, at.columns[usable], at.rows[usable]).T)
        gradient = np.ascontiguousarray(colours.gradient[rows, columns].T).reshape(2, 3, -1)
        residual, weights = self._colour_residuals(seen, level.lab[:, usable], facing)
        weighted = weights * gradient
        structure = np.stack([(weighted[i] * gradient[j]).sum(axis=0) for i, j in ((0, 0), (0, 1), (1, 1))])
        pull = (weighted * residual).sum(axis=1)
        equations.add_picture(arms, *_pixels_per_metre(points, view.camera), structure, pull)
        matrix, vector = equations.without_offset(self._config.offset_information)
        return _Linearised(matrix, vector, residual_m)

    def _colour_residuals(self, seen: Float32s, expected: Floats, facing: Floats) -> tuple[Floats, Floats]:
        """Residuals (3, N) of the Lab channels and their weights, after each channel's gain and offset between model
        and picture are taken off: they are exposure and white balance. Robust by Geman and McClure's function."""
        facing = facing.astype(np.float32)
        robust, residual, sigma = facing * np.ones_like(seen), expected - seen, np.ones_like(seen[:, :1])
        for _ in range(2):
            share = robust / (robust.sum(axis=1, keepdims=True) + 1e-9)
            mean_seen = np.vecdot(share, seen)[:, None]
            centred = expected - np.vecdot(share, expected)[:, None]
            leaning = share * centred
            variance, together = np.vecdot(leaning, centred), np.vecdot(leaning, seen - mean_seen)
            gain = np.clip((together + PLAIN_VARIANCE) / (variance + PLAIN_VARIANCE), *GAIN_RANGE)[:, None]
            residual = gain * centred + mean_seen - seen
            middle = residual.shape[1] // 4  # of half of them: their median takes the most time here
            spread = np.partition(np.abs(residual[:, ::2]), middle, axis=1)[:, middle : middle + 1]
            sigma = np.maximum(1.4826 * spread, self._config.lab_sigma)
            robust = facing / (1 + (residual / (2 * sigma)) ** 2) ** 2
        return residual, self._config.colour_weight * robust / sigma**2


def _pixels_per_metre(points: Floats, camera: Intrinsics) -> tuple[Floats, Floats]:
    """(N, 3) each: change of a point's column and of its row a metre of its motion."""
    along_columns, along_rows = np.zeros_like(points), np.zeros_like(points)
    x, y, z = points.T
    along_columns[:, 0], along_columns[:, 2] = camera.fx / z, -camera.fx * x / z**2
    along_rows[:, 1], along_rows[:, 2] = camera.fy / z, -camera.fy * y / z**2
    return along_columns, along_rows
