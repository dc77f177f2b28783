"""Where pictures of what the tracker does go: into a video, into pictures of single frames, or nowhere."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from tracker.concept import ConceptModel
from tracker.errors import OutputError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.overlay import draw_overlay, shapes_of
from tracker.rerun_log import RerunLog
from tracker.result import TrackResult
from tracker.video import VideoFile

FALLBACK_RATE_HZ = 30.0
MOST_WAITING = 8  # frames that are to be drawn yet
VIDEO, FRAMES, RECORDING = "overlay.mp4", "frames", "run.rrd"  # in a folder of results


class Viewer(Protocol):
    """Gets every frame with its results, and the true poses where there are any."""

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None: ...

    def close(self) -> None: ...


class NullViewer:
    """Shows nothing."""

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        pass

    def close(self) -> None:
        pass


def file_viewer(views: Collection[str], folder: Path | None, models: Sequence[ConceptModel]) -> Viewer:
    """Of the views "overlay", "frames" and "rrd", the video, the folder of pictures and the recording for Rerun; one
    that shows nothing without any. Raises MissingExtraError for a recording without the package rerun-sdk."""
    if folder is None:
        return NullViewer()
    video = folder / VIDEO if "overlay" in views else None
    pictures = folder / FRAMES if "frames" in views else None
    viewers: list[Viewer] = [OverlayFiles(models, video, pictures)] if video or pictures else []
    if "rrd" in views:
        viewers.append(RerunLog(models, folder / RECORDING))
    return Several(viewers) if viewers else NullViewer()


class Several:
    """Viewers that each get every frame."""

    def __init__(self, viewers: Sequence[Viewer]) -> None:
        self._viewers = viewers

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        for viewer in self._viewers:
            viewer.show(frame, results, truth)

    def close(self) -> None:
        with ExitStack() as stack:  # all of them, also where one fails
            for viewer in self._viewers:
                stack.callback(viewer.close)


class OverlayFiles:
    """Draws `tracker.overlay` of every frame once, into a video, into a folder of PNG files, or both.

    That is done by a thread, so that the tracker does not wait for it unless it falls behind by MOST_WAITING frames.
    video: of rate_hz pictures a second. pictures: a folder, which is made: 000012.png is the frame of index 12.
    `show` and `close` raise OutputError, once, where something could not be written of this frame or an earlier one.
    """

    def __init__(
        self,
        models: Sequence[ConceptModel],
        video: Path | None = None,
        pictures: Path | None = None,
        rate_hz: float = FALLBACK_RATE_HZ,
    ) -> None:
        self._shapes, self._pictures = shapes_of(models), pictures
        self._video = VideoFile(video, rate_hz) if video else None
        self._worker = ThreadPoolExecutor(1)
        self._waiting: deque[Future[None]] = deque()

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        while self._waiting and (self._waiting[0].done() or len(self._waiting) >= MOST_WAITING):
            self._finish_oldest()
        self._waiting.append(self._worker.submit(self._write, frame, tuple(results), dict(truth)))

    def close(self) -> None:
        try:
            while self._waiting:
                self._finish_oldest()
        finally:
            self._worker.shutdown(cancel_futures=True)
            if self._video:
                self._video.close()

    def _finish_oldest(self) -> None:
        try:
            self._waiting.popleft().result()
        except BaseException:
            self._waiting.clear()  # they would say the same again
            raise

    def _write(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        bgr = cv2.cvtColor(draw_overlay(frame, results, self._shapes, truth), cv2.COLOR_RGB2BGR)
        bgr = np.asarray(bgr, np.uint8)
        if self._video:
            self._video.write(bgr)
        if self._pictures:
            _, encoded = cv2.imencode(".png", bgr)
            path = self._pictures / f"{frame.index:06d}.png"
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(encoded.tobytes())
            except OSError as error:
                raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
