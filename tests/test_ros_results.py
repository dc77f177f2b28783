"""Results as messages of ROS: the same pose, its covariance in ROS' order, and a lost object that has no pose."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.software_ros import Node, SoftwareRos
from tracker.concept import ConceptModel
from tracker.errors import ConfigError
from tracker.frame import Provenance
from tracker.geometry import Pose
from tracker.result import TrackResult, TrackState
from tracker.ros_results import PosePublisher, ros_covariance, ros_names

POSE = Pose.exp([0.4, -0.3, 2.5, 0.1, -0.05, 0.7])
STAMP_NS = 1_700_000_000_123_456_789
COVARIANCE = np.diag([1.0, 2, 3, 4, 5, 6]) + np.arange(36).reshape(6, 6) * 0.01
TRACKED = TrackResult(
    STAMP_NS, "soup_can", POSE, TrackState.TRACKING, 0.875, COVARIANCE, "tracked", None, None, {"total": 20.0}
)
LOST = replace(TRACKED, pose=None, state=TrackState.LOST, confidence=0.0, covariance=None, reason="out of view")
OPTICAL = "camera_color_optical_frame"


def published(model: ConceptModel, *results: TrackResult, vision: bool = True) -> dict[str, list[Any]]:
    """What was sent on every topic for one frame, whose own stamp is that of the results."""
    ros, node = SoftwareRos(vision), Node("conceptrack")
    models = [replace(model, object_id=result.object_id) for result in results]
    publisher = PosePublisher(ros, node, models, lambda: OPTICAL)
    moved = [replace(result, stamp_ns=7) for result in results]  # as after a clock that began anew
    publisher.add(0, Provenance(name=str(STAMP_NS)), moved)
    return {topic: each.sent for topic, each in node.publishers.items()}


def pose_of(message: Any) -> Pose:
    turn, at = message.orientation, message.position
    return Pose.from_quaternion([turn.w, turn.x, turn.y, turn.z], [at.x, at.y, at.z])


def assert_stamped(message: Any) -> None:
    assert message.header.frame_id == OPTICAL
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(STAMP_NS, 10**9)


def test_the_covariance_is_of_shift_then_turn_about_fixed_axes() -> None:
    """By what the numbers mean: small motions drawn from ours, and the same poses told as ROS tells them."""
    rng = np.random.default_rng(0)
    scale = np.array([3e-3, 1e-3, 2e-3, 5e-3, 2e-3, 1e-3])
    mixing = rng.normal(size=(6, 6)) * scale[:, None]
    told = []
    for motion in rng.normal(size=(4000, 6)) @ mixing.T:
        moved = POSE.nudged(motion)
        fixed_axes_rad = Rotation.from_matrix(moved.rotation @ POSE.rotation.T).as_euler("xyz")
        told.append([*(moved.translation_m - POSE.translation_m), *fixed_axes_rad])
    ours = np.reshape(ros_covariance(mixing @ mixing.T), (6, 6))
    assert np.abs(np.cov(np.array(told).T) - ours).max() < 0.1 * ours.max()
    spread = np.sqrt(np.diag(ours))
    assert np.allclose(np.std(told, axis=0), spread, rtol=0.1)
    assert ros_covariance(COVARIANCE)[0] == COVARIANCE[3, 3]
    assert ros_covariance(COVARIANCE)[3] == COVARIANCE[3, 0]


def test_a_tracked_object_has_a_pose_a_transform_and_a_detection(can_model: ConceptModel) -> None:
    sent = published(can_model, TRACKED)
    assert set(sent) == {"~/soup_can/pose", "/tf", "~/detections", "/diagnostics"}
    (stamped,) = sent["~/soup_can/pose"]
    assert_stamped(stamped)
    assert np.allclose(pose_of(stamped.pose).matrix, POSE.matrix)

    (transform,) = sent["/tf"][0].transforms
    assert_stamped(transform)
    assert transform.child_frame_id == "soup_can"
    turn, at = transform.transform.rotation, transform.transform.translation
    read = Pose.from_quaternion([turn.w, turn.x, turn.y, turn.z], [at.x, at.y, at.z])
    assert np.allclose(read.matrix, POSE.matrix)

    (array,) = sent["~/detections"]
    assert_stamped(array)
    (detection,) = array.detections
    assert_stamped(detection)
    (hypothesis,) = detection.results
    assert (hypothesis.hypothesis.class_id, hypothesis.hypothesis.score) == ("soup_can", 0.875)
    assert np.allclose(pose_of(hypothesis.pose.pose).matrix, POSE.matrix)
    assert hypothesis.pose.covariance == ros_covariance(COVARIANCE)


def test_the_box_of_a_detection_holds_all_points_of_the_model(can_model: ConceptModel) -> None:
    (array,) = published(can_model, TRACKED)["~/detections"]
    box = array.detections[0].bbox
    in_box = pose_of(box.center).inverse() @ (POSE @ can_model.points.astype(float))
    half = np.array([box.size.x, box.size.y, box.size.z]) / 2
    assert (np.abs(in_box) <= half + 1e-9).all()
    assert np.allclose(np.abs(in_box).max(axis=0), half)


def test_a_lost_object_has_no_pose_but_a_state_and_a_reason(can_model: ConceptModel) -> None:
    mug = replace(TRACKED, object_id="mug")
    sent = published(can_model, LOST, mug)
    assert sent["~/soup_can/pose"] == []
    assert [t.child_frame_id for t in sent["/tf"][0].transforms] == ["mug"]
    assert [d.id for d in sent["~/detections"][0].detections] == ["mug"]
    (told,) = sent["/diagnostics"]
    assert_stamped(told)
    lost, tracked = told.status
    assert (lost.name, lost.hardware_id) == ("conceptrack: soup_can", "soup_can")
    assert (lost.level, tracked.level) == (1, 0)
    assert lost.message == "lost: out of view"
    values = {each.key: each.value for each in lost.values}
    assert values == {"state": "lost", "confidence": "0.000", "reason": "out of view", "ms": "20.0"}


def test_nothing_found_is_said_too(can_model: ConceptModel) -> None:
    sent = published(can_model, LOST)
    assert (sent["/tf"], sent["~/detections"][0].detections) == ([], [])
    assert len(sent["/diagnostics"]) == 1


def test_without_vision_msgs_all_else_is_published(can_model: ConceptModel) -> None:
    assert set(published(can_model, TRACKED, vision=False)) == {"~/soup_can/pose", "/tf", "/diagnostics"}


def test_names_are_such_as_ros_allows() -> None:
    assert ros_names(["mug", "1", "tea box", "_x"]) == {
        "mug": "mug",
        "1": "object_1",
        "tea box": "tea_box",
        "_x": "object__x",
    }
    with pytest.raises(ConfigError, match="tea box, tea-box have the same names in ROS: tea_box, tea_box"):
        ros_names(["tea box", "tea-box"])
