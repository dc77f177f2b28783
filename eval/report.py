"""What a report holds, and the scores as JSON."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from eval.bop_results import Estimate
from eval.datasets import Dataset
from eval.frame_record import FrameRecord
from eval.published import PUBLISHED, data_of, why_not_ycbv
from eval.reliability import Reliability, reliability
from eval.score import Scores
from eval.worst_frames import MissingPoses, missing_poses
from eval.worst_pictures import WorstFrame, worst_frames
from tracker.errors import OutputError

PACKAGES = ("conceptrack", "torch", "numpy", "scipy", "open3d", "opencv-python-headless", "small_gicp", "filterpy")


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """All that the page and its Markdown say, so that both say the same.

    extra: what stands beside the protocol, by heading; `latency_ms` and `environment`. records: of every step, none
    where poses came from a file. anchors: for each of `published.PUBLISHED`, whether it is of the same data, and
    why_not_ycbv says why it is not. reliability: None where no pose has a confidence.
    """

    title: str
    scores: Scores
    extra: Mapping[str, object]
    records: Sequence[FrameRecord] = ()
    anchors: Sequence[str] = ()
    why_not_ycbv: str | None = None
    reliability: Reliability | None = None
    worst: Sequence[WorstFrame] = ()
    missing: Sequence[MissingPoses] = ()


def make_report(
    title: str,
    dataset: Dataset,
    scores: Scores,
    estimates: Iterable[Estimate],
    extra: Mapping[str, object],
    records: Sequence[FrameRecord] = (),
) -> Report:
    """Reads the images of the worst frames again, and no others."""
    confidences = {(r.scene_id, r.object_id, r.image_id): r.confidence for r in records}
    why_not = why_not_ycbv(dataset, scores.protocol)
    return Report(
        title,
        scores,
        extra,
        records,
        anchors=tuple(data_of(published, dataset, why_not) for published in PUBLISHED),
        why_not_ycbv=why_not,
        reliability=reliability(scores.instances, confidences),
        worst=worst_frames(dataset, scores.instances, estimates),
        missing=tuple(missing_poses(scores.instances, records)),
    )


def environment() -> dict[str, str]:
    """What the run ran on: machine and versions, so that a table can be made again."""
    versions = {"python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed as a package"
    return versions


def write_scores(path: Path, scores: Scores, extra: Mapping[str, object]) -> None:
    """scores.json: protocol and metrics, and beside them what the caller adds."""
    path.write_text(json.dumps({**scores.as_json(), **extra}, indent=1, allow_nan=False) + "\n")


def write_figures(path: Path, figures: Mapping[str, object]) -> None:
    """Figures of a measurement as JSON, with what it ran on; whole or not at all. Raises OutputError."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(json.dumps({**figures, "environment": environment()}, indent=1, allow_nan=False) + "\n")
        partial.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
