"""What the peers share: the surface that a frame shows of an object, how it is laid onto a model, how well it lies.

The surface is seen at the resolution of the tracker's own view, without the same outliers, so that no method sees more
of a frame than another. The ICP is the tracker's own (`tracker.closest_points`: point to plane, Tukey's weights of
shrinking reach, pairs whose normals agree, damped, so that it keeps still what geometry leaves free). In the place of
open3d's registration_icp with the same loss and reaches, it scores some tenths of a point more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import open3d as o3d
from scipy.spatial import KDTree

from tracker.closest_points import SAME_SIDE, ClosestPoints, ClosestPointsConfig
from tracker.cloud import LEAST_POINTS, PointCloud, inliers, normals_of
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame, Mask
from tracker.geometry import Floats, Pose
from tracker.view import Float32s, view_object

LIES_ON = 0.025  # of the diameter: a seen point as near to a point of the model lies on it


@dataclass(frozen=True, slots=True, eq=False)
class SeenSurface:
    """Of an object in a frame. points: (N, 3) camera coordinates, metres. normals: (N, 3) unit, towards the camera.
    colours: (N, 3) float32 RGB in [0, 255]. frame, mask: where it is from."""

    points: Floats
    normals: Floats
    colours: Float32s
    frame: Frame
    mask: Mask

    def cloud(self) -> o3d.geometry.PointCloud:
        return open3d_cloud(self.points, self.normals, self.colours)


def see_surface(frame: Frame, model: ConceptModel, config: TrackerConfig) -> SeenSurface | str:
    """What a frame shows of an object, or the reason why that is not enough."""
    mask = frame.masks.get(model.object_id)
    if mask is None:
        return f"no mask of object {model.object_id!r} was given"
    if not mask.any():
        return "out of view: the mask is empty"
    view = view_object(frame, mask, model.diameter_m, config.view)
    if view is None:
        return "no depth within the mask"
    points = view.points()
    kept = inliers(points, config.cloud)
    if kept.sum() < LEAST_POINTS:
        return f"too little to see: {kept.sum()} usable points, {LEAST_POINTS} are needed"
    rows, columns = np.nonzero(view.has_depth)
    points = points[kept]
    return SeenSurface(points, normals_of(points, config.cloud), view.rgb[rows[kept], columns[kept]], frame, mask)


def open3d_cloud(points: Floats, normals: Floats, colours: Float32s) -> o3d.geometry.PointCloud:
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    cloud.colors = o3d.utility.Vector3dVector(colours.astype(np.float64) / 255)
    return cloud


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """fitness: in [0, 1], higher is better; each peer says of what it is the share."""

    T_cam_obj: Pose
    fitness: float


class ModelSurface:
    """A model's points and what lies on them."""

    def __init__(self, model: ConceptModel, icp: ClosestPointsConfig) -> None:
        self._model, self._closest, self._tree = model, ClosestPoints(model, icp), KDTree(model.points)

    def icp(self, T_start: Pose, seen: SeenSurface) -> Fit | None:
        """The pose after point-to-plane ICP and its fitness, None where too few points of the two are near."""
        no_concepts = np.zeros((len(seen.points), 0), np.float32)
        aligned = self._closest.align(T_start, PointCloud(seen.points, seen.normals, seen.colours, no_concepts))
        return None if aligned is None else Fit(aligned, self.fitness(aligned, seen))

    def fitness(self, T_cam_obj: Pose, seen: SeenSurface) -> float:
        """Share of the seen points that lie on a point of the model whose normal agrees."""
        distance_m, nearest = self._tree.query(T_cam_obj.inverse() @ seen.points)
        cosine = ((self._model.normals[nearest] @ T_cam_obj.rotation.T) * seen.normals).sum(axis=1)
        return float(np.mean((distance_m < LIES_ON * self._model.diameter_m) & (cosine > SAME_SIDE)))
