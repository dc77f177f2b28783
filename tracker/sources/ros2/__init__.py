"""The camera topics of a running ROS 2, by rclpy, which comes with ROS and not from PyPI.

    ros2?colour=TOPIC&depth=TOPIC&info=TOPIC&depth_unit=0.001&slop=0.02&registered=yes

Topics that are not named are those of a RealSense node; CameraInfo is the one beside the colour. Messages become frames
as those of a bag do (`tracker.sources.ros_frames`).
"""

from __future__ import annotations

import importlib
from types import SimpleNamespace
from typing import Any

from tracker.errors import MissingExtraError
from tracker.sources.query import read_query
from tracker.sources.ros2.camera import Ros2Camera, Topics
from tracker.sources.ros_topics import OPTIONS, SLOP_S

__all__ = ["Ros2Camera", "Topics", "open_ros2"]

COLOUR, DEPTH = "/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw"


def open_ros2(argument: str) -> Ros2Camera:
    """Options alone. Raises MissingExtraError where there is no ROS 2."""
    name = f"ros2{argument}"
    given = read_query(name, argument.removeprefix("?"), OPTIONS)
    colour = given.get("colour", COLOUR)
    topics = Topics(colour, given.get("depth", DEPTH), given.get("info") or beside(colour))
    unit_m, registered = given.get("depth_unit"), given.get("registered", False)
    slop_ns = round(given.get("slop", SLOP_S) * 1e9)
    return Ros2Camera(load_ros(), topics, name, slop_ns, depth_unit_m=unit_m, registered=registered)


def beside(colour: str) -> str:
    """The CameraInfo of a colour topic, by the names that image_transport gives."""
    camera = colour.removesuffix("/compressed").rpartition("/")[0]
    return f"{camera}/camera_info"


def load_ros() -> Any:
    """rclpy and the messages that are used, each by its name. `Detection3DArray` is None without vision_msgs.

    Raises MissingExtraError where there is no ROS 2.
    """
    try:
        rclpy = importlib.import_module("rclpy")
        found: dict[str, Any] = {"rclpy": rclpy, "qos": importlib.import_module("rclpy.qos")}
        found["signals"] = importlib.import_module("rclpy.signals")
        for package in ("sensor_msgs", "geometry_msgs", "tf2_msgs", "diagnostic_msgs"):
            found[package] = importlib.import_module(f"{package}.msg")
    except ImportError as error:
        raise MissingExtraError(
            f"ros2 needs rclpy of ROS 2 ({error}), which is not on PyPI; start from a shell that has sourced "
            "/opt/ros/DISTRO/setup.bash, with a Python that ROS was built for"
        ) from error
    try:
        found["vision_msgs"] = importlib.import_module("vision_msgs.msg")
    except ImportError:
        found["vision_msgs"] = None  # poses are published without it
    return SimpleNamespace(**found)
