"""Rows of errors -> the numbers of a table: curves, recalls, averages and counts, of one object or of all together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from eval.auc import AUC_THRESHOLD_M, auc_exact, auc_vocap, recall_below, share_over
from eval.average_recall import ar_mspd, ar_mssd, ar_vsd
from eval.instances import InstanceError

FINE_THRESHOLD_M = 0.02  # up to 10 cm good trackers are all at 98 and more
DIAMETER_SHARE = 0.1  # Hinterstoisser et al. 2012: an error under a tenth of the diameter is correct
CURVES = {
    "auc": partial(auc_vocap, threshold_m=AUC_THRESHOLD_M),
    "auc_exact": partial(auc_exact, threshold_m=AUC_THRESHOLD_M),
    "auc_2cm": partial(auc_vocap, threshold_m=FINE_THRESHOLD_M),
    "auc_2cm_exact": partial(auc_exact, threshold_m=FINE_THRESHOLD_M),
}
OVER_M = {"over_1cm": 0.01, "over_5cm": 0.05}
WITHIN = {"recall_5deg_2cm": (5.0, 0.02), "recall_10deg_5cm": (10.0, 0.05)}  # of the nearest symmetric rotation
OVERLAPS = (50, 75)  # percent that the boxes' IoU has to be over
COUNTS = ("instances", "missing", "false_tracks")  # summed where everything else is averaged

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

    def __add__(self, other: TrackingCounts) -> TrackingCounts:
        return TrackingCounts(
            self.frames + other.frames, self.lost + other.lost, self.false_tracks + other.false_tracks
        )


def metrics_of(rows: Sequence[InstanceError]) -> Metrics:
    """AUCs, recalls, shares and the mean IoU in percent, `ar*` as fractions; what was not measured is not in it."""
    errors = {"add": np.array([r.add_m for r in rows]), "adds": np.array([r.adds_m for r in rows])}
    if all(r.symmetric is not None for r in rows):
        errors["add_or_adds"] = np.array([r.adds_m if r.symmetric else r.add_m for r in rows])
    limits_m = DIAMETER_SHARE * np.array([r.diameter_m for r in rows])
    curves = {f"{name}_{curve}": auc(errors[name]) for curve, auc in CURVES.items() for name in errors}
    recalls = {f"{name}_recall_{DIAMETER_SHARE}d": recall_below(errors[name], limits_m) for name in errors}
    shares = {name: share_over(errors["add"], limit_m) for name, limit_m in OVER_M.items()}
    counts = {"instances": len(rows), "missing": sum(r.missing for r in rows)}
    return curves | shares | recalls | _average_recalls(rows) | _recalls_of_poses(rows) | counts


def _average_recalls(rows: Sequence[InstanceError]) -> Metrics:
    """ar_mssd, and ar_mspd, ar_vsd where every row has them; ar, their mean, where all three are there."""
    recalls = {"ar_mssd": ar_mssd([r.mssd_m for r in rows], [r.diameter_m for r in rows])}
    if not any(np.isnan(r.mspd_px) for r in rows):
        recalls["ar_mspd"] = ar_mspd([r.mspd_px for r in rows])
    surfaces = [r.vsd for r in rows if r.vsd is not None]
    if surfaces and len(surfaces) == len(rows):
        recalls["ar_vsd"] = ar_vsd(surfaces)
    return recalls | ({"ar": float(np.mean(list(recalls.values())))} if len(recalls) == 3 else {})


def _recalls_of_poses(rows: Sequence[InstanceError]) -> Metrics:
    """Of angle and distance together, and of the overlap of boxes, in percent."""
    degrees = np.array([r.symmetric_rotation_deg for r in rows])
    metres = np.array([r.translation_m for r in rows])
    overlaps = np.array([r.iou for r in rows])
    within = {name: (degrees < angle) & (metres < distance) for name, (angle, distance) in WITHIN.items()}
    within |= {f"iou_recall_{share}": overlaps > share / 100 for share in OVERLAPS}
    return {name: _percent(correct) for name, correct in (within | {"iou_mean": overlaps}).items()}


def _percent(shares: npt.NDArray[np.generic]) -> float:
    return 100 * float(shares.mean()) if shares.size else np.nan


def tracking_metrics(counts: Sequence[TrackingCounts]) -> Metrics:
    """lost_fraction in [0, 1] and false_tracks of the counts together; nothing where nothing was counted."""
    if not counts:
        return {}
    frames = sum(c.frames for c in counts)
    lost_fraction = sum(c.lost for c in counts) / frames if frames else np.nan
    return {"lost_fraction": lost_fraction, "false_tracks": sum(c.false_tracks for c in counts)}


def mean_of_objects(objects: Sequence[Metrics]) -> Metrics:
    """Mean over the objects that have the metric; counts are summed. Without objects, what pooling nothing gives."""
    names = dict.fromkeys(name for metrics in objects for name in metrics)
    values = {name: [metrics[name] for metrics in objects if name in metrics] for name in names}
    return {name: sum(v) if name in COUNTS else float(np.mean(v)) for name, v in values.items()} or metrics_of([])
