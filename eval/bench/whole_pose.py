"""How long a pose takes from scratch, and how long its refinement, on a rendered object without noise."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import small_gicp

from reference.onboard import onboard
from tracker.cloud import CloudConfig, PointCloud, lift
from tracker.concept import ARRAYS, ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import PosedFrame
from tracker.geometry import Pose
from tracker.matching import MatchingConfig
from tracker.refinement import RefinementConfig, Refiner
from tracker.saliency import Query, open_backend
from tracker.saliency.attributes import TERMS
from tracker.search import Search, Sight
from tracker.sources.synthetic import open_scene
from tracker.stopwatch import Stopwatch
from tracker.view import ViewConfig, view_object

SCENE, OBJECT = "turn?object=tea_box&noise=0", "tea_box"
REFERENCES, FRAMES = (0, 20, 40), (8, 12, 16, 28, 32)
POINTS, CONCEPTS, REFINED_POINTS = 5000, 40, 3000
TURN_DEG, SHIFT_M = 5.0, 0.007
GRID_M = 0.002
FINE = ViewConfig(pixels_across=150)


@dataclass(frozen=True, slots=True, eq=False)
class _Sighting:
    sight: Sight
    cloud: PointCloud
    truth: Pose


def whole_pose() -> dict[str, Any]:
    """`global_pose_ms`: median from matching to the refined pose, 5,000 x 5,000 points of 40 concepts.
    `refinement_ms`: median of 3,000 points from 5 degrees and 7 mm off; its median errors, and GICP's beside it."""
    scene, backend = open_scene(SCENE), open_backend("attributes")
    labels = TERMS[:CONCEPTS]
    truth = scene.sightings(OBJECT)

    def posed(index: int) -> PosedFrame:
        frame = scene[index]
        return PosedFrame(frame, OBJECT, truth[index].T_cam_obj, frame.masks[OBJECT])

    model = _thinned(onboard([posed(k) for k in REFERENCES], backend, FINE, vocabulary=labels))
    sights = [_seen(posed(k), model, labels) for k in FRAMES]
    config = TrackerConfig(view=FINE, matching=MatchingConfig(query_points=POINTS))
    search = Search(model, config)
    refine = Refiner(model, RefinementConfig(model_points=REFINED_POINTS), FINE.pixels_across)
    starts = [seen.truth.nudged(_off(k)) for k, seen in enumerate(sights)]
    tree = small_gicp.preprocess_points(model.points, downsampling_resolution=GRID_M)

    def from_scratch(seen: _Sighting, _: Pose) -> Pose:
        found = search.anywhere(seen.sight, seen.cloud, Stopwatch())
        best = max(found, key=lambda hypothesis: hypothesis.evidence.score, default=None)
        return best.refined.T_cam_obj if best else Pose.identity()

    def gicp(seen: _Sighting, start: Pose) -> Pose:
        cloud, _ = small_gicp.preprocess_points(seen.cloud.points, downsampling_resolution=GRID_M)
        result = small_gicp.align(tree[0], cloud, tree[1], start.inverse().matrix, registration_type="GICP")
        return Pose.from_matrix(result.T_target_source).inverse()

    def refined(seen: _Sighting, start: Pose) -> Pose:
        found = refine(start, seen.sight.view, seen.sight.appearance)
        return found.T_cam_obj if found else start

    whole = _timed(from_scratch, sights, starts)
    refinement = _timed(refined, sights, starts)
    return {
        "global_pose_ms": whole["ms"],
        "global_pose": whole,
        "refinement_ms": refinement["ms"],
        "refinement": refinement,
        "refinement_gicp": _timed(gicp, sights, starts),
        "global_pose_points": [POINTS, min(len(seen.cloud) for seen in sights)],
    }


def _thinned(model: ConceptModel) -> ConceptModel:
    kept = np.linspace(0, len(model) - 1, min(POINTS, len(model))).round().astype(int)
    of_points = [name for name in ARRAYS if name != "view_directions"]
    return replace(model, **{name: getattr(model, name)[kept] for name in of_points})


def _seen(posed: PosedFrame, model: ConceptModel, labels: tuple[str, ...]) -> _Sighting:
    view = view_object(posed.frame, posed.mask, model.diameter_m, FINE)
    assert view is not None, "the object is in view in all frames"  # noqa: S101
    cloud = lift(view, open_backend("attributes")([Query(view, labels)])[0], CloudConfig())
    kept = np.linspace(0, len(cloud) - 1, min(POINTS, len(cloud))).round().astype(int)
    parts = (cloud.points, cloud.normals, cloud.colours, cloud.saliency)
    thinned = PointCloud(*(part[kept] for part in parts))
    return _Sighting(Sight.of(view, masked=True), thinned, posed.T_cam_obj)


def _off(seed: int) -> np.ndarray:
    turn, shift = np.random.default_rng([seed, 5]).normal(size=(2, 3))
    turn *= np.radians(TURN_DEG) / np.linalg.norm(turn)
    return np.concatenate((turn, shift * SHIFT_M / np.linalg.norm(shift)))


def _timed(way: Callable[[_Sighting, Pose], Pose], sights: list[_Sighting], starts: list[Pose]) -> dict[str, float]:
    way(sights[0], starts[0])
    spent, degrees, millimetres = [], [], []
    for seen, start in list(zip(sights, starts, strict=True)) * 2:
        began = time.perf_counter()
        found = way(seen, start)
        spent.append(time.perf_counter() - began)
        degrees.append(float(np.degrees(found.angle_to_rad(seen.truth))))
        millimetres.append(found.distance_to_m(seen.truth) * 1e3)
    medians = [statistics.median(values) for values in (spent, degrees, millimetres)]
    return {"ms": medians[0] * 1e3, "degrees": medians[1], "mm": medians[2]}
