"""A view of an object -> a cloud of points that carry normals, colours and saliency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import small_gicp
from pydantic import BaseModel, ConfigDict, Field

from tracker.geometry import Floats
from tracker.saliency import Saliency
from tracker.view import Float32s, ObjectView

LEAST_POINTS = 50  # fewer say nothing about six degrees of freedom


class CloudConfig(BaseModel):
    """The paper's two-stage outlier removal, and the neighbourhood of a normal.

    outlier_neighbours, outlier_sigmas: a point whose mean distance to its nearest neighbours is that many standard
    deviations above the mean goes. centre_sigmas: so does a point that far from the cloud's centre (the paper's 2.5).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    outlier_neighbours: int = Field(default=8, ge=2, le=64)
    outlier_sigmas: float = Field(default=2.0, gt=0)
    centre_sigmas: float = Field(default=2.5, gt=0)
    normal_neighbours: int = Field(default=16, ge=4, le=128)


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """points: (N, 3) metres. normals: (N, 3) unit, towards the camera. colours: (N, 3) float32 RGB in [0, 255].
    saliency: (N, L) float32 in [0, 1], a value a concept, before the softmax. In camera coordinates."""

    points: Floats
    normals: Floats
    colours: Float32s
    saliency: Float32s

    def __len__(self) -> int:
        return len(self.points)


def lift(view: ObjectView, saliency: Saliency, config: CloudConfig) -> PointCloud:
    """Back-project every pixel of the view that has depth, without the outliers. May be empty."""
    rows, columns = np.nonzero(view.has_depth)
    points = view.points()
    kept = inliers(points, config)
    points, rows, columns = points[kept], rows[kept], columns[kept]
    block = (view.box.x1 - view.box.x0) / view.camera.width
    at = (view.box.x0 + (columns + 0.5) * block - 0.5, view.box.y0 + (rows + 0.5) * block - 0.5)
    return PointCloud(points, normals_of(points, config), view.rgb[rows, columns], saliency.sample(*at))


def inliers(points: Floats, config: CloudConfig) -> npt.NDArray[np.bool_]:
    """(N,) bool, the points that survive both stages. None do where there are too few to judge."""
    if len(points) < LEAST_POINTS:
        return np.zeros(len(points), bool)
    neighbours = min(config.outlier_neighbours, len(points) - 1)
    _, squared = small_gicp.KdTree(points).batch_knn_search(points, neighbours + 1)
    spacing = np.sqrt(np.asarray(squared)[:, 1:]).mean(axis=1)
    kept = spacing <= spacing.mean() + config.outlier_sigmas * spacing.std()
    radius = np.linalg.norm(points - np.median(points[kept], axis=0), axis=1)
    return kept & (radius <= radius[kept].mean() + config.centre_sigmas * radius[kept].std())


def normals_of(points: Floats, config: CloudConfig) -> Floats:
    """(N, 3) unit normals by the principal axes of every point's neighbours, turned towards the camera's origin."""
    if len(points) < config.normal_neighbours:
        return np.zeros((0, 3)) if len(points) == 0 else -points / np.linalg.norm(points, axis=1, keepdims=True)
    cloud = small_gicp.PointCloud(points)
    small_gicp.estimate_normals(cloud, num_neighbors=config.normal_neighbours)
    normals = np.array(cloud.normals()[:, :3])
    normals[(normals * points).sum(axis=1) > 0] *= -1
    return normals
