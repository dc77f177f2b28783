"""All objects of a scene, and the table of all."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.table import Table

from eval.datasets import Target, open_dataset
from eval.losses.cause import CAUSES, WRONG_M, Loss, Tracer
from reference.onboard import onboard, read_reference_frames
from tracker.config import TrackerConfig
from tracker.errors import OnboardingError
from tracker.saliency import open_backend

log = logging.getLogger(__name__)

FARTHEST_M = 0.1  # of the area under the curve: an error from there on costs all that there is to lose
UNDER = f"< {WRONG_M * 100:g} cm"


@dataclass(frozen=True, slots=True)
class LossRun:
    """A scene of a dataset, by names, so that another process can do it. object_ids: only these."""

    dataset: str
    scene_id: int
    views: int
    config: TrackerConfig
    backend: str = "attributes"
    object_ids: tuple[str, ...] | None = None


def losses_of(run: LossRun) -> list[Loss]:
    """Of every target of the scene but the reference frames. Raises SourceError as the dataset does."""
    dataset, backend = open_dataset(run.dataset), open_backend(run.backend)
    source = dataset.scene(run.scene_id)
    tracers, used = {}, set()
    for object_id in source.object_ids:
        if run.object_ids is None or object_id in run.object_ids:
            try:
                frames = read_reference_frames(source, object_id, run.views)
            except OnboardingError as error:
                log.warning("scene %d: %s", run.scene_id, error)
                continue
            model = onboard(frames, backend, run.config.view, run.config.cloud)
            tracers[object_id] = Tracer(model, dataset.model(object_id), backend, run.config)
            used |= {(each.frame.index, object_id) for each in frames}
    found = []
    by_index: dict[int, list[Target]] = {}
    for target in dataset.targets(run.scene_id):
        if target.object_id in tracers and (target.index, target.object_id) not in used:
            by_index.setdefault(target.index, []).append(target)
    for index in sorted(by_index):
        frame = source[index]
        for target in by_index[index]:
            mask = frame.masks.get(target.object_id, np.zeros(frame.depth_m.shape, bool))
            found.append(tracers[target.object_id](frame, mask, target.T_cam_obj))
    return found


def points_lost(losses: Sequence[Loss]) -> dict[str, float]:
    """By cause, how many of the 100 points of an area under the curve are lost; those of poses that are not wrong
    under the last name."""
    cost = dict.fromkeys((*CAUSES, UNDER), 0.0)
    for loss in losses:
        cost[loss.cause or UNDER] += 100 * min(loss.error_m / FARTHEST_M, 1) / len(losses)
    return cost


def loss_table(losses: Sequence[Loss], title: str) -> Table:
    """A row an object, and one of all: points lost, by the causes that there are."""
    table, causes = Table(title=title), [cause for cause, cost in points_lost(losses).items() if cost]
    for name in ("object", "n", "wrong", "lost", *causes):
        table.add_column(name, justify="left" if name == "object" else "right")
    object_ids = sorted({loss.object_id for loss in losses}, key=lambda name: (len(name), name))
    groups = {name: [loss for loss in losses if loss.object_id == name] for name in object_ids}
    for name, group in [*groups.items(), ("pooled", list(losses))]:
        cost = points_lost(group)
        wrong = sum(loss.cause is not None for loss in group) / len(group)
        cells = [f"{cost[cause]:.1f}" if cost[cause] >= 0.05 else "" for cause in causes]
        table.add_row(name, str(len(group)), f"{wrong:.1%}", f"{sum(cost.values()):.1f}", *cells)
    return table
