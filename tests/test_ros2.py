"""Topics of a running ROS become frames; a silent one is named; results are published. rclpy is a stand-in."""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import tracker.__main__
import tracker.sources.ros2
from tests.ros_bags import (
    COLOUR,
    DEPTH,
    FRAME_ID,
    INFO,
    PERIOD_NS,
    START_NS,
    camera_info,
    colour_picture,
    compressed,
    depth_picture,
    encoded,
    image,
)
from tests.software_ros import SoftwareRos
from tracker.concept import ConceptModel
from tracker.errors import MissingExtraError, SourceError
from tracker.frame import Frame
from tracker.sources import LiveSource, RosSource, open_source
from tracker.sources.ros2 import Ros2Camera, Topics, beside
from tracker.sources.ros2.camera import AGAIN_S, SILENT_S, Watchdog

TOPICS = Topics(COLOUR, DEPTH, INFO)


@pytest.fixture
def ros(monkeypatch: pytest.MonkeyPatch) -> SoftwareRos:
    made = SoftwareRos()
    monkeypatch.setattr(tracker.sources.ros2, "load_ros", lambda: made)
    return made


def opened(name: str = "ros2") -> Ros2Camera:
    camera = open_source(name)
    assert isinstance(camera, Ros2Camera)
    return camera


def say(ros: SoftwareRos, *numbers: int, late_ns: int = 0) -> None:
    """The k-th picture of both streams; late: of the depth."""
    for k in numbers:
        stamp_ns = START_NS + k * PERIOD_NS
        ros.say(COLOUR, image(colour_picture(k), "rgb8", stamp_ns))
        ros.say(DEPTH, image(depth_picture(k), "16UC1", stamp_ns + late_ns))


def numbers(frames: list[Frame]) -> list[int]:
    for frame in frames:
        assert frame.depth_m == pytest.approx(depth_picture(int(frame.rgb[0, 0, 0])) / 1000)
    return [int(frame.rgb[0, 0, 0]) for frame in frames]


def test_pictures_become_frames_one_by_one_and_the_node_ends_with_them(ros: SoftwareRos) -> None:
    camera = opened()
    assert isinstance(camera, LiveSource)
    assert isinstance(camera, RosSource)
    frames: Iterator[Frame] = iter(camera)
    say(ros, 0)  # before the camera is known nothing can be made of it
    ros.say(INFO, camera_info())
    seen = []
    for k in (1, 2, 3):
        say(ros, k, late_ns=2_000_000)
        seen.append(next(frames))  # at once, without waiting for the next picture
    assert numbers(seen) == [1, 2, 3]
    assert seen[0].stamp_ns == START_NS + PERIOD_NS
    assert seen[0].provenance.colour_depth_skew_ns == -2_000_000
    assert camera.frame_id == FRAME_ID
    (node,) = ros.nodes
    assert {topic: kind.rpartition("/")[2] for topic, (kind, _, _) in node.subscribed.items()} == {
        COLOUR: "Image",
        DEPTH: "Image",
        INFO: "CameraInfo",
    }
    assert {qos for _, _, qos in node.subscribed.values()} == {"sensor data"}
    camera.stop()
    assert list(frames) == []
    assert set(camera.left_out.values()) == {0}
    assert (node.destroyed, ros.initialised, ros.shut_down) == (True, 1, 1)
    assert not [thread for thread in threading.enumerate() if thread.name == "ros2"]


def test_a_context_of_somebody_else_is_left_alone(ros: SoftwareRos) -> None:
    ros.rclpy.init(signal_handler_options="none")
    camera = opened()
    camera.stop()
    assert list(camera) == []
    assert (ros.initialised, ros.shut_down) == (1, 0)


def test_frames_end_with_the_context(ros: SoftwareRos) -> None:
    camera = opened()
    ros.say(INFO, camera_info())
    say(ros, 1)
    ros.say(None)
    assert numbers(list(camera)) == [1]


def test_topics_units_and_compression_are_options(ros: SoftwareRos) -> None:
    camera = opened("ros2?colour=/rgb/compressed&depth=/depth&info=/camera&depth_unit=0.0001&registered=yes&slop=0.1")
    ros.say("/camera", camera_info())
    png = encoded(colour_picture(1)[:, :, ::-1], ".png")
    ros.say("/rgb/compressed", compressed(png, "rgb8; png compressed bgr8", START_NS))
    ros.say("/depth", image(depth_picture(1), "16UC1", START_NS + 90_000_000, frame_id="other"))
    ros.say("/rgb/compressed", compressed(png, "rgb8; png compressed bgr8", START_NS + 300_000_000))
    frame = next(iter(camera))
    assert frame.depth_m == pytest.approx(depth_picture(1) / 10_000)
    assert ros.nodes[0].subscribed["/rgb/compressed"][0].endswith("CompressedImage")
    camera.stop()
    assert beside("/a/color/image_raw") == beside("/a/color/image_raw/compressed") == "/a/color/camera_info"


def test_depth_that_is_never_registered_ends_the_camera_with_what_to_record(ros: SoftwareRos) -> None:
    camera = opened()
    ros.say(INFO, camera_info())

    def show() -> None:
        for k in range(100_000):
            if camera._stopped.is_set():
                return
            ros.say(COLOUR, image(colour_picture(1), "rgb8", START_NS + k * PERIOD_NS))
            ros.say(DEPTH, image(depth_picture(1), "16UC1", START_NS + k * PERIOD_NS, frame_id="depth"))
            threading.Event().wait(0.001)

    other = threading.Thread(target=show)
    other.start()
    with pytest.raises(SourceError, match=r"30 frames in a row .* is not registered .*aligned_depth_to_color"):
        list(camera)
    other.join()


