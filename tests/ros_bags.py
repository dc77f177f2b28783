"""What tests of ROS sources send and record: messages with the fields of sensor_msgs, and bags of three kinds."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

WIDTH, HEIGHT = 48, 36
K = (60.0, 0.0, 23.5, 0.0, 61.0, 17.0, 0.0, 0.0, 1.0)
P = (60.0, 0.0, 23.5, 0.0, 0.0, 61.0, 17.0, 0.0, 0.0, 0.0, 1.0, 0.0)
FRAME_ID = "camera_color_optical_frame"
COLOUR, DEPTH = "/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw"
INFO = "/camera/color/camera_info"
START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 33_333_333
BAGS = ("sqlite3", "mcap", "ros1")
IMAGE, COMPRESSED, CAMERA_INFO = (f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "CameraInfo"))


def header(stamp_ns: int, frame_id: str = FRAME_ID) -> Any:
    seconds, rest_ns = divmod(stamp_ns, 10**9)
    return SimpleNamespace(stamp=SimpleNamespace(sec=seconds, nanosec=rest_ns), frame_id=frame_id)


def image(
    picture: npt.NDArray,
    encoding: str,
    stamp_ns: int = START_NS,
    frame_id: str = FRAME_ID,
    padding: int = 0,
    bigendian: bool = False,
) -> Any:
    """padding: bytes after every row."""
    stored = picture.astype(picture.dtype.newbyteorder(">" if bigendian else "<"))
    rows = np.ascontiguousarray(stored).view(np.uint8).reshape(len(picture), -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
    return SimpleNamespace(
        header=header(stamp_ns, frame_id),
        height=picture.shape[0],
        width=picture.shape[1],
        encoding=encoding,
        is_bigendian=int(bigendian),
        step=rows.shape[1],
        data=rows.ravel(),
    )


def compressed(data: bytes, form: str, stamp_ns: int = START_NS, frame_id: str = FRAME_ID) -> Any:
    return SimpleNamespace(header=header(stamp_ns, frame_id), format=form, data=np.frombuffer(data, np.uint8))


def encoded(picture: npt.NDArray, suffix: str) -> bytes:
    """Of a picture with its channels as OpenCV has them: BGR."""
    done, data = cv2.imencode(suffix, picture)
    assert done
    return data.tobytes()


def config_header(a: float = 0.0, b: float = 0.0) -> bytes:
    """The twelve bytes before the picture of compressedDepth."""
    return struct.pack("<iff", 0, a, b)


def camera_info(stamp_ns: int = START_NS, frame_id: str = FRAME_ID, **changed: Any) -> Any:
    told = {
        "height": HEIGHT,
        "width": WIDTH,
        "distortion_model": "plumb_bob",
        "d": (0.0,) * 5,
        "k": K,
        "r": tuple(np.eye(3).ravel()),
        "p": P,
        "binning_x": 0,
        "binning_y": 0,
        "roi": SimpleNamespace(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    }
    return SimpleNamespace(header=header(stamp_ns, frame_id), **{**told, **changed})


def colour_picture(k: int) -> npt.NDArray[np.uint8]:
    """RGB; the k-th is k red everywhere, its green is the row, its blue the column."""
    rows, columns = np.indices((HEIGHT, WIDTH)).astype(np.uint8)
    return np.dstack((np.full_like(rows, k), rows, columns))


def depth_picture(k: int) -> npt.NDArray[np.uint16]:
    """Millimetres: 700 + k, and 0 in the first columns."""
    depth = np.full((HEIGHT, WIDTH), 700 + k, np.uint16)
    depth[:, :5] = 0
    return depth


@dataclass
class Recorded:
    """A message as it is written: on which topic, and when the recorder got it."""

    topic: str
    msgtype: str
    message: Any
    received_ns: int = 0


@dataclass
class Camera:
    """A camera of `frames` pictures; skew: stamp of the depth minus that of the colour."""

    frames: int = 4
    skew_ns: int = 0
    without_colour: Sequence[int] = ()
    without_depth: Sequence[int] = ()
    infos: Sequence[Any] = field(default_factory=lambda: [camera_info()])

    def messages(self) -> list[Recorded]:
        """In the order in which they are stamped."""
        recorded = [Recorded(INFO, CAMERA_INFO, info, START_NS - 1000 + k) for k, info in enumerate(self.infos)]
        for k in range(self.frames):
            stamp_ns = START_NS + k * PERIOD_NS
            if k not in self.without_colour:
                recorded.append(Recorded(COLOUR, IMAGE, image(colour_picture(k), "rgb8", stamp_ns), stamp_ns + 1))
            if k not in self.without_depth:
                stamp_ns += self.skew_ns
                recorded.append(Recorded(DEPTH, IMAGE, image(depth_picture(k), "16UC1", stamp_ns), stamp_ns + 2))
        return recorded


def write_bag(folder: Path, kind: str, messages: Iterable[Recorded]) -> Path:
    """kind: sqlite3, mcap or ros1. The path that a user would give."""
    folder.mkdir(parents=True, exist_ok=True)
    if kind == "ros1":
        store, path = get_typestore(Stores.ROS1_NOETIC), folder / "recording.bag"
        writer, serialize = rosbag1.Writer(path), store.serialize_ros1
    else:
        store, path = get_typestore(Stores.ROS2_HUMBLE), folder / "recording"
        plugin = {"sqlite3": rosbag2.StoragePlugin.SQLITE3, "mcap": rosbag2.StoragePlugin.MCAP}[kind]
        writer, serialize = rosbag2.Writer(path, version=9, storage_plugin=plugin), store.serialize_cdr
    with writer:
        connections: dict[str, Any] = {}
        for each in messages:
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(each.topic, each.msgtype, typestore=store)
            data = serialize(_typed(store, each.msgtype, each.message), each.msgtype)
            writer.write(connections[each.topic], each.received_ns, data)
    return path


def _typed(store: Any, msgtype: str, message: Any) -> Any:
    """The message as a type of the store, whose fields are in capitals in ROS 1."""
    fields: dict[str, Any] = {}
    for name, (_, described) in store.fielddefs[msgtype][1]:
        value = 0 if name == "seq" else getattr(message, name if hasattr(message, name) else name.lower())
        if isinstance(described, str):  # the name of a type
            value = _typed(store, described, value)
        elif isinstance(value, tuple):
            value = np.array(value, np.float64)
        fields[name] = value
    return store.types[msgtype](**fields)
