"""ROS image messages -> arrays. A message is whatever has the fields of sensor_msgs, of rclpy, rosbags or a test.

https://docs.ros.org/en/rolling/p/sensor_msgs/ (Image, CompressedImage), REP 118 (depth), and for compressedDepth
https://github.com/ros-perception/image_transport_plugins (compressed_depth_image_transport)
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from tracker.errors import SourceError
from tracker.sources.image_files import decode_image

# encoding -> the order of `raw_frame.COLOUR_ORDERS`, bytes a pixel
COLOUR_ENCODINGS: Mapping[str, tuple[str, int]] = {
    "rgb8": ("rgb", 3),
    "bgr8": ("bgr", 3),
    "rgba8": ("rgba", 4),
    "bgra8": ("bgra", 4),
    "mono8": ("gray", 1),
    "yuv422_yuy2": ("yuyv", 2),
    "yuv422": ("uyvy", 2),
}
DEPTH_ENCODINGS: Mapping[str, str] = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
CONFIG_HEADER = struct.Struct("<iff")  # of compressedDepth: the kind of compression, and the two numbers it needs


@dataclass(frozen=True, slots=True)
class Kind:
    """What a message says of itself. encoding: of its pixels. transport: raw, compressed or compressedDepth."""

    encoding: str
    transport: str

    @property
    def is_depth(self) -> bool:
        return self.transport == "compressedDepth" or self.encoding in DEPTH_ENCODINGS

    @property
    def is_colour(self) -> bool:
        return not self.is_depth and (self.transport == "compressed" or self.encoding in COLOUR_ENCODINGS)

    def __str__(self) -> str:
        return self.encoding if self.transport == "raw" else f"{self.encoding} {self.transport}".strip()


def kind_of(message: Any) -> Kind:
    """Of an Image or a CompressedImage, whose format is like "16UC1; compressedDepth png" or "rgb8; jpeg compressed
    bgr8", or only "jpeg"."""
    if hasattr(message, "encoding"):
        return Kind(message.encoding, "raw")
    encoding, separator, rest = message.format.partition(";")
    transport = "compressedDepth" if "compressedDepth" in (rest or encoding) else "compressed"
    return Kind(encoding.strip() if separator else "", transport)


def stamp_ns(message: Any) -> int:
    """Of the message's header: when the picture was taken, not when it was recorded."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def read_colour(message: Any, where: str) -> tuple[npt.NDArray[np.uint8], str]:
    """The picture and the order of its channels, one of `raw_frame.COLOUR_ORDERS`; its memory is the message's.

    Raises SourceError, which begins with `where`, for another encoding and for data that are not whole.
    """
    kind = kind_of(message)
    if kind.transport == "raw" and kind.encoding in COLOUR_ENCODINGS:
        order, channels = COLOUR_ENCODINGS[kind.encoding]
        pixels = _pixels(message, np.dtype("u1"), channels, where)
        return (pixels[:, :, 0] if channels == 1 else pixels), order
    if kind.is_colour:
        data = bytes(message.data)
        picture = decode_image(data, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION, where)
        stored_rgb = message.format.partition("compressed")[2].strip().startswith("rgb")
        return np.asarray(picture, np.uint8), "rgb" if stored_rgb else "bgr"
    raise SourceError(f"{where}: colour of encoding {str(kind)!r} is not read; {', '.join(COLOUR_ENCODINGS)} are")


def read_depth(message: Any, where: str) -> tuple[npt.NDArray, str]:
    """The stored depth, (H, W) uint16 or float32, and its encoding, which says the unit (`raw_depth.CONVENTIONS`).

    Raises SourceError, which begins with `where`, for another encoding and for data that are not whole.
    """
    kind = kind_of(message)
    if kind.encoding not in DEPTH_ENCODINGS:
        raise SourceError(f"{where}: depth of encoding {str(kind)!r} is not read; {', '.join(DEPTH_ENCODINGS)} are")
    if kind.transport == "compressedDepth":
        return _compressed_depth(message, kind, where), kind.encoding
    if kind.transport == "compressed":
        if kind.encoding == "32FC1" or "jpeg" in message.format or "jpg" in message.format:
            raise SourceError(
                f"{where}: a picture {message.format!r} cannot hold depth; record the raw or the compressedDepth topic"
            )
        return _decode_16_bits(bytes(message.data), where), kind.encoding
    dtype = np.dtype(DEPTH_ENCODINGS[kind.encoding])
    return _pixels(message, dtype, 1, where)[:, :, 0], kind.encoding


def _pixels(message: Any, dtype: np.dtype, channels: int, where: str) -> npt.NDArray:
    """(H, W, channels) in the byte order of this machine; rows are `step` bytes apart, which may be more than they
    need."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.frombuffer(message.data, np.uint8)
    row_bytes = width * channels * dtype.itemsize
    if min(height, width) < 1 or step < row_bytes or len(data) < step * (height - 1) + row_bytes:
        raise SourceError(
            f"{where}: {len(data)} bytes in rows of {step} are not a picture of {width} x {height} pixels in "
            f"{message.encoding} ({row_bytes} bytes a row)"
        )
    stored = dtype.newbyteorder(">" if message.is_bigendian else "<")
    strides = (step, channels * dtype.itemsize, dtype.itemsize)
    pixels = np.ndarray((height, width, channels), stored, data, strides=strides)
    return pixels.astype(dtype, copy=False)


def _compressed_depth(message: Any, kind: Kind, where: str) -> npt.NDArray:
    data = bytes(message.data)
    if "rvl" in message.format.lower():
        raise SourceError(f"{where}: depth {message.format!r} is not read; record the raw topic, or png")
    if len(data) < CONFIG_HEADER.size:
        raise SourceError(f"{where}: {len(data)} bytes of {message.format!r}, expected a header of 12 and a picture")
    _, quantum_a, quantum_b = CONFIG_HEADER.unpack_from(data)
    stored = _decode_16_bits(data[CONFIG_HEADER.size :], where)
    if kind.encoding != "32FC1":
        return stored
    # Stored is the inverse depth, b + a / depth, so that near depth is finer; 0 is none.
    apart = stored.astype(np.float32) - np.float32(quantum_b)
    there = (stored > 0) & (apart > 0)
    return np.where(there, np.float32(quantum_a) / np.where(there, apart, np.float32(1)), np.float32(0))


def _decode_16_bits(data: bytes, where: str) -> npt.NDArray:
    stored = decode_image(data, cv2.IMREAD_UNCHANGED, where)
    if stored.ndim != 2 or stored.dtype != np.uint16:
        raise SourceError(f"{where}: depth is a picture of one channel of 16 bits, got {stored.dtype} {stored.shape}")
    return stored
