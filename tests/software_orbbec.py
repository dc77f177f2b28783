"""A stand-in for the part of pyorbbecsdk that the project calls, as there is no camera of software in it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

WIDTH, HEIGHT, FPS = 48, 36, 30
PERIOD_US = 33_333
Kinds = Enum("Kinds", "RGB BGR BGRA MJPG YUYV Y16 H264 RLE")
Distortions = Enum("Distortions", "NONE BROWN_CONRADY BROWN_CONRADY_K6 FOUR_EYES")


class SoftwareFrame:
    """Its data are in a buffer that the SDK writes over later, as the real one does."""

    def __init__(
        self,
        buffer: npt.NDArray[np.uint8],
        kind: Kinds,
        stamp_us: int,
        scale: float = 1.0,
        model: Distortions = Distortions.NONE,
        focal: float = 60.0,
        **coefficients: float,
    ) -> None:
        self._buffer, self._kind, self._stamp_us, self._scale = buffer, kind, stamp_us, scale
        fields = dict.fromkeys(("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"), 0.0)
        self._distortion = SimpleNamespace(model=model, **{**fields, **coefficients})
        self._intrinsic = SimpleNamespace(fx=focal, fy=61.0, cx=23.5, cy=17.0, width=WIDTH, height=HEIGHT)

    def get_data(self) -> npt.NDArray[np.uint8]:
        return self._buffer

    def get_format(self) -> Kinds:
        return self._kind

    def get_width(self) -> int:
        return WIDTH

    def get_height(self) -> int:
        return HEIGHT

    def get_timestamp_us(self) -> int:
        return self._stamp_us

    def get_depth_scale(self) -> float:
        return self._scale

    def get_stream_profile(self) -> Any:
        return self

    def as_video_stream_profile(self) -> Any:
        return self

    def get_fps(self) -> int:
        return FPS

    def get_intrinsic(self) -> Any:
        return self._intrinsic

    def get_distortion(self) -> Any:
        return self._distortion


class SoftwareFrames:
    def __init__(self, colour: SoftwareFrame | None, depth: SoftwareFrame | None) -> None:
        self._colour, self._depth = colour, depth

    def get_color_frame(self) -> SoftwareFrame | None:
        return self._colour

    def get_depth_frame(self) -> SoftwareFrame | None:
        return self._depth

    def as_frame_set(self) -> SoftwareFrames:
        return self


Shown = SoftwareFrames | Exception | Callable[[], None] | None


class SoftwareContext:
    """The SDK's class, of which there is one instance for all."""

    def __init__(self, serials: Sequence[str], log: list[str]) -> None:
        self._serials, self._log = serials, log

    def __call__(self) -> SoftwareContext:
        return self

    def set_logger_level(self, level: str) -> None:
        self._log.append(f"log {level}")

    def query_devices(self) -> Any:
        return SimpleNamespace(
            get_count=lambda: len(self._serials),
            get_device_serial_number_by_index=lambda k: self._serials[k],
            get_device_by_index=lambda k: self._serials[k],
        )


class SoftwareSDK:
    """A camera of every serial number, and files, all of which show the same. `log` has what was called."""

    OBSensorType = SimpleNamespace(COLOR_SENSOR="colour", DEPTH_SENSOR="depth")
    OBStreamType = SimpleNamespace(COLOR_STREAM="colour")
    OBFrameAggregateOutputMode = SimpleNamespace(FULL_FRAME_REQUIRE="full")
    OBLogLevel = SimpleNamespace(NONE="none")
    OBPlaybackStatus = SimpleNamespace(PLAYING="playing", STOPPED="stopped")

    class OBError(Exception):
        """As the SDK raises it."""

    def __init__(self, *shown: Shown, serials: Sequence[str] = ("CP1",), broken: bool = False) -> None:
        self._shown, self._serials, self._broken = shown, serials, broken
        self.log: list[str] = []
        self.Context = SoftwareContext(serials, self.log)

    def PlaybackDevice(self, path: str) -> Any:  # noqa: N802 - the SDK's name
        if self._broken:
            raise RuntimeError("Error reading version line")
        self.log.append(f"open {path}")
        return SimpleNamespace(get_playback_status=lambda: self.OBPlaybackStatus.STOPPED)

    def AlignFilter(self, to: str) -> Any:  # noqa: N802 - the SDK's name
        return SimpleNamespace(process=lambda frames: self.log.append(f"align to {to}") or frames)

    def Config(self) -> Any:  # noqa: N802 - the SDK's name
        return SimpleNamespace(
            enable_stream=lambda sensor: self.log.append(f"enable {sensor}"),
            set_frame_aggregate_output_mode=lambda mode: self.log.append(f"mode {mode}"),
        )

    def Pipeline(self, device: Any) -> Any:  # noqa: N802 - the SDK's name
        coming = deque(self._shown)

        def wait_for_frames(timeout_ms: int) -> SoftwareFrames | None:
            assert timeout_ms > 0
            shown = coming.popleft() if coming else None
            if isinstance(shown, Exception):
                raise shown
            if callable(shown):
                shown()
                return None
            return shown

        self.log.append(f"device {device}" if isinstance(device, str) else "playback")
        return SimpleNamespace(
            start=lambda config: self.log.append("start"),  # noqa: ARG005 - as the SDK has it
            stop=lambda: self.log.append("stop"),
            wait_for_frames=wait_for_frames,
        )
