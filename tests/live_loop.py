"""A RealSense camera without hardware at 30 frames a second and a backend that needs 150 ms, for minutes: how old is a
frame when its poses are told, and does anything grow?

`python -m tests.live_loop --minutes 5` prints it.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from eval.bench.soak import resident_mb
from reference.onboard import onboard, read_reference_frames
from tests.software_camera import SoftwareCamera, rs
from tracker.config import TrackerConfig
from tracker.frame import Frame
from tracker.latest import Latest
from tracker.pipeline import ObjectTracker
from tracker.saliency import Query, Saliency, SaliencyBackend, open_backend
from tracker.sources.realsense import RealSenseCamera
from tracker.sources.realsense.camera import Patience
from tracker.sources.realsense.request import Options
from tracker.sources.synthetic import open_scene

PERIOD_S, BACKEND_S = 1 / 30, 0.150
BOUND_MS = 1000 * (2 * PERIOD_S + BACKEND_S)
SETTLED_S = 10


class SlowBackend:
    """Another one, that takes as long as a large network."""

    def __init__(self, quick: SaliencyBackend) -> None:
        self._quick, self.name, self.weights = quick, quick.name, quick.weights
        self.fingerprint, self.labels_for = quick.fingerprint, quick.labels_for

    def __call__(self, queries: Sequence[Query]) -> list[Saliency]:
        ready = time.monotonic() + BACKEND_S
        found = self._quick(queries)
        time.sleep(max(0.0, ready - time.monotonic()))
        return found


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.live_loop", description=__doc__)
    parser.add_argument("--minutes", type=float, default=5)
    parser.add_argument("--size", default="320x240")
    parser.add_argument("--object", default="mug")
    parser.add_argument("--concepts", choices=("now", "later"), default="now", help="as of python -m tracker")
    asked = parser.parse_args()
    scene, quick = open_scene(f"turn?object={asked.object}&size={asked.size}"), open_backend("attributes")
    frames = list(scene)
    model = onboard(read_reference_frames(scene, asked.object, 4), quick)
    worker = ThreadPoolExecutor(1) if asked.concepts == "later" else None
    tracker = ObjectTracker(model, TrackerConfig(masks="carried"), SlowBackend(quick), worker)
    camera = SoftwareCamera(frames[0].intrinsics, clock=rs.timestamp_domain.system_time)
    source = RealSenseCamera(rs, lambda: camera.device, Options(), "realsense:soft-1", Patience(stall_s=5))
    over = threading.Event()
    threading.Thread(target=_show, args=(camera, frames, over), daemon=True).start()
    latencies_ms, memory_mb, tracked = list[float](), list[float](), 0
    began = time.monotonic()
    with Latest(source) as latest:
        for frame in latest:
            (result,) = tracker.step(frame if latencies_ms else replace(frame, masks=frames[0].masks))
            tracked += result.pose is not None
            latencies_ms.append(latest.latency_ms())
            if time.monotonic() - began > SETTLED_S:
                memory_mb.append(resident_mb())
            if time.monotonic() - began > 60 * asked.minutes:
                break
        over.set()
        dropped, shown = latest.dropped, camera.shown
    p95 = statistics.quantiles(latencies_ms, n=20)[-1]
    print(
        f"{asked.minutes:g} minutes, {shown} frames shown, {len(latencies_ms)} tracked on, {tracked} with a pose, "
        f"{dropped} dropped\nlatency from stamp to result: median {statistics.median(latencies_ms):.0f} ms, 95 % under "
        f"{p95:.0f} ms (bound {BOUND_MS:.0f}), stamps of this machine's clock: {latest.stamped}\n"
        f"memory after {SETTLED_S} s {memory_mb[0]:.0f} MB, at most {max(memory_mb):.0f}, at the "
        f"end {memory_mb[-1]:.0f}"
    )


def _show(camera: SoftwareCamera, frames: Sequence[Frame], over: threading.Event) -> None:
    """The scene forth and back, each frame stamped when it is shown."""
    camera.wait_until_open()
    due = time.monotonic()
    for frame in itertools.cycle([*frames, *frames[-2:0:-1]]):
        if over.is_set():
            return
        camera.show_frame(frame, stamp_ms=1000 * time.time())
        due += PERIOD_S
        time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    main()
