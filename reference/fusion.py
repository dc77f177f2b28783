"""Clouds of single reference views -> the points of one concept model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from reference.cross_check import cross_check, others_than
from reference.group_means import GroupMeans
from reference.one_light import in_one_light
from tracker.cloud import PointCloud
from tracker.errors import OnboardingError
from tracker.frame import PosedFrame
from tracker.geometry import Floats
from tracker.view import Float32s

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


def fuse(clouds: Sequence[PointCloud], frames: Sequence[PosedFrame], diameter_m: float, voxel_m: float) -> FusedPoints:
    """Join the views' clouds (camera coordinates), each with the frame that it is from, as means over voxels.

    Points that the other frames deny are left out. A point weighs by the cosine of its angle of incidence over its
    squared distance, as its share of the picture does. Colours are made those of one light first. The voxels stand in
    the first frame's camera, so that the model does not depend on how the object's own axes were chosen.
    """
    slack_m = DEPTH_SLACK * diameter_m
    parts = [_part(cloud, frames, k, slack_m) for k, cloud in enumerate(clouds)]
    points, normals, colours, saliency, weights, views, confirmed = (
        np.concatenate([part[field] for part in parts]) for field in range(7)
    )
    voxel = _voxels(points, normals, voxel_m)
    colours = in_one_light(colours, normals, voxel, views, weights)
    mean = GroupMeans(voxel, weights)
    unit = mean(normals)
    fused = mean(saliency)
    T_obj_ref = frames[0].T_cam_obj.inverse()
    return FusedPoints(
        points=T_obj_ref @ mean(points),
        normals=unit / np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-12) @ T_obj_ref.rotation.T,
        colours=mean(colours).astype(np.float32),
        saliency=fused.astype(np.float32),
        view_count=1 + np.rint(mean(confirmed[:, None])[:, 0]).astype(np.int32),
        agreement=_agreement(voxel, views, weights, saliency, fused).astype(np.float32),
    )


def _part(cloud: PointCloud, frames: Sequence[PosedFrame], k: int, slack_m: float) -> tuple[npt.NDArray, ...]:
    """What view k brings, in the camera coordinates of the first view: points, normals, colours, saliency, weights,
    its number, and how many other views confirm each point."""
    T_obj_cam = frames[k].T_cam_obj.inverse()
    T_ref_cam = frames[0].T_cam_obj @ T_obj_cam
    votes = cross_check(T_obj_cam @ cloud.points, others_than(frames, k), slack_m)
    kept = votes.kept
    points, normals = cloud.points[kept], cloud.normals[kept]
    distance_m = np.linalg.norm(points, axis=1)
    cosine = -(normals * points).sum(axis=1) / distance_m
    return (
        T_ref_cam @ points,
        normals @ T_ref_cam.rotation.T,
        cloud.colours[kept],
        cloud.saliency[kept],
        np.maximum(cosine, LEAST_COSINE) / distance_m**2,
        np.full(len(points), k),
        votes.confirmed[kept],
    )


def _voxels(points: Floats, normals: Floats, voxel_m: float) -> npt.NDArray[np.intp]:
    """(N,) number of the voxel of every point. The two sides of a thin wall have voxels of their own: where they share
    one, their normals would cancel."""
    cells = np.floor(points / voxel_m).astype(np.int64)
    sides = (normals > 0).astype(np.int64)
    return np.unique(np.concatenate((cells, sides), axis=1), axis=0, return_inverse=True)[1].reshape(-1)


def _agreement(
    voxel: npt.NDArray[np.intp], views: npt.NDArray[np.intp], weights: Floats, saliency: Float32s, fused: Floats
) -> Floats:
    """(V,) mean over a voxel's views of the cosine between the view's saliency and the fused one."""
    pairs, pair = np.unique(np.stack((voxel, views), axis=1), axis=0, return_inverse=True)
    of_view, of_voxel = GroupMeans(pair.reshape(-1), weights)(saliency), fused[pairs[:, 0]]
    norms = np.linalg.norm(of_view, axis=1) * np.linalg.norm(of_voxel, axis=1)
    cosine = (of_view * of_voxel).sum(axis=1) / np.maximum(norms, 1e-12)
    return (np.bincount(pairs[:, 0], cosine) / np.bincount(pairs[:, 0])).clip(0, 1)
