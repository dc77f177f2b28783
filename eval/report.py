"""What a report holds, and the scores as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from eval.bop_results import Estimate
from eval.datasets import Dataset
from eval.frame_record import FrameRecord
from eval.published import PUBLISHED, data_of, why_not_ycbv
from eval.reliability import Reliability, reliability
from eval.score import Scores
from eval.worst_frames import MissingPoses, missing_poses
from eval.worst_pictures import WorstFrame, worst_frames
from tracker.whole_file import write_whole


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


def write_scores(path: Path, scores: Scores, extra: Mapping[str, object]) -> None:
    """scores.json: protocol and metrics, and beside them what the caller adds. Raises OutputError."""
    write_whole(path, json.dumps({**scores.as_json(), **extra}, indent=1, allow_nan=False) + "\n")
