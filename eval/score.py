"""Loop 2 of an evaluation: estimates and targets -> scores, in the layout of `scores.json`."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from eval.alignment import ReferenceRule, align
from eval.auc import AUC_THRESHOLD_M
from eval.bop_results import Estimate, read_results
from eval.box_overlap import NOCS_STEPS
from eval.datasets import Dataset
from eval.instances import InstanceError, Instances, ObjectInImage, measure
from eval.known_ids import known_to
from eval.summary import (
    DIAMETER_SHARE,
    FINE_THRESHOLD_M,
    Metrics,
    TrackingCounts,
    mean_of_objects,
    metrics_of,
    tracking_metrics,
)
from eval.symmetries import STEPS
from eval.visible_surface import DELTA_M

log = logging.getLogger(__name__)

# What a score depends on and scoring cannot see: the run says it, or the report shows that nobody did.
STATED_BY_THE_RUN = ("backend", "masks", "initialisation", "reinitialisation", "poses")


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """metrics by name, AUCs, recalls and `over_*` in percent, `ar*` as fractions: over all instances together, as the
    mean of the objects' values (counts summed), and of each object. NaN where there was not one instance."""

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
    symmetric: Collection[str] | None = None,
    with_vsd: bool = False,
) -> Scores:
    """Scores the estimates on the dataset's targets.

    scene_ids, object_ids: only those targets. exclude: the reference frames. protocol: conventions of the run; what
    scoring itself decides is added and prevails. tracking: by object, gives `lost_fraction` and `false_tracks`.
    symmetric: the objects whose ADD(-S) is ADD-S, instead of those that the dataset declares; nothing else depends on
    it. with_vsd: measure VSD too, which reads the depth of every image that has a target.
    Raises SourceError where the dataset does not have what is asked for.
    """
    instances = measure(dataset, estimates, scene_ids, object_ids, exclude, symmetric, with_vsd)
    told_symmetric = symmetric is not None
    return summarise(dataset, instances, scene_ids, protocol or {}, tracking or {}, told_symmetric, with_vsd)


def summarise(
    dataset: Dataset,
    instances: Instances,
    scene_ids: Sequence[int] | None,
    protocol: Mapping[str, object],
    tracking: Mapping[str, TrackingCounts],
    told_symmetric: bool,
    with_vsd: bool,
) -> Scores:
    """Errors -> scores; the parameters are those of `score`. told_symmetric: whether the user named the objects."""
    rows: dict[str, list[InstanceError]] = {}
    for row in instances.errors:
        rows.setdefault(row.object_id, []).append(row)
    per_object = {
        object_id: metrics_of(of_object) | tracking_metrics([tracking[object_id]] if object_id in tracking else [])
        for object_id, of_object in rows.items()
    }
    pooled = metrics_of(instances.errors) | tracking_metrics(list(tracking.values()))
    mean = mean_of_objects(list(per_object.values()))
    stated = dict.fromkeys(STATED_BY_THE_RUN, "not stated") | dict(protocol)
    return Scores(
        protocol=stated | _protocol(dataset, instances, scene_ids, tuple(rows), told_symmetric, with_vsd),
        pooled=pooled,
        # the mean over those objects alone that have a mesh, say, would pass for that over all
        mean_of_objects={name: value for name, value in mean.items() if name in pooled},
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
    symmetric: Collection[str] | None = None,
    with_vsd: bool = False,
    align_on: ReferenceRule | None = None,
    keep_alignment_frames: bool = False,
) -> Scores:
    """`score` of a BOP result file.

    align_on: the file's poses are in object frames of their own; which frame of each object and scene they are aligned
    on, see `eval.alignment`. keep_alignment_frames: score those frames too, whose errors are zero.
    Raises OutputError that names file and line where it cannot be read, and where an estimate is of a scene, an image
    or an object that the dataset does not have.
    """
    estimates: Sequence[Estimate] = read_results(results, known_to(dataset))
    _warn_of_silence(dataset, estimates, str(results), object_ids)
    stated: dict[str, object] = {"results": str(results)}
    if align_on is not None:
        aligned = align(dataset, estimates, align_on, scene_ids, object_ids)
        estimates = aligned.estimates
        stated |= aligned.stated() | {"alignment_frames_are": "scored" if keep_alignment_frames else "not scored"}
        exclude = frozenset(exclude) | (frozenset() if keep_alignment_frames else aligned.reference_frames)
    return score(
        dataset,
        estimates,
        scene_ids=scene_ids,
        object_ids=object_ids,
        exclude=exclude,
        protocol=stated | dict(protocol or {}),
        symmetric=symmetric,
        with_vsd=with_vsd,
    )


def _warn_of_silence(
    dataset: Dataset, estimates: Sequence[Estimate], results: str, object_ids: Sequence[str] | None
) -> None:
    """Of objects that the file says nothing of every instance counts as missing."""
    answered = {dataset.object_with(estimate.object_id) for estimate in estimates}
    silent = [name for name in (dataset.object_ids if object_ids is None else object_ids) if name not in answered]
    if silent and answered:
        log.warning(
            "%s has no row of object %s: all its instances count as missing; --objects %s leaves it out",
            results,
            ", ".join(silent),
            " ".join(sorted(answered)),
        )


def _protocol(
    dataset: Dataset,
    instances: Instances,
    scene_ids: Sequence[int] | None,
    object_ids: Sequence[str],
    told_symmetric: bool,
    with_vsd: bool,
) -> dict[str, object]:
    excluded = instances.excluded
    return {
        "dataset": dataset.name,
        "scenes": list(dataset.scene_ids if scene_ids is None else scene_ids),
        "objects": list(object_ids),
        "frames": dataset.target_rule,
        "metrics": "ADD and ADD-S (ground truth -> estimate) of every object, over all model points; "
        "ADD(-S): ADD-S for the symmetric objects, ADD for the others",
        "symmetric_objects": "not declared" if instances.symmetric is None else list(instances.symmetric),
        "symmetric_objects_are": "the user's list" if told_symmetric else "the dataset's",
        "symmetries": f"the dataset's; about an axis {STEPS} steps for MSSD and MSPD, {NOCS_STEPS} for the IoU of "
        "boxes (as NOCS), every angle for 5 deg 2 cm and 10 deg 5 cm",
        "average_recall": "error < threshold; MSSD 0.05 .. 0.50 diameters, MSPD 5 .. 50 px at a width of 640, "
        "VSD 0.05 .. 0.50 at tau 0.05 .. 0.50 diameters; pooled over targets",
        "mspd": "measured" if instances.no_cameras is None else f"not measured: {instances.no_cameras}",
        "vsd": _about_vsd(instances.without_mesh, with_vsd),
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


def _about_vsd(without_mesh: Sequence[str], with_vsd: bool) -> str:
    if not with_vsd:
        return "not measured: --vsd asks for it"
    if without_mesh:
        return f"not measured: no mesh, only points, of {', '.join(without_mesh)}"
    return f"BOP19, delta {1000 * DELTA_M:.0f} mm, distance images"


def _without_nan(metrics: Metrics) -> dict[str, float | None]:
    return {name: None if np.isnan(value) else value for name, value in metrics.items()}
