"""Image messages: every encoding is the picture that was put in, whatever its byte order; others are named."""

from __future__ import annotations

from array import array

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from tests.ros_bags import (
    COLOUR,
    DEPTH,
    START_NS,
    colour_picture,
    compressed,
    config_header,
    depth_picture,
    encoded,
    image,
)
from tracker.errors import SourceError
from tracker.sources.raw_frame import to_rgb
from tracker.sources.ros_images import kind_of, read_colour, read_depth, stamp_ns

RGB = colour_picture(7)
BGR = np.ascontiguousarray(RGB[:, :, ::-1])
OPAQUE = np.full((*RGB.shape[:2], 1), 255, np.uint8)
GRAY = np.full(RGB.shape[:2], 90, np.uint8)


def rgb_of(message: object) -> npt.NDArray[np.uint8]:
    return to_rgb(*read_colour(message, COLOUR), COLOUR)


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize(
    ("encoding", "picture", "expected"),
    [
        ("rgb8", RGB, RGB),
        ("bgr8", BGR, RGB),
        ("rgba8", np.dstack((RGB, OPAQUE)), RGB),
        ("bgra8", np.dstack((BGR, OPAQUE)), RGB),
        ("mono8", GRAY, np.dstack([GRAY] * 3)),
    ],
)
def test_raw_colour_is_rgb_whatever_the_order_and_the_padding(
    encoding: str, picture: npt.NDArray, expected: npt.NDArray, padding: int
) -> None:
    message = image(picture, encoding, padding=padding)
    assert kind_of(message).is_colour
    assert (rgb_of(message) == expected).all()


def test_data_may_be_an_array_of_bytes_as_a_running_node_has_them() -> None:
    message = image(RGB, "rgb8")
    for data in (array("B", message.data.tobytes()), message.data.tobytes()):
        message.data = data
        assert (rgb_of(message) == RGB).all()


@pytest.mark.parametrize(
    ("suffix", "form", "picture", "tolerance"),
    [
        (".jpg", "jpeg", BGR, 12),
        (".jpg", "rgb8; jpeg compressed bgr8", BGR, 12),
        (".jpg", "rgb8; jpeg compressed rgb8", RGB, 12),
        (".png", "bgr8; png compressed bgr8", BGR, 0),
        (".png", "png", BGR, 0),
    ],
)
def test_compressed_colour_is_rgb_by_what_its_format_says(
    suffix: str, form: str, picture: npt.NDArray, tolerance: int
) -> None:
    message = compressed(encoded(picture, suffix), form)
    assert kind_of(message).is_colour
    assert np.abs(rgb_of(message).astype(int) - RGB).max() <= tolerance


@pytest.mark.parametrize("bigendian", [False, True])
@pytest.mark.parametrize("padding", [0, 6])
def test_raw_depth_is_what_was_stored_in_either_byte_order(bigendian: bool, padding: int) -> None:
    metres = depth_picture(3).astype(np.float32) / 1000
    for picture, encoding in ((depth_picture(3), "16UC1"), (depth_picture(3), "mono16"), (metres, "32FC1")):
        message = image(picture, encoding, padding=padding, bigendian=bigendian)
        assert kind_of(message).is_depth
        stored, told = read_depth(message, DEPTH)
        assert told == encoding
        assert stored.dtype == picture.dtype
        assert (stored == picture).all()


@pytest.mark.parametrize("form", ["16UC1; compressedDepth", "16UC1; compressedDepth png"])
def test_compressed_depth_of_16_bits_is_behind_a_header_and_exact(form: str) -> None:
    message = compressed(config_header() + encoded(depth_picture(3), ".png"), form)
    assert kind_of(message).is_depth
    stored, encoding = read_depth(message, DEPTH)
    assert encoding == "16UC1"
    assert (stored == depth_picture(3)).all()
    plain, _ = read_depth(compressed(encoded(depth_picture(3), ".png"), "16UC1; png compressed "), DEPTH)
    assert (plain == depth_picture(3)).all()


