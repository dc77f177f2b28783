"""A concept that a model does not hold, asked of its reference views."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import small_gicp

from tracker.cloud import CloudConfig, lift
from tracker.frame import PosedFrame
from tracker.geometry import Floats
from tracker.saliency import Query, SaliencyBackend
from tracker.view import ViewConfig, view_object

NEIGHBOURS = 4
REACH = 0.05  # of the diameter: a model point farther than this from all that the views show of it stays at zero


def ground(
    label: str, views: Sequence[PosedFrame], backend: SaliencyBackend, points_obj: Floats, diameter_m: float
) -> Floats:
    """(N,) saliency in [0, 1] of a concept at a model's points (N, 3), mean over its nearest in the reference views.

    Raises ConfigError where the backend cannot find such a concept.
    """
    labels = backend.labels_for([label])
    seen = [(view_object(v.frame, v.mask, diameter_m, ViewConfig()), v.T_cam_obj.inverse()) for v in views]
    shown = [(view, T_obj_cam) for view, T_obj_cam in seen if view is not None]
    maps = backend([Query(view, labels) for view, _ in shown])
    place = [known.casefold() for known in labels].index(label.casefold())  # a joined backend has its own spelling
    clouds = [
        (T_obj_cam @ cloud.points, cloud.saliency[:, place])
        for cloud, (_, T_obj_cam) in zip(
            (lift(view, found, CloudConfig()) for (view, _), found in zip(shown, maps, strict=True)), shown, strict=True
        )
    ]
    points, saliency = np.concatenate([c[0] for c in clouds]), np.concatenate([c[1] for c in clouds])
    count = min(NEIGHBOURS, len(points))
    index, squared = small_gicp.KdTree(points).batch_knn_search(points_obj, count)
    near = np.asarray(squared) < (REACH * diameter_m) ** 2
    total = np.where(near, saliency[np.asarray(index, np.intp)], 0.0).sum(axis=1)
    return total / np.maximum(near.sum(axis=1), 1)
