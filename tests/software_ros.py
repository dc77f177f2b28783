"""A stand-in for rclpy and the messages, which are not on PyPI: one process, topics that a test talks to.

Messages have the fields of ROS' own definitions (of rosbags, vision_msgs' written down here) and refuse any other."""

from __future__ import annotations

import queue
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
VISION = {
    "ObjectHypothesis": "string class_id\nfloat64 score",
    "ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "Detection3D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox3D bbox\nstring id",
    "Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections",
}
for _name, _fields in VISION.items():
    STORE.register(get_types_from_msg(_fields, f"vision_msgs/msg/{_name}"))

BASE, NAMED, ARRAY, SEQUENCE = 1, 2, 3, 4  # of rosbags' definitions


class Message:
    """With the defaults of rclpy: zeros, empty texts and lists."""

    def __init__(self, name: str, /, **given: Any) -> None:
        object.__setattr__(self, "type_name", name)
        for field, (kind, told) in STORE.fielddefs[name][1]:
            object.__setattr__(self, field, _default(int(kind), told))
        for field, value in given.items():
            setattr(self, field, value)

    def __setattr__(self, field: str, value: Any) -> None:
        assert hasattr(self, field), f"{self.type_name} has no field {field}"
        before = getattr(self, field)
        assert isinstance(value, type(before)), f"{field} is {type(before).__name__}, got {value!r}"
        object.__setattr__(self, field, value)

    def __getattr__(self, field: str) -> Any:
        raise AttributeError(field)


def _default(kind: int, told: Any) -> Any:
    if kind == NAMED:
        return Message(told)
    if kind in (ARRAY, SEQUENCE):
        return []
    name = told[0]
    return "" if name == "string" else 0.0 if name.startswith("float") else False if name == "bool" else 0


class MessageType:
    def __init__(self, name: str) -> None:
        self.name = name
        for constant, _, value in STORE.fielddefs[name][0]:
            setattr(self, constant, value)

    def __call__(self, **given: Any) -> Message:
        return Message(self.name, **given)

    def __getattr__(self, field: str) -> Any:
        raise AttributeError(field)


class Package:
    """`package.Name` is a type of messages."""

    def __init__(self, package: str) -> None:
        self._package = package

    def __getattr__(self, name: str) -> MessageType:
        return MessageType(f"{self._package}/msg/{name}")


class Publisher:
    def __init__(self, message_type: MessageType) -> None:
        self._type = message_type
        self.sent: list[Any] = []

    def publish(self, message: Message) -> None:
        assert message.type_name == self._type.name
        self.sent.append(message)


class Node:
    def __init__(self, name: str) -> None:
        self.name = name
        self.subscribed: dict[str, tuple[str, Callable[[Any], None], Any]] = {}
        self.publishers: dict[str, Publisher] = {}
        self.others: dict[str, int] = {}
        self.destroyed = False

    def create_subscription(self, kind: MessageType, topic: str, callback: Callable[[Any], None], qos: Any) -> None:
        self.subscribed[topic] = (kind.name, callback, qos)

    def create_publisher(self, kind: MessageType, topic: str, qos: int) -> Publisher:
        assert qos > 0
        return self.publishers.setdefault(topic, Publisher(kind))

    def count_publishers(self, topic: str) -> int:
        return self.others.get(topic, 0)

    def destroy_node(self) -> None:
        self.destroyed = True


class SoftwareRos(SimpleNamespace):
    """As `load_ros` gives it. `say` sends a message on a topic; None as the topic ends the context."""

    def __init__(self, vision: bool = True) -> None:
        self._said: queue.Queue[tuple[str | None, Any]] = queue.Queue()
        self._running, self.initialised, self.shut_down = False, 0, 0
        self.nodes: list[Node] = []
        super().__init__(
            rclpy=SimpleNamespace(
                ok=lambda: self._running,
                init=self._init,
                create_node=self._create_node,
                spin_once=self._spin_once,
                try_shutdown=self._shut_down,
            ),
            qos=SimpleNamespace(qos_profile_sensor_data="sensor data"),
            signals=SimpleNamespace(SignalHandlerOptions=SimpleNamespace(NO="none")),
            sensor_msgs=Package("sensor_msgs"),
            geometry_msgs=Package("geometry_msgs"),
            tf2_msgs=Package("tf2_msgs"),
            diagnostic_msgs=Package("diagnostic_msgs"),
            vision_msgs=Package("vision_msgs") if vision else None,
        )

    def say(self, topic: str | None, message: Any = None) -> None:
        self._said.put((topic, message))

    def _init(self, signal_handler_options: str) -> None:
        assert signal_handler_options == "none"
        self._running = True
        self.initialised += 1

    def _create_node(self, name: str) -> Node:
        self.nodes.append(Node(name))
        return self.nodes[-1]

    def _spin_once(self, node: Node, timeout_sec: float) -> None:
        try:
            topic, message = self._said.get(timeout=timeout_sec)
        except queue.Empty:
            return
        if topic is None:
            self._running = False
        elif topic in node.subscribed:
            node.subscribed[topic][1](message)

    def _shut_down(self) -> None:
        self._running = False
        self.shut_down += 1
