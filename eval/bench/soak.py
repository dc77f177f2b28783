"""`python -m eval bench soak`: does a tracker that runs for long keep its memory and its speed?"""

from __future__ import annotations

import itertools
import resource
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eval.bench.measurement import Measurement
from tracker.terminal import progress

if TYPE_CHECKING:
    from tracker.frame import Frame

SCENE, RENDERED = "tabletop", 60
VIEWS = 3
RATE_HZ = 30
STATM = Path("/proc/self/statm")


@dataclass
class SoakBench(Measurement):
    """Carry the masks of several objects through thousands of frames, a rendered scene forth and back, and compare
    memory and speed after the first of them with those at the end."""

    frames: int = 10_000
    """How many are tracked."""
    objects: int = 5
    """How many objects there are in each, six at most."""
    settled: int = 500
    """Frames after which memory and speed are to stay as they are."""
    size: str = "640x480"
    """Of the pictures."""

    def title(self) -> str:
        return f"{self.frames} frames, {self.objects} objects"

    def measured(self) -> dict[str, Any]:
        from tracker.errors import ConfigError

        if self.frames < 2 * self.settled or self.settled < 1:
            raise ConfigError(f"--frames: at least twice the {self.settled} settled ones are needed, got {self.frames}")

        from reference.onboard import onboard, read_reference_frames
        from tracker.config import TrackerConfig
        from tracker.pipeline import ObjectTracker
        from tracker.saliency import open_backend
        from tracker.sources.synthetic import open_scene

        scene, backend = open_scene(f"{SCENE}?frames={RENDERED}&size={self.size}"), open_backend("attributes")
        object_ids = scene.object_ids[: self.objects]
        models = [onboard(read_reference_frames(scene, object_id, VIEWS), backend) for object_id in object_ids]
        tracker = ObjectTracker(models, TrackerConfig(masks="carried"), backend)
        spent_ms: list[float] = []
        memory_mb, tracked = [], 0
        for frame in progress(_forth_and_back(list(scene), self.frames), self.frames, "frames"):
            start_s = time.perf_counter()
            results = tracker.step(frame)
            spent_ms.append((time.perf_counter() - start_s) * 1e3)
            memory_mb.append(resident_mb())
            tracked += sum(result.pose is not None for result in results)
        early, late = spent_ms[self.settled : 2 * self.settled], spent_ms[-self.settled :]
        return {
            "frames_per_s": 1e3 / statistics.median(spent_ms),
            "median_ms": statistics.median(spent_ms),
            "p95_ms": statistics.quantiles(spent_ms, n=20)[-1],
            "slowdown": statistics.median(late) / statistics.median(early),
            "resident_mb": [memory_mb[self.settled], memory_mb[-1]],
            "growth": max(memory_mb[self.settled :]) / memory_mb[self.settled] - 1,
            "tracked": tracked / (self.frames * len(models)),
            "settings": {"frames": self.frames, "objects": list(object_ids), "size": self.size},
        }


def _forth_and_back(rendered: Sequence[Frame], count: int) -> Iterator[Frame]:
    """So many frames in which nothing jumps; masks are in the first alone."""
    turning = itertools.cycle([*rendered, *rendered[-2:0:-1]])
    for index, frame in enumerate(itertools.islice(turning, count)):
        masks = frame.masks if index == 0 else {}
        yield replace(frame, index=index, stamp_ns=index * 10**9 // RATE_HZ, masks=masks)


def resident_mb() -> float:
    """Memory of this process."""
    return int(STATM.read_text().split()[1]) * resource.getpagesize() / 2**20
