"""Clouds of single reference views -> the points of one concept model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from tracker.cloud import PointCloud
from tracker.errors import OnboardingError
from tracker.frame import PosedFrame
from tracker.geometry import Floats
from tracker.view import Float32s

MASK_SLACK_PX = 6  # masks are ragged: only what lies farther outside than this counts as outside
DEPTH_SLACK = 0.05  # of the diameter: surfaces nearer than this in depth are the same surface
LEAST_COSINE = 0.1  # of the angle of incidence; flatter views of a point weigh as if at this


@dataclass(frozen=True, slots=True, eq=False)
class FusedPoints:
    """Arrays as in ConceptModel, in object coordinates."""

    points: Floats
    normals: Floats
    colours: Float32s
    saliency: Float32s
    view_count: npt.NDArray[np.int32]
    agreement: Float32s


def diameter_of(points: Floats) -> float:
    """Greatest distance between two of the points (N, 3). Raises OnboardingError where they span no volume."""
    try:
        corners = points[ConvexHull(points).vertices]
    except (QhullError, ValueError) as error:
        raise OnboardingError(f"{len(points)} points of the reference frames span no volume") from error
    return float(max(np.linalg.norm(corners - corner, axis=1).max() for corner in corners))


def confirmed(points_obj: Floats, others: Sequence[PosedFrame], slack_m: float) -> npt.NDArray[np.bool_]:
    """(N,) bool: no other reference frame denies that the point is of the object, or more confirm it than deny it.

    A frame denies a point where it sees the point's surface, or through it, clearly outside its mask, or sees through
    it inside. A frame in which the point is hidden says nothing. So a mask that takes in a piece of the table in one
    frame does no harm where another frame's mask does not.
    """
    votes = np.zeros(len(points_obj), int)
    for other in others:
        camera, depth_m = other.frame.intrinsics, other.frame.depth_m
        points_cam = other.T_cam_obj @ points_obj
        pixels = np.rint(camera.project(points_cam)).astype(int)
        x, y = np.clip(pixels[:, 0], 0, camera.width - 1), np.clip(pixels[:, 1], 0, camera.height - 1)
        seen = (points_cam[:, 2] > 0) & (pixels[:, 0] == x) & (pixels[:, 1] == y) & (depth_m[y, x] > 0)
        behind_m = depth_m[y, x] - points_cam[:, 2]
        near_mask = cv2.dilate(other.mask.astype(np.uint8), np.ones((2 * MASK_SLACK_PX + 1,) * 2, np.uint8)) > 0
        seen_through = seen & (behind_m > slack_m)
        on_surface = seen & (np.abs(behind_m) <= slack_m)
        votes += on_surface & other.mask[y, x]
        votes -= seen_through | (on_surface & ~near_mask[y, x])
    return votes >= 0


def fuse(clouds: Sequence[PointCloud], frames: Sequence[PosedFrame], diameter_m: float, voxel_m: float) -> FusedPoints:
    """Join the views' clouds (camera coordinates), each with the frame that it is from, as means over voxels.

    A point weighs by the cosine of its angle of incidence over its squared distance, as its share of the picture does.
    """
    points, normals, weights, views = [], [], [], []
    kept = []
    for k, (cloud, frame) in enumerate(zip(clouds, frames, strict=True)):
        T_obj_cam = frame.T_cam_obj.inverse()
        distance_m = np.linalg.norm(cloud.points, axis=1)
        cosine = -(cloud.normals * cloud.points).sum(axis=1) / distance_m
        others = [other for j, other in enumerate(frames) if j != k]
        points_obj = T_obj_cam @ cloud.points
        keep = confirmed(points_obj, others, DEPTH_SLACK * diameter_m)
        kept.append(keep)
        points.append(points_obj[keep])
        normals.append(cloud.normals[keep] @ T_obj_cam.rotation.T)
        weights.append((np.maximum(cosine, LEAST_COSINE) / distance_m**2)[keep])
        views.append(np.full(int(keep.sum()), k))
    colours = np.concatenate([cloud.colours[keep] for cloud, keep in zip(clouds, kept, strict=True)])
    saliency = np.concatenate([cloud.saliency[keep] for cloud, keep in zip(clouds, kept, strict=True)])
    return _voxel_means(
        np.concatenate(points), np.concatenate(normals), colours, saliency,
        np.concatenate(weights), np.concatenate(views), voxel_m,
    )  # fmt: skip


def _voxel_means(
    points: Floats, normals: Floats, colours: Float32s, saliency: Float32s, weights: Floats,
    views: npt.NDArray[np.intp], voxel_m: float,
) -> FusedPoints:  # fmt: skip
    cells = np.floor(points / voxel_m).astype(np.int64)
    # Two sides of a thin wall can share a voxel; their normals must not cancel, so the side is part of the key.
    side = (normals[:, [2]] > 0) * 4 + (normals[:, [1]] > 0) * 2 + (normals[:, [0]] > 0)
    thin = np.concatenate((cells, side), axis=1)
    _, voxel = np.unique(thin, axis=0, return_inverse=True)
    voxel = voxel.reshape(-1)
    count = int(voxel.max()) + 1
    total = np.bincount(voxel, weights, count)

    def mean(values: npt.NDArray) -> Floats:
        sums = [np.bincount(voxel, weights * column, count) for column in values.T]
        return np.stack(sums, axis=1) / total[:, None]

    fused_saliency = mean(saliency)
    unit = mean(normals)
    pairs, pair = np.unique(np.stack((voxel, views), axis=1), axis=0, return_inverse=True)
    pair_weight = np.bincount(pair.reshape(-1), weights)
    of_view = np.stack([np.bincount(pair.reshape(-1), weights * column) for column in saliency.T], axis=1)
    of_view /= pair_weight[:, None]
    norms = np.linalg.norm(of_view, axis=1) * np.linalg.norm(fused_saliency[pairs[:, 0]], axis=1)
    cosine = (of_view * fused_saliency[pairs[:, 0]]).sum(axis=1) / np.maximum(norms, 1e-12)
    view_count = np.bincount(pairs[:, 0], minlength=count)
    return FusedPoints(
        points=mean(points),
        normals=unit / np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-12),
        colours=mean(colours).astype(np.float32),
        saliency=fused_saliency.astype(np.float32),
        view_count=view_count.astype(np.int32),
        agreement=(np.bincount(pairs[:, 0], cosine, count) / view_count).clip(0, 1).astype(np.float32),
    )
