"""Results as messages of ROS 2, published by the node that the pictures come by.

    ~/OBJECT/pose   geometry_msgs/PoseStamped           only where there is a pose
    /tf             tf2_msgs/TFMessage                  from the camera's optical frame to OBJECT, likewise
    ~/detections    vision_msgs/Detection3DArray        all poses of a frame with confidence, covariance and box
    /diagnostics    diagnostic_msgs/DiagnosticArray     every object's state, confidence and reason, always

Poses are in the frame of the colour pictures, whose axes are OpenCV's, as REP 103 has it of optical frames.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tracker.concept import ConceptModel
from tracker.errors import ConfigError
from tracker.frame import Provenance
from tracker.geometry import Floats, Pose
from tracker.result import TrackResult, TrackState

SHIFT_THEN_TURN = np.array([3, 4, 5, 0, 1, 2])
QUEUE = 10


def ros_covariance(covariance: Floats) -> list[float]:
    """Of PoseWithCovariance, row by row: (x, y, z, turns about the fixed axes X, Y, Z).

    covariance: (6, 6) of a result, of (turn; shift) in camera axes about the object's origin. The turn is about fixed
    axes through the object's origin in both, so that the order alone is another.
    """
    return covariance[np.ix_(SHIFT_THEN_TURN, SHIFT_THEN_TURN)].ravel().tolist()


def ros_names(object_ids: Sequence[str]) -> dict[str, str]:
    """Object id -> what it is called in topics and frames: letters, digits and underscores, no digit first.

    Raises ConfigError where two objects would have one name.
    """
    names = {object_id: re.sub("[^A-Za-z0-9_]", "_", object_id) for object_id in object_ids}
    names = {object_id: name if re.match("[A-Za-z]", name) else f"object_{name}" for object_id, name in names.items()}
    if len(set(names.values())) < len(names):
        raise ConfigError(f"objects {', '.join(names)} have the same names in ROS: {', '.join(names.values())}")
    return names


class PosePublisher:
    """Publishes the results of every frame. ros: as `load_ros` gives it. frame_id: of the colour pictures, asked for
    at every frame; their stamp is the frame's name, as a tracker's time may have been moved."""

    def __init__(self, ros: Any, node: Any, models: Sequence[ConceptModel], frame_id: Callable[[], str]) -> None:
        self._ros, self._frame_id = ros, frame_id
        self._names = ros_names([model.object_id for model in models])
        self._boxes = {model.object_id: _box(model.points) for model in models}
        stamped = ros.geometry_msgs.PoseStamped
        self._poses: Mapping[str, Any] = {
            object_id: node.create_publisher(stamped, f"~/{name}/pose", QUEUE)
            for object_id, name in self._names.items()
        }
        self._transforms = node.create_publisher(ros.tf2_msgs.TFMessage, "/tf", QUEUE)
        self._diagnostics = node.create_publisher(ros.diagnostic_msgs.DiagnosticArray, "/diagnostics", QUEUE)
        detections = ros.vision_msgs.Detection3DArray if ros.vision_msgs else None
        self._detections = detections and node.create_publisher(detections, "~/detections", QUEUE)

    def add(self, frame_index: int, provenance: Provenance, results: Sequence[TrackResult]) -> None:  # noqa: ARG002
        stamp_ns = int(provenance.name)
        found = [(result, result.pose) for result in results if result.pose is not None]
        for result, pose in found:
            message = self._stamped(self._ros.geometry_msgs.PoseStamped(), stamp_ns)
            _fill_pose(message.pose, pose)
            self._poses[result.object_id].publish(message)
        if found:
            transforms = [self._transform(result, pose, stamp_ns) for result, pose in found]
            self._transforms.publish(self._ros.tf2_msgs.TFMessage(transforms=transforms))
        if self._detections:
            array = self._stamped(self._ros.vision_msgs.Detection3DArray(), stamp_ns)
            array.detections = [self._detection(result, pose, stamp_ns) for result, pose in found]
            self._detections.publish(array)
        told = self._stamped(self._ros.diagnostic_msgs.DiagnosticArray(), stamp_ns)
        told.status = [self._status(result) for result in results]
        self._diagnostics.publish(told)

    def _stamped(self, message: Any, stamp_ns: int) -> Any:
        message.header.frame_id = self._frame_id()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        return message

    def _transform(self, result: TrackResult, pose: Pose, stamp_ns: int) -> Any:
        message = self._stamped(self._ros.geometry_msgs.TransformStamped(), stamp_ns)
        message.child_frame_id = self._names[result.object_id]
        _fill(message.transform.translation, pose.translation_m)
        _fill_turn(message.transform.rotation, pose)
        return message

    def _detection(self, result: TrackResult, pose: Pose, stamp_ns: int) -> Any:
        message = self._stamped(self._ros.vision_msgs.Detection3D(), stamp_ns)
        message.id = result.object_id
        hypothesis = self._ros.vision_msgs.ObjectHypothesisWithPose()
        hypothesis.hypothesis.class_id, hypothesis.hypothesis.score = result.object_id, float(result.confidence)
        _fill_pose(hypothesis.pose.pose, pose)
        if result.covariance is not None:
            hypothesis.pose.covariance = ros_covariance(result.covariance)
        message.results = [hypothesis]
        centre_m, size_m = self._boxes[result.object_id]
        _fill_pose(message.bbox.center, Pose(pose.rotation, (pose @ centre_m[None])[0]))
        _fill(message.bbox.size, size_m)
        return message

    def _status(self, result: TrackResult) -> Any:
        kind = self._ros.diagnostic_msgs.DiagnosticStatus
        status = kind(name=f"conceptrack: {result.object_id}", hardware_id=result.object_id)
        status.level = kind.OK if result.state is TrackState.TRACKING else kind.WARN
        status.message = f"{result.state.value}: {result.reason}" if result.reason else result.state.value
        values = {"state": result.state.value, "confidence": f"{result.confidence:.3f}", "reason": result.reason}
        values["ms"] = f"{result.timings_ms['total']:.1f}"
        status.values = [self._ros.diagnostic_msgs.KeyValue(key=key, value=value) for key, value in values.items()]
        return status


def _box(points: Floats) -> tuple[Floats, Floats]:
    """Centre and size (3,), metres, in object coordinates and axes."""
    low, high = points.min(axis=0).astype(float), points.max(axis=0).astype(float)
    return (low + high) / 2, high - low


def _fill(message: Any, values: Floats) -> None:
    message.x, message.y, message.z = map(float, values)


def _fill_turn(message: Any, pose: Pose) -> None:
    message.w, message.x, message.y, message.z = map(float, pose.quaternion_wxyz)


def _fill_pose(message: Any, pose: Pose) -> None:
    _fill(message.position, pose.translation_m)
    _fill_turn(message.orientation, pose)
