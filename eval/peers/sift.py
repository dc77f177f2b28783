"""Peer `sift`: SIFT features with depth, matched to every reference view, RANSAC, ICP. Every frame anew.

opencv's SIFT in the mask's box, enlarged, as objects are small; matches by the ratio test within each reference view;
open3d's RANSAC over their 3D points (three points, point to point, edge lengths checked) with a least-squares fit to
its inliers; then point-to-plane ICP, which counts where no fewer matches agree with it than before, or the surface lay
off the model. Confidence is the inlier share: of the matches, those whose points meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import open3d as o3d
from pydantic import BaseModel, ConfigDict, Field

from eval.peers.peer_tracker import PeerTracker
from eval.peers.surfaces import Fit, ModelSurface, SeenSurface
from tracker.closest_points import ClosestPointsConfig
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame, Mask
from tracker.geometry import Floats, Pose
from tracker.saliency import SaliencyBackend
from tracker.stopwatch import Stopwatch
from tracker.view import Float32s, bounding_box

registration = o3d.pipelines.registration


class SiftConfig(BaseModel):
    """enlarged_px, largest_scale: pictures whose box is smaller than this are enlarged to it, at most so many times.
    contrast: SIFT's threshold. ratio: Lowe's. threshold_share: distance at which matched points meet, as a share of
    the diameter, at least threshold_m. iterations, confidence: of RANSAC. edge_similarity: of its edge check.
    least_matches, least_inliers: fewer are no pose. icp_steps, icp_reach_start, icp_reach_end: of the polish, shares of
    the diameter. least_fitness: of the seen points that have to lie on the model afterwards. lying: a surface of which
    so much less lies on the model before the polish was off it. seed: of RANSAC."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    enlarged_px: int = Field(default=400, ge=1)
    largest_scale: int = Field(default=4, ge=1)
    contrast: float = Field(default=0.01, gt=0)
    ratio: float = Field(default=0.9, gt=0, le=1)
    threshold_share: float = Field(default=0.025, gt=0)
    threshold_m: float = Field(default=0.003, gt=0)
    iterations: int = Field(default=20_000, ge=1)
    confidence: float = Field(default=0.999, gt=0, le=1)
    edge_similarity: float = Field(default=0.8, ge=0, le=1)
    least_matches: int = Field(default=3, ge=3)
    least_inliers: int = Field(default=3, ge=3)
    icp_steps: int = Field(default=8, ge=0)
    icp_reach_start: float = Field(default=0.06, gt=0)
    icp_reach_end: float = Field(default=0.025, gt=0)
    least_fitness: float = Field(default=0.1, ge=0, le=1)
    lying: float = Field(default=0.02, ge=0, le=1)
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """descriptors: (N, 128). points: (N, 3) camera coordinates, metres."""

    descriptors: Float32s
    points: Floats


