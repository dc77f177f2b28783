"""The frames of a source, one after the other: each is tracked, shown and written, until there are no more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tracker.errors import TrackerError
from tracker.first_masks import FirstMasks
from tracker.frame import Frame
from tracker.output import PoseOutput
from tracker.pipeline import ObjectTracker
from tracker.remote_control import RemoteControl
from tracker.summary import Summary
from tracker.terminal import ALWAYS, STDERR
from tracker.viewer import Viewer

if TYPE_CHECKING:
    from tracker.web.server import WebPage


@dataclass(frozen=True, slots=True, eq=False)
class FrameByFrame:
    """masks: of a frame, those alone that the tracker is to have; None where it is to have all. latency_ms: how old the
    last frame is, None where it is of a recording. page: stays when there are no more frames, until somebody interrupts
    it; None where there is none."""

    tracker: ObjectTracker
    masks: FirstMasks | None
    viewer: Viewer
    outputs: Sequence[PoseOutput]
    remote: RemoteControl
    summary: Summary
    latency_ms: Callable[[], float] | None
    page: WebPage | None

    def __call__(self, frames: Iterable[Frame], *, kept: bool) -> TrackerError | None:
        """What ended it early, if it was no interrupt: a frame that cannot be read does not cost those before it. kept:
        whether anything is left of an interrupted run, which is told."""
        failure: TrackerError | None = None
        try:
            for frame in frames:
                self._follow(frame)
            if self.page:
                STDERR.print("there are no more frames; the page stays until ctrl-C")
                self.page.stay("there are no more frames")
        except KeyboardInterrupt:
            ALWAYS.print(f"stopped; {'what was tracked is kept' if kept else 'nothing was to be kept'}")
        except TrackerError as error:
            failure = error
        for output in self.outputs:
            output.finish()
        return failure

    def _follow(self, frame: Frame) -> None:
        results = self.tracker.step(self.masks(frame) if self.masks else frame)
        self.viewer.show(frame, results, {})
        self.summary.add(results)
        for output in self.outputs:
            output.add(frame, results)
        if self.latency_ms:
            self.summary.latencies_ms.append(self.latency_ms())
        self.remote.carry_out(self.tracker)
