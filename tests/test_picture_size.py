"""What a picture claims to be is known before it is decoded, and believed only within reason."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.errors import SourceError
from tracker.sources.image_files import read_rgb
from tracker.sources.picture_size import PNG_START, picture_size

SIDES = st.integers(1, 70)


def chunk(kind: bytes, content: bytes, length: int | None = None) -> bytes:
    crc = struct.pack(">I", zlib.crc32(kind + content))
    return struct.pack(">I", len(content) if length is None else length) + kind + content + crc


def png(width: int, height: int, length: int | None = None) -> bytes:
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return PNG_START + header + chunk(b"IDAT", zlib.compress(b"\0" * 100), length) + chunk(b"IEND", b"")


@given(width=SIDES, height=SIDES, suffix=st.sampled_from((".png", ".jpg")), colours=st.booleans())
def test_it_is_the_size_that_the_picture_has(width: int, height: int, suffix: str, colours: bool) -> None:
    picture = np.zeros((height, width, 3) if colours else (height, width), np.uint8)
    _, data = cv2.imencode(suffix, picture)
    assert picture_size(data.tobytes()) == (width, height)


@given(st.binary(max_size=200), st.sampled_from((b"", PNG_START, b"\xff\xd8")))
def test_whatever_else_it_is_has_a_size_or_none(data: bytes, start: bytes) -> None:
    size = picture_size(start + data)
    assert size is None or len(size) == 2


@pytest.mark.parametrize(("width", "height"), [(100_000, 100_000), (2**31 - 1, 1), (1, 2**25 + 1)])
def test_a_size_that_no_camera_has_is_refused_before_there_is_memory_for_it(
    width: int, height: int, tmp_path: Path
) -> None:
    (tmp_path / "a.png").write_bytes(png(width, height))
    with pytest.raises(SourceError, match=rf"a\.png: a picture of {width} x {height} pixels, expected at most"):
        read_rgb(tmp_path / "a.png")
    jpeg = b"\xff\xd8\xff\xc0\x00\x11\x08\xff\xff\xff\xff\x03\x01\x22\x00\x02\x11\x01\x03\x11\x01\xff\xd9"
    (tmp_path / "a.jpg").write_bytes(jpeg)
    with pytest.raises(SourceError, match=r"a\.jpg: a picture of 65535 x 65535 pixels"):
        read_rgb(tmp_path / "a.jpg")


def test_a_chunk_that_claims_more_than_the_file_has_is_refused(tmp_path: Path) -> None:
    assert picture_size(png(6, 5)) == (6, 5)
    (tmp_path / "a.png").write_bytes(png(6, 5, length=1 << 30))
    with pytest.raises(SourceError, match=r"a\.png: not a picture that can be decoded"):
        read_rgb(tmp_path / "a.png")
    assert picture_size(png(6, 5)[:-12] + chunk(b"IEND", b"", 1 << 30)) is None
    assert picture_size(png(6, 5).replace(b"IDAT", b"IxAT")) is None
    assert picture_size(png(6, 5) + b"what follows is nobody's") == (6, 5)


def test_other_kinds_of_pictures_are_refused_as_their_size_is_not_known(tmp_path: Path) -> None:
    assert cv2.imwrite(str(tmp_path / "a.bmp"), np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(SourceError, match=r"a\.bmp: not a picture .* expected a PNG or a JPEG"):
        read_rgb(tmp_path / "a.bmp")
