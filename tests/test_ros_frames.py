"""A pair of messages and what was told of the camera -> a frame, or a sentence on what does not go together."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.ros_bags import (
    COLOUR,
    DEPTH,
    PERIOD_NS,
    START_NS,
    K,
    P,
    camera_info,
    colour_picture,
    depth_picture,
    image,
)
from tracker.errors import FrameError, SourceError
from tracker.sources.ros_frames import RosFrames, is_rectified

RECTIFIED = "/camera/color/image_rect_color"


def colour(k: int = 0, **changed: Any) -> Any:
    return image(colour_picture(k), "rgb8", START_NS + k * PERIOD_NS, **changed)


def depth(k: int = 0, skew_ns: int = 0, **changed: Any) -> Any:
    return image(depth_picture(k), "16UC1", START_NS + k * PERIOD_NS + skew_ns, **changed)


def frames(topic: str = COLOUR, info: Any = None, **options: Any) -> RosFrames:
    made = RosFrames("bag", topic, DEPTH, **options)
    made.tell_camera(info or camera_info())
    return made


def test_a_frame_has_the_colour_s_stamp_metres_and_where_it_came_from() -> None:
    frame = frames().frame(colour(2), depth(2, skew_ns=-3_000_000), 5)
    assert (frame.index, frame.stamp_ns) == (5, START_NS + 2 * PERIOD_NS)
    assert (frame.rgb == colour_picture(2)).all()
    assert frame.depth_m == pytest.approx(depth_picture(2) / 1000)
    assert frame.intrinsics.matrix.ravel().tolist() == list(K)
    told = frame.provenance
    assert (told.clock, told.colour_depth_skew_ns, told.raw_depth_unit_m) == ("recording", 3_000_000, 0.001)
    assert (told.source, told.name) == (f"bag {frame.stamp_ns}", str(frame.stamp_ns))


def test_the_unit_is_the_encoding_s_unless_the_user_says_another() -> None:
    metres = image(depth_picture(0).astype(np.float32) / 1000, "32FC1")
    assert frames().frame(colour(), metres, 0).depth_m == pytest.approx(depth_picture(0) / 1000)
    tenths = frames(depth_unit_m=0.0001).frame(colour(), depth(), 0)
    assert tenths.depth_m == pytest.approx(depth_picture(0) / 10_000)
    with pytest.raises(SourceError, match="must be positive, got 0"):
        frames(depth_unit_m=0.0).frame(colour(), depth(), 0)


def test_a_frame_shares_no_memory_with_the_messages() -> None:
    sent, measured = colour(), depth()
    frame = frames().frame(sent, measured, 0)
    sent.data[:], measured.data[:] = 0, 0
    assert (frame.rgb == colour_picture(0)).all()
    assert frame.depth_m == pytest.approx(depth_picture(0) / 1000)


@pytest.mark.parametrize(
    ("topic", "rectified"),
    [
        ("/camera/color/image_raw", False),
        ("/camera/color/image_rect", True),
        ("/camera/color/image_rect_color", True),
        ("/camera/color/image_rect/compressed", True),
        ("/kinect2/qhd/image_color_rect", True),
        ("/correct/image_raw", False),
    ],
)
def test_a_topic_is_rectified_by_its_name(topic: str, rectified: bool) -> None:
    assert is_rectified(topic) == rectified


def test_distortion_is_undone_for_raw_pictures_and_is_gone_already_from_rectified_ones() -> None:
    bent = camera_info(d=(-0.3, 0.1, 0.001, 0.0, 0.0), p=(50.0, 0, 22, 0, 0, 51, 18, 0, 0, 0, 1, 0))
    raw = frames(info=bent).frame(colour(), depth(), 0)
    assert raw.intrinsics.fx == K[0]
    assert (raw.rgb != colour_picture(0)).any()
    assert raw.depth_m[0, 4] > 0  # drawn from further in, where there is depth
    flat = frames(RECTIFIED, bent).frame(colour(), depth(), 0)
    assert flat.intrinsics.matrix.ravel().tolist() == [50, 0, 22, 0, 51, 18, 0, 0, 1]
    assert (flat.rgb == colour_picture(0)).all()


def test_a_camera_that_changes_is_used_from_its_stamp_on_though_it_is_told_later() -> None:
    made = frames()
    zoomed = camera_info(START_NS + 2 * PERIOD_NS, k=(90.0, 0, 23.5, 0, 91, 17, 0, 0, 1))
    made.tell_camera(camera_info(START_NS + PERIOD_NS))
    made.tell_camera(zoomed)
    assert [made.frame(colour(k), depth(k), k).intrinsics.fx for k in (0, 1, 2, 3)] == [60, 60, 90, 90]


def test_ros_1_has_its_fields_in_capitals() -> None:
    told = camera_info()
    info = SimpleNamespace(**{name.upper() if len(name) == 1 else name: value for name, value in vars(told).items()})
    assert not hasattr(info, "k")
    assert frames(info=info).frame(colour(), depth(), 0).intrinsics.matrix.ravel().tolist() == list(K)


def test_depth_of_another_camera_or_size_is_refused_with_what_to_record() -> None:
    other = depth(frame_id="camera_depth_optical_frame")
    with pytest.raises(
        SourceError,
        match=rf"the depth of {DEPTH} \(48x36 in 'camera_depth_optical_frame'\) is not registered to the colour of "
        rf"{COLOUR} \(48x36 in 'camera_color_optical_frame'\); record .*/camera/aligned_depth_to_color/image_raw",
    ):
        frames().frame(colour(), other, 0)
    assert frames(registered=True).frame(colour(), other, 0).depth_m.max() > 0
    smaller = image(depth_picture(0)[::2, ::2], "16UC1")
    with pytest.raises(SourceError, match=r"24x18 in .* not registered"):
        frames(registered=True).frame(colour(), smaller, 0)
    assert frames().frame(colour(frame_id="/a"), depth(frame_id="a"), 0)  # ROS 1 wrote it with a slash


@pytest.mark.parametrize(
    ("topic", "changed", "complaint"),
    [
        (COLOUR, {"k": (0.0,) * 9}, "K is all zeros: the camera is not calibrated"),
        (RECTIFIED, {"p": (0.0,) * 12}, "P is all zeros"),
        (COLOUR, {"k": (60.0, 0, 90, 0, 61, 17, 0, 0, 1)}, "principal point .* another resolution"),
        (COLOUR, {"distortion_model": "thin_prism", "d": (0.1,) * 4}, "'thin_prism' .* cannot be undistorted"),
        (COLOUR, {"d": (0.1, 0.2)}, "'plumb_bob' has .* coefficients, got 2"),
        (COLOUR, {"binning_x": 2}, r"binned \(2 x 0\)"),
        (COLOUR, {"roi": SimpleNamespace(x_offset=8, y_offset=0)}, r"cropped \(from pixel \(8, 0\)\)"),
    ],
)
def test_a_camera_that_pictures_cannot_be_read_with_is_refused(
    topic: str, changed: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(SourceError, match=f"bag: camera_info of {topic}: .*{complaint}"):
        frames(topic, camera_info(**changed))


def test_an_empty_model_without_coefficients_is_a_pinhole() -> None:
    assert frames(info=camera_info(distortion_model="", d=())).frame(colour(), depth(), 0).intrinsics.fx == K[0]
    assert P[0] == K[0]


def test_without_a_camera_or_with_one_of_another_size_there_is_no_frame() -> None:
    silent = RosFrames("bag", COLOUR, DEPTH)
    assert not silent.knows_camera
    with pytest.raises(SourceError, match=f"no camera_info came that belongs to {COLOUR}"):
        silent.frame(colour(), depth(), 0)
    doubled = camera_info(width=96, height=72, k=(120.0, 0, 47, 0, 122, 34, 0, 0, 1))
    with pytest.raises(FrameError, match=r"rgb has shape \(36, 48, 3\), expected \(72, 96, 3\)"):
        frames(info=doubled).frame(colour(), depth(), 0)