def test_compressed_depth_of_floats_is_the_inverse_of_what_is_stored() -> None:
    """As the publisher has it: a = q (q + 1) of its quantisation q, b = 1 - a / (greatest depth)."""
    depth_m = np.linspace(0.4, 6, 36 * 48, dtype=np.float32).reshape(36, 48)
    a, depth_max_m = 100.0 * 101.0, 10.0
    b = 1 - a / depth_max_m
    inverse = (a / depth_m + b).round().astype(np.uint16)
    inverse[:, :5] = 0
    message = compressed(config_header(a, b) + encoded(inverse, ".png"), "32FC1; compressedDepth png")
    read, encoding = read_depth(message, DEPTH)
    assert (encoding, read.dtype) == ("32FC1", np.float32)
    assert (read[:, :5] == 0).all()
    assert np.abs(read - depth_m)[:, 5:].max() < 0.5 * 36 / a + 1e-4  # half a step of the inverse, at 6 m


def test_inverse_depth_that_means_nothing_is_none() -> None:
    stored = np.array([[0, 1, 2, 3]], np.uint16)
    message = compressed(config_header(1.0, 2.0) + encoded(stored, ".png"), "32FC1; compressedDepth png")
    assert read_depth(message, DEPTH)[0].tolist() == [[0, 0, 0, 1]]


def test_stamps_are_whole_nanoseconds_of_the_header() -> None:
    assert stamp_ns(image(RGB, "rgb8", START_NS + 1)) == START_NS + 1


def short(message: object) -> object:
    message.data = message.data[:-9]  # pyright: ignore[reportAttributeAccessIssue]
    return message


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (image(RGB, "bayer_rggb8"), "colour of encoding 'bayer_rggb8' is not read; rgb8, bgr8"),
        (image(depth_picture(0), "16UC1"), "colour of encoding '16UC1' is not read"),
        (image(RGB[:, :-1], "rgba8"), r"5076 bytes in rows of 141 are not a picture of 47 x 36 .* \(188 bytes a row\)"),
        (short(image(RGB, "rgb8")), "5175 bytes in rows of 144 are not a picture of 48 x 36 pixels in rgb8"),
        (compressed(encoded(BGR, ".png")[:-20], "png"), "truncated"),
        (compressed(encoded(BGR, ".jpg")[:-20], "jpeg"), "truncated"),
        (compressed(b"", "jpeg"), "not a picture"),
        (compressed(b"nothing of that kind", "jpeg"), "not a picture"),
    ],
)
def test_colour_that_cannot_be_read_is_named_with_its_topic(message: object, complaint: str) -> None:
    with pytest.raises(SourceError, match=f"{COLOUR}: .*{complaint}"):
        read_colour(message, COLOUR)


PNG = encoded(depth_picture(0), ".png")


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (image(RGB, "rgb8"), "depth of encoding 'rgb8' is not read; 16UC1, mono16, 32FC1"),
        (short(image(depth_picture(0), "16UC1")), "are not a picture of 48 x 36 pixels in 16UC1"),
        (compressed(encoded(GRAY, ".jpg"), "16UC1; jpeg compressed "), "cannot hold depth"),
        (compressed(config_header() + PNG, "16UC1; compressedDepth rvl"), "compressedDepth rvl' is not read"),
        (compressed(config_header()[:7], "16UC1; compressedDepth"), "7 bytes .* expected a header of 12"),
        (compressed(config_header() + PNG[:-30], "16UC1; compressedDepth png"), "truncated"),
        (compressed(config_header() + encoded(GRAY, ".png"), "16UC1; compressedDepth"), "one channel of 16 bits"),
        (compressed(PNG, "compressedDepth"), "depth of encoding 'compressedDepth' is not read"),
    ],
)
def test_depth_that_cannot_be_read_is_named_with_its_topic(message: object, complaint: str) -> None:
    with pytest.raises(SourceError, match=f"{DEPTH}: .*{complaint}"):
        read_depth(message, DEPTH)


def test_a_picture_that_its_orientation_tag_turns_stays_as_the_sensor_has_it() -> None:
    data = encoded(BGR, ".jpg")
    tag = b"\xff\xe1\x00\x22Exif\x00\x00MM\x00*\x00\x00\x00\x08\x00\x01\x01\x12\x00\x03\x00\x00\x00\x01\x00\x06\x00\x00"
    turned = data[:2] + tag + b"\x00\x00\x00\x00" + data[2:]
    by_tag = cv2.imdecode(np.frombuffer(turned, np.uint8), cv2.IMREAD_COLOR)
    assert by_tag is not None
    assert by_tag.shape[:2] == (48, 36)
    assert rgb_of(compressed(turned, "jpeg")).shape[:2] == (36, 48)