class SiftFeatures:
    def __init__(self, config: SiftConfig) -> None:
        opencv: Any = cv2  # its stubs lack SIFT
        self._config, self._sift = config, opencv.SIFT_create(contrastThreshold=config.contrast)

    def __call__(self, frame: Frame, mask: Mask) -> Features:
        """Of the masked pixels that have depth."""
        nothing = Features(np.zeros((0, 128), np.float32), np.zeros((0, 3)))
        box = bounding_box(mask)
        if box is None:
            return nothing
        place = (slice(box.y0, box.y1), slice(box.x0, box.x1))
        grey, inside = cv2.cvtColor(frame.rgb[place], cv2.COLOR_RGB2GRAY), mask[place]
        grey = np.where(inside, grey, np.uint8(grey[inside].mean()))  # the background is another in every view
        scale = min(self._config.largest_scale, max(1.0, self._config.enlarged_px / max(grey.shape)))
        size = (round(grey.shape[1] * scale), round(grey.shape[0] * scale))
        large = cv2.resize(grey, size, interpolation=cv2.INTER_CUBIC)
        wanted = cv2.resize(inside.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        found, descriptors = self._sift.detectAndCompute(large, wanted)
        if descriptors is None:
            return nothing
        at = (np.array([k.pt for k in found]) + 0.5) * (grey.shape[1] / size[0], grey.shape[0] / size[1]) - 0.5
        at += (box.x0, box.y0)
        columns, rows = np.rint(at).astype(np.intp).T
        rows, columns = rows.clip(0, mask.shape[0] - 1), columns.clip(0, mask.shape[1] - 1)
        depth_m = np.where(mask, frame.depth_m, 0)[rows, columns].astype(np.float64)
        kept = depth_m > 0
        points = frame.intrinsics.unproject(at[kept, 0], at[kept, 1], depth_m[kept])
        return Features(descriptors[kept], points)


class SiftPose:
    """Fulfils `eval.peers.peer_tracker.PoseEstimator`."""

    def __init__(self, model: ConceptModel, config: SiftConfig) -> None:
        self._config, self._features = config, SiftFeatures(config)
        self._threshold_m = max(config.threshold_share * model.diameter_m, config.threshold_m)
        views = [(view.T_cam_obj.inverse(), self._features(view.frame, view.mask)) for view in model.references]
        self._views = [Features(f.descriptors, T_obj_cam @ f.points) for T_obj_cam, f in views]
        polish = ClosestPointsConfig(
            steps=config.icp_steps, reach_start=config.icp_reach_start, reach_end=config.icp_reach_end
        )
        self._surface = ModelSurface(model, polish)

    def __call__(self, seen: SeenSurface, T_last: Pose | None, clock: Stopwatch) -> Fit | str:  # noqa: ARG002
        config = self._config
        with clock("features"):
            features = self._features(seen.frame, seen.mask)
        with clock("matching"):
            points, model_points = self._matched(features)
        if len(points) < config.least_matches:
            return f"too few features: {len(points)} of {len(features.points)} match, {config.least_matches} are needed"
        with clock("registration"):
            found = self._registered(points, model_points)
        if found is None:
            return f"too few features agree on a pose: {config.least_inliers} of {len(points)} matches are needed"
        with clock("icp"):
            polished = self._surface.icp(found.T_cam_obj, seen)
        if polished is None or polished.fitness < config.least_fitness:
            return f"poor fit: {polished.fitness if polished else 0:.2f} of the seen points lie on the model"
        lay = self._surface.fitness(found.T_cam_obj, seen) > polished.fitness - config.lying
        if lay and self._agreeing(polished.T_cam_obj, points, model_points) < found.fitness:
            return found  # the surface slides in itself, as a can's does, and the print knows better
        return Fit(polished.T_cam_obj, found.fitness)

    def _matched(self, features: Features) -> tuple[Floats, Floats]:
        """Points (M, 3) of the frame and of the model, a pair a match."""
        matcher = cv2.BFMatcher(cv2.NORM_L2)
        points: list[Floats] = [np.zeros((0, 3))]
        model_points: list[Floats] = [np.zeros((0, 3))]
        for view in self._views:
            if len(features.points) == 0 or len(view.points) < 2:
                continue
            pairs = matcher.knnMatch(features.descriptors, view.descriptors, k=2)
            good = [first for first, second in pairs if first.distance < self._config.ratio * second.distance]
            query, train = np.array([(m.queryIdx, m.trainIdx) for m in good], np.intp).reshape(-1, 2).T
            points.append(features.points[query])
            model_points.append(view.points[train])
        return np.concatenate(points), np.concatenate(model_points)

    def _registered(self, points: Floats, model_points: Floats) -> Fit | None:
        """The pose on which most matches agree, None where too few do. Fitness: the share that does."""
        config = self._config
        o3d.utility.random.seed(config.seed)
        model, seen = (o3d.geometry.PointCloud(o3d.utility.Vector3dVector(p)) for p in (model_points, points))
        same = np.stack((np.arange(len(points)),) * 2, axis=1).astype(np.int32)
        estimation = registration.TransformationEstimationPointToPoint(False)
        result = registration.registration_ransac_based_on_correspondence(
            model, seen, o3d.utility.Vector2iVector(same), self._threshold_m, estimation, 3,
            [registration.CorrespondenceCheckerBasedOnEdgeLength(config.edge_similarity)],
            registration.RANSACConvergenceCriteria(config.iterations, config.confidence),
        )  # fmt: skip
        T_cam_obj = Pose.from_matrix(result.transformation)
        inliers = self._meeting(T_cam_obj, points, model_points)
        for _ in range(2):
            if inliers.sum() < config.least_inliers:
                return None
            pairs = o3d.utility.Vector2iVector(same[inliers])
            T_cam_obj = Pose.from_matrix(estimation.compute_transformation(model, seen, pairs))
            inliers = self._meeting(T_cam_obj, points, model_points)
        return Fit(T_cam_obj, float(inliers.mean()))

    def _agreeing(self, T_cam_obj: Pose, points: Floats, model_points: Floats) -> float:
        return float(self._meeting(T_cam_obj, points, model_points).mean())

    def _meeting(self, T_cam_obj: Pose, points: Floats, model_points: Floats) -> npt.NDArray[np.bool_]:
        return np.linalg.norm(T_cam_obj @ model_points - points, axis=1) < self._threshold_m


def open_sift(models: Sequence[ConceptModel], config: TrackerConfig, backend: SaliencyBackend) -> PeerTracker:  # noqa: ARG001
    return PeerTracker(models, config, lambda model: SiftPose(model, SiftConfig()))
