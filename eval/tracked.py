"""What a tracker said of a dataset, and what it was made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from eval.bop_results import Estimate
from eval.datasets import Dataset
from eval.frame_record import FrameRecord
from eval.instances import ObjectInImage
from eval.protocol import PosesThatCount
from eval.summary import TrackingCounts
from tracker.result import TrackResult, TrackState


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """estimates: one for every frame and object with a pose. reference_frames: those that models were made of.
    counts: by object. timings_ms: of every step, stage -> milliseconds. refused: "scene/object" -> why no model could
    be made of it; its poses are missing. records: of every step, in the order of the timings."""

    estimates: list[Estimate] = field(default_factory=list)
    reference_frames: set[ObjectInImage] = field(default_factory=set)
    counts: dict[str, TrackingCounts] = field(default_factory=dict)
    timings_ms: list[dict[str, float]] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    records: list[FrameRecord] = field(default_factory=list)

    @classmethod
    def joined(cls, parts: Iterable[Tracked]) -> Tracked:
        """Several scenes as one, in their order; an object's counts are summed."""
        whole = cls()
        for part in parts:
            whole.estimates.extend(part.estimates)
            whole.reference_frames.update(part.reference_frames)
            whole.timings_ms.extend(part.timings_ms)
            whole.refused.update(part.refused)
            whole.records.extend(part.records)
            for object_id, counts in part.counts.items():
                whole.counts[object_id] = counts + whole.counts.get(object_id, TrackingCounts(0, 0, 0))
        return whole

    def add(
        self,
        dataset: Dataset,
        scene_id: int,
        index: int,
        results: Sequence[TrackResult],
        seen: Sequence[bool],
        poses: PosesThatCount,
    ) -> None:
        """What was said of a frame. seen: of each object, whether a pixel of it can be seen. poses: which count."""
        image_id = dataset.image_ids(scene_id)[index]
        time_s = sum(result.timings_ms["total"] for result in results) / 1000  # of the whole image, as BOP has it
        for result, visible in zip(results, seen, strict=True):
            self.timings_ms.append(result.timings_ms)
            self.records.append(FrameRecord.of(scene_id, image_id, result))
            before = self.counts.get(result.object_id, TrackingCounts(0, 0, 0))
            lost, unseen = result.state is TrackState.LOST, result.pose is not None and not visible
            self.counts[result.object_id] = before + TrackingCounts(1, int(lost), int(unseen))
            pose = result.pose if poses == "filtered" else result.raw_pose
            if pose is not None:
                number = dataset.number(result.object_id)
                self.estimates.append(Estimate(scene_id, image_id, number, result.confidence, pose, time_s))

    def latency_ms(self) -> dict[str, object]:
        """Median and 95th percentile of an object's whole step, and the median of every stage where it ran."""
        if not self.timings_ms:
            return {}
        totals = [timings["total"] for timings in self.timings_ms]
        stages = sorted({stage for timings in self.timings_ms for stage in timings} - {"total"})
        medians = {s: float(np.median([t[s] for t in self.timings_ms if s in t])) for s in stages}
        return {"median": float(np.median(totals)), "p95": float(np.percentile(totals, 95)), "stages": medians}