def test_a_camera_that_pictures_cannot_be_read_with_ends_the_frames(ros: SoftwareRos) -> None:
    ros.say(INFO, camera_info(k=(0.0,) * 9))
    with pytest.raises(SourceError, match="K is all zeros: the camera is not calibrated"):
        list(opened())


# The watchdog


def told(dog: Watchdog, now_s: float, **publishers: int) -> list[str]:
    return dog.warnings(now_s, lambda topic: publishers.get({COLOUR: "colour", DEPTH: "depth", INFO: "info"}[topic], 0))


def test_a_silent_topic_is_named_with_whether_anybody_publishes_it() -> None:
    dog = Watchdog(TOPICS, 0.0)
    assert told(dog, SILENT_S - 0.1) == []
    dog.heard(COLOUR, 3.0)
    dog.heard(INFO, 3.0)
    (warning,) = told(dog, 4.0, depth=1)
    assert warning.startswith(f"nothing on {DEPTH} for 4 s, though 1 publish it: do type and QoS fit")
    assert told(dog, 5.0) == []  # it was said just now
    dog.heard(COLOUR, 4.0 + AGAIN_S)
    (warning,) = told(dog, 4.0 + AGAIN_S)
    assert "nobody publishes it" in warning


def test_all_that_are_silent_are_named_and_a_camera_info_once_is_enough() -> None:
    dog = Watchdog(TOPICS, 0.0)
    assert [warning.split()[2] for warning in told(dog, 5.0)] == [COLOUR, DEPTH, INFO]
    dog.heard(INFO, 6.0)
    assert [warning.split()[2] for warning in told(dog, 20.0)] == [COLOUR, DEPTH]


def test_streams_that_come_and_never_meet_are_told_of() -> None:
    dog = Watchdog(TOPICS, 0.0)
    for topic in TOPICS:
        dog.heard(topic, 4.0)
    assert told(dog, 4.5) == [f"{COLOUR} and {DEPTH} come, but not within the slop of each other: say ?slop=SECONDS"]
    dog.paired(4.6)
    assert told(dog, 4.7 + AGAIN_S - AGAIN_S) == []


def test_the_camera_s_watchdog_speaks_in_the_log(ros: SoftwareRos, caplog: pytest.LogCaptureFixture) -> None:
    time_s = iter(range(0, 1_000_000, 2))
    camera = Ros2Camera(ros, TOPICS, "ros2", 20_000_000, now_s=lambda: float(next(time_s)))
    with caplog.at_level(logging.WARNING):
        reader = threading.Thread(target=lambda: list(camera))
        reader.start()
        for _ in range(1000):
            if DEPTH in caplog.text:
                break
            threading.Event().wait(0.01)
        camera.stop()
        reader.join()
    assert f"ros2: nothing on {DEPTH} for" in caplog.text


# As a source of the command


def test_without_ros_it_is_told_where_it_comes_from(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    with pytest.raises(MissingExtraError, match=r"not on PyPI; .* /opt/ros/DISTRO/setup\.bash"):
        open_source("ros2")


def test_the_command_tracks_and_publishes_until_it_is_interrupted(
    ros: SoftwareRos,
    can_model: ConceptModel,
    can_frames: list[Frame],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    can_model.save(tmp_path / "can.concept")
    camera = can_frames[0].intrinsics
    k = tuple(map(float, camera.matrix.ravel()))
    info = camera_info(width=camera.width, height=camera.height, k=k)

    def show() -> None:
        ros.say(INFO, info)
        for index, frame in enumerate(can_frames[:3]):
            ros.say(COLOUR, image(frame.rgb, "rgb8", START_NS + frame.stamp_ns))
            depth = (frame.depth_m * 1000).round().astype("uint16")
            ros.say(DEPTH, image(depth, "16UC1", START_NS + frame.stamp_ns))
            for _ in range(2000):  # until it is tracked
                if ros.nodes and len(sent(ros, "/diagnostics")) > index:
                    break
                threading.Event().wait(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    line = ["tracker", "ros2", "--model", str(tmp_path / "can.concept"), "--out", str(tmp_path / "out"), "--quiet"]
    monkeypatch.setattr(sys, "argv", line)
    other = threading.Thread(target=show)
    other.start()
    tracker.__main__.main()
    other.join()
    lines = [json.loads(each) for each in (tmp_path / "out" / "poses.jsonl").read_text().splitlines()]
    assert [each["stamp_ns"] for each in lines] == [START_NS + frame.stamp_ns for frame in can_frames[:3]]
    states = [{v.key: v.value for v in told.status[0].values}["state"] for told in sent(ros, "/diagnostics")]
    assert states == [each["state"] for each in lines]
    poses = [each for each in lines if each["T_cam_obj"]]
    stamped = sent(ros, "~/soup_can/pose")
    assert [message.pose.position.z for message in stamped] == [p["T_cam_obj"]["translation_m"][2] for p in poses]
    assert len(poses) >= 1
    assert {message.header.frame_id for message in stamped} == {FRAME_ID}


def sent(ros: SoftwareRos, topic: str) -> list[Any]:
    (node,) = ros.nodes
    return node.publishers[topic].sent if topic in node.publishers else []
