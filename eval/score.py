"""Loop 2 of an evaluation: estimates and targets -> scores, in the layout of `scores.json`."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from eval.auc import AUC_THRESHOLD_M, auc_exact, auc_vocap, recall_below, share_over
from eval.bop_results import Estimate, read_results
from eval.datasets import Dataset
from eval.instances import InstanceError, Instances, ObjectInImage, measure

FINE_THRESHOLD_M = 0.02  # up to 10 cm good trackers are all at 98 and more
DIAMETER_SHARE = 0.1  # Hinterstoisser et al. 2012: an error under a tenth of the diameter is correct
CURVES = {
    "auc": partial(auc_vocap, threshold_m=AUC_THRESHOLD_M),
    "auc_exact": partial(auc_exact, threshold_m=AUC_THRESHOLD_M),
    "auc_2cm": partial(auc_vocap, threshold_m=FINE_THRESHOLD_M),
    "auc_2cm_exact": partial(auc_exact, threshold_m=FINE_THRESHOLD_M),
}
OVER_M = {"over_1cm": 0.01, "over_5cm": 0.05}
COUNTS = ("instances", "missing", "false_tracks")  # summed where everything else is averaged
# What a score depends on and scoring cannot see: the run says it, or the report shows that nobody did.
STATED_BY_THE_RUN = ("backend", "masks", "initialisation", "reinitialisation", "poses")

Metrics = dict[str, float]


@dataclass(frozen=True, slots=True)
class TrackingCounts:
    """What a tracking run saw of an object and a result file cannot tell.

    frames: frames it was given while the object was being tracked or looked for; lost: those of them that were LOST.
    false_tracks: frames with a pose although no pixel of the object can be seen.
    """

    frames: int
    lost: int
    false_tracks: int


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """metrics by name, AUCs, recalls and `over_*` in percent: over all instances together, as the mean of the objects'
    values (counts summed), and of each object. NaN where there was not one instance."""

    protocol: Mapping[str, object]
    pooled: Metrics
    mean_of_objects: Metrics
    per_object: Mapping[str, Metrics]
    instances: tuple[InstanceError, ...]

    def as_json(self) -> dict[str, object]:
        """`protocol` and `metrics`, NaN as null, as JSON knows none. The instances are not in it."""
        metrics = {
            "pooled": _without_nan(self.pooled),
            "mean_of_objects": _without_nan(self.mean_of_objects),
            "per_object": {object_id: _without_nan(values) for object_id, values in self.per_object.items()},
        }
        return {"protocol": dict(self.protocol), "metrics": metrics}

    def instance_table(self) -> list[dict[str, object]]:
        """A row a target, for a table or a plot; errors of a missing pose are infinite."""
        return [asdict(row) for row in self.instances]


def score(
    dataset: Dataset,
    estimates: Iterable[Estimate],
    *,
    scene_ids: Sequence[int] | None = None,
    object_ids: Sequence[str] | None = None,
    exclude: Collection[ObjectInImage] = frozenset(),
    protocol: Mapping[str, object] | None = None,
    tracking: Mapping[str, TrackingCounts] | None = None,
) -> Scores:
    """Scores the estimates on the dataset's targets.

    scene_ids, object_ids: only those targets. exclude: the reference frames. protocol: conventions of the run; what
    scoring itself decides is added and prevails. tracking: by object, gives `lost_fraction` and `false_tracks`.
    Raises SourceError where the dataset does not have what is asked for.
    """
    instances = measure(dataset, estimates, scene_ids, object_ids, exclude)
    rows: dict[str, list[InstanceError]] = {}
    for row in instances.errors:
        rows.setdefault(row.object_id, []).append(row)
    counts = tracking or {}
    per_object = {
        object_id: _metrics(of_object) | _tracking_metrics([counts[object_id]] if object_id in counts else [])
        for object_id, of_object in rows.items()
    }
    stated = dict.fromkeys(STATED_BY_THE_RUN, "not stated") | dict(protocol or {})
    return Scores(
        protocol=stated | _protocol(dataset, instances, scene_ids, tuple(rows)),
        pooled=_metrics(instances.errors) | _tracking_metrics(list(counts.values())),
        mean_of_objects=_mean(list(per_object.values())),
        per_object=per_object,
        instances=instances.errors,
    )


def score_results_file(
    dataset: Dataset,
    results: str | Path,
    *,
    scene_ids: Sequence[int] | None = None,
    object_ids: Sequence[str] | None = None,
    exclude: Collection[ObjectInImage] = frozenset(),
    protocol: Mapping[str, object] | None = None,
) -> Scores:
    """`score` of a BOP result file. Raises OutputError that names file and line where it cannot be read."""
    told = {"results": str(results)} | dict(protocol or {})
    return score(
        dataset, read_results(results), scene_ids=scene_ids, object_ids=object_ids, exclude=exclude, protocol=told
    )


def _metrics(rows: Sequence[InstanceError]) -> Metrics:
    errors = {"add": np.array([r.add_m for r in rows]), "adds": np.array([r.adds_m for r in rows])}
    limits_m = DIAMETER_SHARE * np.array([r.diameter_m for r in rows])
    curves = {f"{name}_{curve}": auc(errors[name]) for curve, auc in CURVES.items() for name in errors}
    recalls = {f"{name}_recall_{DIAMETER_SHARE}d": recall_below(errors[name], limits_m) for name in errors}
    shares = {name: share_over(errors["add"], limit_m) for name, limit_m in OVER_M.items()}
    return curves | shares | recalls | {"instances": len(rows), "missing": sum(r.missing for r in rows)}


def _tracking_metrics(counts: Sequence[TrackingCounts]) -> Metrics:
    """lost_fraction in [0, 1] and false_tracks of the counts together; nothing where nothing was counted."""
    if not counts:
        return {}
    frames = sum(c.frames for c in counts)
    lost_fraction = sum(c.lost for c in counts) / frames if frames else np.nan
    return {"lost_fraction": lost_fraction, "false_tracks": sum(c.false_tracks for c in counts)}


def _mean(objects: Sequence[Metrics]) -> Metrics:
    """Mean over the objects that have the metric; counts are summed. Without objects, what pooling nothing gives."""
    names = dict.fromkeys(name for metrics in objects for name in metrics)
    values = {name: [metrics[name] for metrics in objects if name in metrics] for name in names}
    return {name: sum(v) if name in COUNTS else float(np.mean(v)) for name, v in values.items()} or _metrics([])


def _protocol(
    dataset: Dataset, instances: Instances, scene_ids: Sequence[int] | None, object_ids: Sequence[str]
) -> dict[str, object]:
    excluded = instances.excluded
    return {
        "dataset": dataset.name,
        "scenes": list(dataset.scene_ids if scene_ids is None else scene_ids),
        "objects": list(object_ids),
        "frames": dataset.target_rule,
        "metrics": "ADD and ADD-S (ground truth -> estimate) of every object, over all model points",
        "symmetric_objects": "not declared" if instances.symmetric is None else list(instances.symmetric),
        "integration": "VOCap; the keys that end in _exact: exact",
        "auc_thresholds_m": [AUC_THRESHOLD_M, FINE_THRESHOLD_M],
        "recall": f"error < {DIAMETER_SHARE} diameter",
        "averaging": "pooled over instances, and mean of objects",
        "missing_pose": "infinite error",
        "reference_frames": f"out ({excluded} instances)" if excluded else "in (no instance was left out)",
        "model_frame": dataset.model_frame,
        "estimates_of_no_target": instances.ignored,
        "surplus_estimates": instances.surplus,
    }


def _without_nan(metrics: Metrics) -> dict[str, float | None]:
    return {name: None if np.isnan(value) else value for name, value in metrics.items()}
