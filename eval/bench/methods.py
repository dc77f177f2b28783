"""Ways from correspondences to a pose: ours, and those of the libraries that are installed (extra bench)."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import torch

from eval.bench.problems import DIAMETER_M, Problem
from tracker.errors import FrameError
from tracker.geometry import Floats, Pose
from tracker.hypotheses import Pairs
from tracker.registration import RegistrationConfig, register_pairs
from tracker.system_libraries import system_libraries_of

Method = Callable[[Problem, int], Pose | None]  # the problem and a seed

THRESHOLD_M = 0.01
SAMPLES = 100_000


def ours(confidence: float, samples: int = SAMPLES) -> Method:
    config = RegistrationConfig(samples=samples, confidence=confidence, threshold_m=THRESHOLD_M, candidates=1)

    def solve(problem: Problem, seed: int) -> Pose | None:
        points, model_points = (torch.from_numpy(p).float() for p in (problem.points_cam, problem.points_obj))
        pairs = Pairs(points, torch.zeros_like(points), model_points, torch.zeros_like(points))
        found = register_pairs(pairs, DIAMETER_M, config, torch.Generator().manual_seed(seed))
        return found[0].T_cam_obj if found else None

    return solve


def open3d_ransac(confidence: float, samples: int = SAMPLES, checkers: bool = True) -> Method:
    """Point to point, three points; edges alike to 0.9 and distances under the threshold where there are checkers."""
    with system_libraries_of("open3d"):
        import open3d as o3d

    reg = o3d.pipelines.registration
    tests = [reg.CorrespondenceCheckerBasedOnEdgeLength(0.9), reg.CorrespondenceCheckerBasedOnDistance(THRESHOLD_M)]

    def solve(problem: Problem, seed: int) -> Pose | None:
        o3d.utility.random.seed(seed)
        source, target, pairs = _clouds(problem)
        found = reg.registration_ransac_based_on_correspondence(
            source, target, pairs, THRESHOLD_M, reg.TransformationEstimationPointToPoint(False), 3,
            tests if checkers else [], reg.RANSACConvergenceCriteria(samples, confidence),
        )  # fmt: skip
        return _pose(found.transformation)

    return solve


def open3d_fgr() -> Method:
    """Fast global registration; its distance is half the threshold, as its authors' examples have it."""
    with system_libraries_of("open3d"):
        import open3d as o3d

    reg = o3d.pipelines.registration
    option = reg.FastGlobalRegistrationOption(maximum_correspondence_distance=THRESHOLD_M / 2)

    def solve(problem: Problem, seed: int) -> Pose | None:  # noqa: ARG001
        return _pose(reg.registration_fgr_based_on_correspondence(*_clouds(problem), option).transformation)

    return solve


def kiss_matcher() -> Method:
    """Its pruning and its solver on the given correspondences; noise bounds of half the threshold. It refuses voxels of
    millimetres, being made for streets: it gets the problem a hundred times as large."""
    import kiss_matcher  # pyright: ignore[reportMissingImports]

    kiss: Any = kiss_matcher
    config = kiss.KISSMatcherConfig(
        voxel_size=100 * THRESHOLD_M / 2, solver_noise_bound_gain=1.0, enable_noise_bound_clamping=False
    )

    def solve(problem: Problem, seed: int) -> Pose | None:  # noqa: ARG001
        source, target = ((100 * p).astype(np.float32) for p in (problem.points_obj, problem.points_cam))
        found = kiss.KISSMatcher(config).prune_and_solve(list(source), list(target))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = found.rotation, np.ravel(found.translation) / 100
        return _pose(matrix)

    return solve


def peers() -> dict[str, Method]:
    """Those that are installed, all but open3d's RANSAC."""
    found = {"open3d FGR": open3d_fgr()}
    if find_spec("kiss_matcher"):
        found["KISS-Matcher"] = kiss_matcher()
    return found


def _clouds(problem: Problem) -> tuple[Any, Any, Any]:
    import open3d as o3d

    def cloud(points: Floats) -> o3d.geometry.PointCloud:
        return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))

    every = np.arange(len(problem.points_obj))
    pairs = o3d.utility.Vector2iVector(np.stack((every, every), axis=1))
    return cloud(problem.points_obj), cloud(problem.points_cam), pairs


def _pose(matrix: np.ndarray) -> Pose | None:
    """None where the method's answer is no rigid motion."""
    try:
        return Pose.from_matrix(matrix)
    except FrameError:
        return None
