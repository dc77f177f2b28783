"""The size that a PNG or a JPEG claims, before anything of that size is made."""

from __future__ import annotations

import struct

PNG_START, JPEG_START = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
FRAME_HEADERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # SOF0 .. SOF15 without DHT, JPG and DAC
START_OF_SCAN = 0xDA


def picture_size(data: bytes) -> tuple[int, int] | None:
    """(width, height); None where the data are no PNG and no JPEG, are damaged, or end before that is told."""
    try:
        if data.startswith(PNG_START):
            return _png_size(data)
        return _jpeg_size(data) if data.startswith(JPEG_START) else None
    except struct.error:
        return None


def _png_size(data: bytes) -> tuple[int, int] | None:
    """Where every chunk fits into the data: a decoder makes room for what a chunk claims to hold."""
    at, kind, kinds = len(PNG_START), b"", set()
    while kind != b"IEND":
        kind = data[at + 4 : at + 8]
        kinds.add(kind)
        at += 12 + struct.unpack_from(">I", data, at)[0]
    whole = at <= len(data) and data[12:16] == b"IHDR" and b"IDAT" in kinds  # without it a decoder reads on
    return struct.unpack_from(">II", data, 16) if whole else None


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Of the largest frame that is told of before the first scan; a decoder goes by one of them."""
    at, found = 2, None
    while True:
        at = data.find(b"\xff", at)  # decoders skip what stands between two segments
        while at >= 0 and data[at : at + 1] == b"\xff":
            at += 1
        kind = data[at] if 0 <= at < len(data) else START_OF_SCAN
        if kind == START_OF_SCAN:
            return found
        if kind in FRAME_HEADERS:
            height, width = struct.unpack_from(">HH", data, at + 4)
            found = max(found or (0, 0), (width, height), key=lambda size: size[0] * size[1])
        standing_alone = kind in (0x00, 0x01) or 0xD0 <= kind <= 0xD9
        at += 1 if standing_alone else 1 + struct.unpack_from(">H", data, at + 1)[0]
