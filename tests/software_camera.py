"""A RealSense camera without hardware: the SDK's own software device, shown pictures by a test."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tracker.frame import Frame
from tracker.geometry import Intrinsics

rs: Any = pytest.importorskip("pyrealsense2")

UNIT_M = 0.0001  # so that depth of a rendered scene loses less than its noise


class SoftwareCamera:
    """A device for `RealSenseCamera`; `show` is what happens before its lens.

    baseline_m: how far the depth camera is to the left of the colour camera. period_ms: between two pictures.
    """

    def __init__(
        self,
        colour: Intrinsics,
        depth: Intrinsics | None = None,
        *,
        baseline_m: float = 0.0,
        serial: str = "soft-1",
        unit_m: float = UNIT_M,
        period_ms: float = 1000 / 30,
        colour_format: Any = rs.format.rgb8,
        distortion: tuple[Any, Sequence[float]] = (rs.distortion.brown_conrady, (0.0,) * 5),
        clock: Any = rs.timestamp_domain.hardware_clock,
    ) -> None:
        self.device = rs.software_device()
        self.device.register_info(rs.camera_info.name, "software camera")
        self.device.register_info(rs.camera_info.serial_number, serial)
        self._unit_m, self._period_ms, self._clock = unit_m, period_ms, clock
        self._sensors = {"depth": self.device.add_sensor("Depth"), "colour": self.device.add_sensor("Color")}
        pinhole = (rs.distortion.brown_conrady, (0.0,) * 5)
        streams = {
            "depth": _stream(rs.stream.depth, rs.format.z16, 2, depth or colour, pinhole if depth else distortion),
            "colour": _stream(
                rs.stream.color, colour_format, 2 if colour_format == rs.format.yuyv else 3, colour, distortion
            ),
        }
        self._profiles = {kind: self._sensors[kind].add_video_stream(stream) for kind, stream in streams.items()}
        self._sensors["depth"].add_read_only_option(rs.option.depth_units, unit_m)
        between = rs.extrinsics()
        between.rotation, between.translation = list(np.eye(3).ravel()), [baseline_m, 0.0, 0.0]
        self._profiles["depth"].register_extrinsics_to(self._profiles["colour"], between)
        self.shown = 0

    def wait_until_open(self) -> None:
        """What is shown before a sensor is open nobody sees."""
        for _ in range(2000):
            if all(sensor.get_active_streams() for sensor in self._sensors.values()):
                time.sleep(0.1)  # opened is not yet started
                return
            time.sleep(0.005)
        raise AssertionError("nobody opened the camera")

    def show(
        self,
        rgb: npt.NDArray[np.uint8] | None,
        depth_m: npt.NDArray[np.floating] | None,
        stamp_ms: float | None = None,
        depth_stamp_ms: float | None = None,
    ) -> None:
        """One picture of each stream, None: that one stays away. The stamps count up by the period if not given."""
        stamp_ms = 1000 + self.shown * self._period_ms if stamp_ms is None else stamp_ms
        self.shown += 1
        if depth_m is not None:
            raw = np.round(depth_m / self._unit_m).astype(np.uint16)
            self._send("depth", raw, stamp_ms if depth_stamp_ms is None else depth_stamp_ms)
        if rgb is not None:
            self._send("colour", rgb, stamp_ms)

    def show_frame(self, frame: Frame, stamp_ms: float | None = None) -> None:
        self.show(frame.rgb, frame.depth_m, stamp_ms)

    def _send(self, kind: str, picture: npt.NDArray, stamp_ms: float) -> None:
        sent: Any = rs.software_video_frame()
        sent.pixels = np.ascontiguousarray(picture)
        sent.bpp = picture.itemsize * (picture.shape[2] if picture.ndim == 3 else 1)
        sent.stride = picture.shape[1] * sent.bpp
        sent.timestamp, sent.domain, sent.frame_number = stamp_ms, self._clock, self.shown
        sent.profile = self._profiles[kind].as_video_stream_profile()
        if kind == "depth":
            sent.depth_units = self._unit_m
        self._sensors[kind].on_video_frame(sent)


def _stream(kind: Any, pixels: Any, bytes_px: int, camera: Intrinsics, distortion: tuple[Any, Sequence[float]]) -> Any:
    model = rs.intrinsics()
    model.width, model.height = camera.width, camera.height
    model.fx, model.fy, model.ppx, model.ppy = camera.fx, camera.fy, camera.cx, camera.cy
    model.model, model.coeffs = distortion[0], list(distortion[1])
    stream = rs.video_stream()
    stream.type, stream.index, stream.uid = kind, 0, int(kind)
    stream.width, stream.height, stream.fps = camera.width, camera.height, 30
    stream.bpp, stream.fmt, stream.intrinsics = bytes_px, pixels, model
    return stream
