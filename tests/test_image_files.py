"""Pictures on disk: what was written comes back in RGB and metres, and what is damaged is named."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from tracker.errors import SourceError
from tracker.sources.image_files import read_depth_m, read_labels, read_mask, read_rgb

RGB = np.random.default_rng(0).integers(0, 256, (20, 30, 3), np.uint8)


def write(path: Path, picture: npt.NDArray, *, colours: str = "") -> Path:
    """colours: the order of the picture's channels, "rgb" is turned into the order that the writer expects."""
    assert cv2.imwrite(str(path), picture[:, :, ::-1] if colours == "rgb" else picture)
    return path


def test_a_png_comes_back_in_rgb_bit_by_bit(tmp_path: Path) -> None:
    read = read_rgb(write(tmp_path / "a.png", RGB, colours="rgb"))
    assert read.dtype == np.uint8
    assert read.flags.c_contiguous
    assert np.array_equal(read, RGB)


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg", ".JPG"])
def test_red_is_the_first_channel_of_a_jpeg(tmp_path: Path, suffix: str) -> None:
    red = np.broadcast_to(np.array([250, 20, 10], np.uint8), (16, 16, 3))
    assert np.abs(read_rgb(write(tmp_path / f"a{suffix}", red, colours="rgb")).astype(int) - red).max() < 6


def test_a_gray_picture_is_rgb_of_equal_channels(tmp_path: Path) -> None:
    gray = write(tmp_path / "a.png", RGB[:, :, 0])
    assert np.array_equal(read_rgb(gray), np.repeat(RGB[:, :, :1], 3, axis=2))


def test_a_picture_stays_as_the_sensor_has_it_whatever_its_orientation_tag_says(tmp_path: Path) -> None:
    path = write(tmp_path / "a.jpg", RGB, colours="rgb")
    upright, data = read_rgb(path), path.read_bytes()
    quarter_turn = b"II*\0" + struct.pack("<IHHHIHHI", 8, 1, 0x0112, 3, 1, 6, 0, 0)
    segment = b"Exif\0\0" + quarter_turn
    path.write_bytes(data[:2] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + data[2:])
    assert np.array_equal(read_rgb(path), upright)


@pytest.mark.parametrize("metres_per_unit", [0.001, 0.0001, 0.00025, 1.0])
def test_depth_is_metres_of_the_stored_units_and_nothing_stays_nothing(tmp_path: Path, metres_per_unit: float) -> None:
    raw = np.array([[0, 1, 843], [10_000, 32_768, 65_535]], np.uint16)
    depth_m = read_depth_m(write(tmp_path / "a.png", raw), metres_per_unit)
    assert depth_m.dtype == np.float32
    assert np.allclose(depth_m, raw.astype(float) * metres_per_unit, rtol=1e-6, atol=0)
    assert depth_m[0, 0] == 0


@pytest.mark.parametrize("metres_per_unit", [0.0, -0.001, float("nan"), float("inf")])
def test_a_depth_scale_that_is_no_length_is_refused(tmp_path: Path, metres_per_unit: float) -> None:
    path = write(tmp_path / "a.png", np.full((4, 4), 800, np.uint16))
    with pytest.raises(SourceError, match=r"a\.png: the depth scale must be positive, got"):
        read_depth_m(path, metres_per_unit)


def test_a_colour_picture_is_not_depth(tmp_path: Path) -> None:
    with pytest.raises(
        SourceError,
        match=r"a\.png: a depth picture has one channel of .*, got uint8 \(20, 30, 3\)",
    ):
        read_depth_m(write(tmp_path / "a.png", RGB), 0.001)


@pytest.mark.parametrize("value", [1, 38, 255])
def test_any_value_but_nothing_is_the_object(tmp_path: Path, value: int) -> None:
    expected = np.zeros((20, 30), bool)
    expected[5:9, 7:20] = True
    gray = expected.astype(np.uint8) * np.uint8(value)
    blue = np.dstack((gray, np.zeros_like(gray), np.zeros_like(gray)))
    opaque = np.dstack((gray, gray, gray, np.full_like(gray, 255)))
    for picture in (gray, blue, opaque):
        mask = read_mask(write(tmp_path / "a.png", picture))
        assert mask.dtype == np.bool_
        assert np.array_equal(mask, expected)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.7, 0.97, 1.0])
def test_a_half_written_picture_is_an_error_however_much_of_it_there_is(
    tmp_path: Path, suffix: str, share: float
) -> None:
    path = write(tmp_path / f"a{suffix}", RGB)
    whole = path.read_bytes()
    path.write_bytes(whole[: min(int(share * len(whole)), len(whole) - 1)])
    for read in (read_rgb, read_mask, lambda p: read_depth_m(p, 0.001)):
        with pytest.raises(SourceError, match=rf"a\{suffix}: the file is truncated \(\d+ bytes"):
            read(path)


def test_what_is_no_picture_or_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"none\.png: cannot be read \(No such file"):
        read_rgb(tmp_path / "none.png")
    (tmp_path / "text.png").write_bytes(b"nothing to see IEND\xaeB`\x82")
    with pytest.raises(SourceError, match=r"text\.png: not a picture that can be decoded"):
        read_rgb(tmp_path / "text.png")
    (tmp_path / "empty.bmp").touch()
    with pytest.raises(SourceError, match=r"empty\.bmp: not a picture that can be decoded \(0 bytes\)"):
        read_rgb(tmp_path / "empty.bmp")


def test_depth_that_is_packed_into_colours_is_read_where_it_may_be(tmp_path: Path) -> None:
    depth_mm = np.array([[0, 1, 255], [256, 843, 65_535]])
    packed = np.dstack((depth_mm % 256, depth_mm // 256, np.full_like(depth_mm, 9))).astype(np.uint8)
    path = write(tmp_path / "a.png", packed, colours="rgb")
    assert np.allclose(read_depth_m(path, 0.001, packed=True), depth_mm / 1000)
    with pytest.raises(SourceError, match="one channel of 8 or 16 bits"):
        read_depth_m(path, 0.001)
    plain = write(tmp_path / "b.png", depth_mm.astype(np.uint16))
    assert np.allclose(read_depth_m(plain, 0.001, packed=True), depth_mm / 1000)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_labels_are_the_stored_numbers_of_the_one_channel_or_of_red(tmp_path: Path, dtype: type[np.integer]) -> None:
    labels = np.array([[0, 1], [21, 255]], dtype)
    assert read_labels(write(tmp_path / "a.png", labels)).tolist() == labels.tolist()
    red = np.dstack((labels, np.full_like(labels, 7), np.full_like(labels, 9)))
    assert read_labels(write(tmp_path / "b.png", red, colours="rgb")).tolist() == labels.tolist()
