"""A video file: H.264, which browsers play, where something can write it, else MPEG-4 part 2, which players do."""

from __future__ import annotations

import logging
import shutil
import subprocess
from functools import cache, partial
from pathlib import Path
from typing import IO, Protocol, cast

import cv2
import numpy as np
import numpy.typing as npt

from tracker.errors import OutputError

log = logging.getLogger(__name__)

Bgr = npt.NDArray[np.uint8]
FFMPEG_WAITS_S = 60.0  # for the last frames to be written


class Writer(Protocol):
    """Takes pictures (H, W, 3) uint8 BGR, all of one size."""

    def write(self, bgr: Bgr) -> None: ...

    def close(self) -> None: ...


class VideoFile:
    """An mp4 of so many pictures a second; no file where no picture comes. Raises OutputError where none can be
    written.

    H.264 is written by the program ffmpeg where it is on the PATH (OpenCV's wheels have no encoder of it for licence
    reasons). Where it is not, the video is MPEG-4 part 2, and that is logged.
    """

    def __init__(self, path: Path, rate_hz: float) -> None:
        self._path, self._rate_hz = path, rate_hz
        self._writer: Writer | None = None

    def write(self, bgr: Bgr) -> None:
        height, width = bgr.shape[:2]
        even = np.ascontiguousarray(bgr[: height // 2 * 2, : width // 2 * 2])  # neither codec has odd sizes
        if self._writer is None:
            size = (even.shape[1], even.shape[0])
            program = h264_program()
            opened = partial(_FfmpegWriter, program) if program else _OpenCvWriter
            self._writer = opened(self._path, self._rate_hz, size)
        try:
            self._writer.write(even)
        except OutputError:
            self._writer = None
            raise

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None


@cache
def h264_program() -> str | None:
    """An ffmpeg on the PATH that has the encoder libx264; where there is none, that is logged, once."""
    program = shutil.which("ffmpeg")
    if program and " libx264 " in _encoders(program):
        return program
    missing = "its encoder libx264" if program else "the program ffmpeg"
    log.warning("videos are MPEG-4 part 2, which browsers do not play: with %s installed they are H.264", missing)
    return None


def _encoders(program: str) -> str:
    asked = [program, "-hide_banner", "-encoders"]
    try:
        return subprocess.run(asked, capture_output=True, text=True, timeout=10, check=False).stdout  # noqa: S603
    except (OSError, subprocess.TimeoutExpired) as error:
        log.debug("%s cannot be asked: %s", program, error)
        return ""


class _OpenCvWriter:
    def __init__(self, path: Path, rate_hz: float, size: tuple[int, int]) -> None:
        # the one codec that every OpenCV wheel can write
        self._video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), rate_hz, size)
        if not self._video.isOpened():
            raise OutputError(f"{path}: this OpenCV cannot write mp4 videos there")

    def write(self, bgr: Bgr) -> None:
        self._video.write(bgr)

    def close(self) -> None:
        self._video.release()


class _FfmpegWriter:
    """Sends raw pictures to a process of ffmpeg."""

    def __init__(self, program: str, path: Path, rate_hz: float, size: tuple[int, int]) -> None:
        come = ["-f", "rawvideo", "-pix_fmt", "bgr24", "-s", f"{size[0]}x{size[1]}", "-r", f"{rate_hz:g}", "-i", "-"]
        go = ["-an", "-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-pix_fmt", "yuv420p"]
        place = ["-movflags", "+faststart", "-threads", "1", "-y", str(path.resolve())]
        self._path = path
        process = subprocess.Popen(  # noqa: S603
            [program, "-hide_banner", "-loglevel", "error", *come, *go, *place],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,  # ctrl-C ends the tracking, not the video
        )
        self._process, self._pipe = process, cast("IO[bytes]", process.stdin)

    def write(self, bgr: Bgr) -> None:
        try:
            self._pipe.write(bgr.data)
        except OSError as error:  # it has ended
            raise self._failure() from error

    def close(self) -> None:
        try:
            _, said = self._process.communicate(timeout=FFMPEG_WAITS_S)
        except subprocess.TimeoutExpired as error:
            self._process.kill()
            raise OutputError(f"{self._path}: ffmpeg did not end") from error
        if self._process.returncode:
            raise OutputError(f"{self._path}: ffmpeg cannot write it ({_last_line(said)})")

    def _failure(self) -> OutputError:
        said = self._process.stderr.read() if self._process.stderr else b""
        self._process.wait()
        return OutputError(f"{self._path}: ffmpeg cannot write it ({_last_line(said)})")


def _last_line(said: bytes) -> str:
    lines = said.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else "it said nothing"
