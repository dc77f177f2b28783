"""What the page and its Markdown say in the same words: numbers of the run as rows of text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from eval.instances import InstanceError
from eval.published import PUBLISHED
from eval.report import Report
from eval.score_tables import cells
from eval.worst_frames import MissingPoses
from eval.worst_pictures import WorstFrame

AUC_COLUMNS = {"add_auc": ("ADD", 1), "adds_auc": ("ADD-S", 1)}
MOST_GROUPS = 40  # of missing poses; more would be no list but a log
MOST_IMAGES = 12


@dataclass(frozen=True, slots=True)
class TextTable:
    """A heading row and rows under it, all of the same length."""

    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def published_table(report: Report) -> TextTable:
    """This run first, then what others have published."""
    ours = ("this run", *cells(report.scores.pooled, AUC_COLUMNS), "-")
    others = [
        (p.method, f"{p.add_auc:.1f}", f"{p.adds_auc:.1f}", data)
        for p, data in zip(PUBLISHED, report.anchors, strict=True)
    ]
    return TextTable(("method", "ADD", "ADD-S", "data"), (ours, *others))


def about_published(report: Report) -> str:
    said = "AUC up to 10 cm on YCB-V, in percent; this run's are VOCap, pooled over instances."
    return said if report.why_not_ycbv is None else f"{said} Not the same data: {report.why_not_ycbv}."


def published_conventions() -> dict[str, str]:
    return {p.method: f"{p.convention}. {p.source}." for p in PUBLISHED}


def reliability_table(report: Report) -> TextTable | None:
    if report.reliability is None:
        return None
    rows = [
        (f"{b.low:.1f} to {b.high:.1f}", str(b.count), f"{100 * b.confidence:.1f}", f"{100 * b.right:.1f}")
        for b in report.reliability.bins
        if b.count
    ]
    return TextTable(("confidence", "poses", "mean confidence, %", "right, %"), tuple(rows))


def worst_table(report: Report) -> TextTable:
    rows = [(str(w.row.scene_id), str(w.row.image_id), w.row.object_id, *_errors(w)) for w in report.worst]
    return TextTable(("scene", "image", "object", "ADD mm", "ADD-S mm", "rotation °", "confidence"), tuple(rows))


def missing_table(report: Report) -> TextTable:
    """The most frequent reasons; `MOST_GROUPS` of them at most."""
    rows = [
        (str(m.scene_id), m.object_id, str(len(m.image_ids)), m.reason, _images(m))
        for m in report.missing[:MOST_GROUPS]
    ]
    return TextTable(("scene", "object", "poses", "reason", "images"), tuple(rows))


def worst_caption(worst: WorstFrame) -> tuple[str, str]:
    """Which frame it is, and how wrong."""
    row = worst.row
    add, adds, angle, confidence = _errors(worst)
    counted = f"ADD-S {adds}" if row.symmetric else f"ADD {add}"
    return f"{row.object_id}, scene {row.scene_id}, image {row.image_id}", (
        f"{counted} mm, {angle}°, {row.translation_m * 1000:.1f} mm off, confidence {confidence}"
    )


def latency(report: Report) -> tuple[float, float, Mapping[str, float]] | None:
    """Median and 95th percentile of a step, and the medians of its stages, in milliseconds."""
    told = report.extra.get("latency_ms")
    if not isinstance(told, Mapping) or not {"median", "p95", "stages"} <= told.keys():
        return None
    return float(told["median"]), float(told["p95"]), told["stages"]


def plain(value: object) -> str:
    """A value of the protocol in words."""
    if isinstance(value, Mapping):
        return ", ".join(f"{k}: {plain(v)}" for k, v in value.items()) or "-"
    if isinstance(value, list | tuple):
        return ", ".join(plain(v) for v in value) or "-"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _errors(worst: WorstFrame) -> tuple[str, str, str, str]:
    row: InstanceError = worst.row
    millimetres = f"{row.add_m * 1000:.1f}", f"{row.adds_m * 1000:.1f}"
    return *millimetres, f"{row.symmetric_rotation_deg:.1f}", f"{worst.score:.2f}"


def _images(missing: MissingPoses) -> str:
    shown = ", ".join(map(str, missing.image_ids[:MOST_IMAGES]))
    return shown + (f" and {len(missing.image_ids) - MOST_IMAGES} more" if len(missing.image_ids) > MOST_IMAGES else "")
