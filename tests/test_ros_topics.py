"""Which topics are meant: those that can only be it, or those that are named; anything else lists what there is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.ros_bags import CAMERA_INFO, COLOUR, COMPRESSED, DEPTH, FRAME_ID, IMAGE, INFO
from tracker.errors import SourceError
from tracker.sources.ros_images import Kind
from tracker.sources.ros_topics import Chosen, Topic, choose_topics

SIZE = (640, 480)
DEPTH_FRAME = "camera_depth_optical_frame"
OF_COLOUR = Topic(COLOUR, IMAGE, 90, Kind("rgb8", "raw"), FRAME_ID, SIZE)
OF_DEPTH = Topic(DEPTH, IMAGE, 90, Kind("16UC1", "raw"), FRAME_ID, SIZE)
OF_INFO = Topic(INFO, CAMERA_INFO, 90, None, FRAME_ID, SIZE)
OWN_DEPTH = Topic("/camera/depth/image_rect_raw", IMAGE, 90, Kind("16UC1", "raw"), DEPTH_FRAME, (848, 480))
OWN_INFO = Topic("/camera/depth/camera_info", CAMERA_INFO, 90, None, DEPTH_FRAME, (848, 480))
INFRARED = Topic("/camera/infra1/image_rect_raw", IMAGE, 90, Kind("mono8", "raw"), DEPTH_FRAME, (848, 480))
OTHERS = [
    Topic("/tf", "tf2_msgs/msg/TFMessage", 900),
    Topic("/camera/color/image_raw/compressed", COMPRESSED, 90, Kind("rgb8", "compressed"), FRAME_ID),
    Topic(f"{DEPTH}/compressedDepth", COMPRESSED, 90, Kind("16UC1", "compressedDepth"), FRAME_ID),
    Topic("/camera/aligned_depth_to_color/camera_info", CAMERA_INFO, 90, None, FRAME_ID, SIZE),
    Topic("/second/image_raw", IMAGE, 0),
]
USUAL = [OF_DEPTH, OF_COLOUR, OF_INFO, OWN_DEPTH, OWN_INFO, INFRARED, *OTHERS]


def test_the_topics_of_a_usual_camera_are_found() -> None:
    assert choose_topics("bag", USUAL) == Chosen(COLOUR, DEPTH, INFO)


def test_compressed_topics_are_found_where_there_are_no_raw_ones() -> None:
    topics = [topic for topic in USUAL if topic not in (OF_COLOUR, OF_DEPTH)]
    chosen = choose_topics("bag", topics)
    assert (chosen.colour, chosen.depth) == ("/camera/color/image_raw/compressed", f"{DEPTH}/compressedDepth")
    assert chosen.info == INFO


def test_gray_is_colour_where_there_is_no_other() -> None:
    own = [INFRARED, replace(OWN_DEPTH, size=(848, 480)), OWN_INFO]
    with pytest.raises(SourceError, match="no topic has a CameraInfo of the colour camera"):
        choose_topics("bag", [INFRARED, OWN_DEPTH])
    assert choose_topics("bag", own).colour == INFRARED.name


def test_a_camera_whose_info_is_elsewhere_is_found_by_its_frame() -> None:
    info = replace(OF_INFO, name="/info")
    assert choose_topics("bag", [OF_COLOUR, OF_DEPTH, info, OWN_INFO]).info == "/info"


def test_what_is_named_is_taken_though_several_could_be_meant() -> None:
    second = replace(OF_COLOUR, name="/second/image_raw")
    topics = [*USUAL[:-1], second]
    with pytest.raises(SourceError, match=rf"several topics could be the colour: {COLOUR} \(rgb8 640x480 in .*, 90\)"):
        choose_topics("bag", topics)
    with pytest.raises(SourceError, match=r"/second/image_raw .*; say \?colour=TOPIC"):
        choose_topics("bag", topics)
    assert choose_topics("bag", topics, colour=COLOUR) == Chosen(COLOUR, DEPTH, INFO)
    named = choose_topics("bag", topics, COLOUR, OWN_DEPTH.name, OWN_INFO.name)
    assert named == Chosen(COLOUR, OWN_DEPTH.name, OWN_INFO.name)
    twice = [*USUAL, replace(OF_DEPTH, name="/other/depth")]
    with pytest.raises(SourceError, match=rf"several topics could be the depth: {DEPTH} .*, /other/depth"):
        choose_topics("bag", twice)


def test_depth_that_is_not_registered_is_refused_with_what_to_record() -> None:
    topics = [OF_COLOUR, OF_INFO, OWN_DEPTH]
    with pytest.raises(
        SourceError,
        match=rf"none of the depth topics \({OWN_DEPTH.name} .*\) is registered to the colour .*aligned_depth",
    ):
        choose_topics("bag", topics)
    same_size = replace(OWN_DEPTH, size=SIZE)
    assert choose_topics("bag", [OF_COLOUR, OF_INFO, same_size], registered=True).depth == OWN_DEPTH.name


def test_of_rectified_and_raw_depth_that_of_the_colour_s_kind_is_taken() -> None:
    rectified = replace(OF_DEPTH, name="/camera/depth_registered/image_rect")
    raw = replace(OF_DEPTH, name="/camera/depth_registered/image_raw")
    of_rectified = replace(OF_COLOUR, name="/camera/color/image_rect_color")
    assert choose_topics("bag", [OF_COLOUR, OF_INFO, rectified, raw]).depth == raw.name
    assert choose_topics("bag", [of_rectified, OF_INFO, rectified, raw]).depth == rectified.name


@pytest.mark.parametrize(
    ("topics", "asked", "complaint"),
    [
        ([OF_DEPTH, OF_INFO], {}, rf"no topic has colour pictures; the topics are {DEPTH} "),
        ([OF_COLOUR, OF_INFO], {}, rf"no topic has depth pictures; the topics are {COLOUR} "),
        ([], {}, "no topic has colour pictures; the topics are none"),
        ([OTHERS[0]], {}, r"the topics are /tf \(TFMessage, 900\)"),
        (USUAL, {"colour": "/cam"}, rf"colour=/cam is not there; the topics are {DEPTH}"),
        (USUAL, {"colour": DEPTH}, f"colour={DEPTH} is no such topic"),
        (USUAL, {"depth": COLOUR}, f"depth={COLOUR} is no such topic"),
        (USUAL, {"info": COLOUR}, f"info={COLOUR} is no such topic"),
        (USUAL, {"colour": "/second/image_raw"}, "is not there"),
    ],
)
def test_what_is_not_there_is_answered_with_what_is(topics: list[Topic], asked: dict[str, str], complaint: str) -> None:
    with pytest.raises(SourceError, match=f"bag: .*{complaint}"):
        choose_topics("bag", topics, asked.get("colour"), asked.get("depth"), asked.get("info"))
