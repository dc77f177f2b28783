"""Damage of a file's bytes, whatever it holds."""

from __future__ import annotations

import gzip
import io
import zipfile
from collections.abc import Callable

import numpy as np

Rng = np.random.Generator
Damage = Callable[[bytes, Rng], bytes]

EXTREMES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 2**63 - 1, 2**64 - 1)
FLOATS = np.array((np.nan, np.inf, -np.inf, 1e38, -1e38, 1e-40))


def _zip_bomb() -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("arrays.npy", bytes(1 << 22))
    return held.getvalue()


OTHER_KINDS = (
    b"",
    b"\0" * 64,
    b"{}",
    b"[]",
    b"null",
    b"[" * 5000,
    b'{"a":' * 5000,
    b"- " * 5000,
    b"a: &a [x,x,x,x,x,x,x,x,x]\nb: &b [*a,*a,*a,*a,*a,*a,*a,*a,*a]\nc: &c [*b,*b,*b,*b,*b,*b,*b,*b,*b]\n"
    b"d: &d [*c,*c,*c,*c,*c,*c,*c,*c,*c]\ne: &e [*d,*d,*d,*d,*d,*d,*d,*d,*d]\nf: &f [*e,*e,*e,*e,*e,*e,*e,*e,*e]\n"
    b"g: &g [*f,*f,*f,*f,*f,*f,*f,*f,*f]\nh: &h [*g,*g,*g,*g,*g,*g,*g,*g,*g]\nseed: [*h,*h,*h,*h,*h,*h,*h,*h,*h]\n",
    "ein Text, in UTF-16\n1 2 3\n".encode("utf-16"),
    b"\xef\xbb\xbf1 2 3\n",
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\x01\x86\xa0\0\x01\x86\xa0\x10\0\0\0\0" + b"\0" * 8 + b"IEND\xaeB`\x82",
    b"\xff\xd8\xff\xc0\0\x11\x08\xff\xff\xff\xff\x03\x01\x22\0\x02\x11\x01\x03\x11\x01\xff\xd9",
    b"P6\n60000 60000\n255\n" + b"\0" * 64,
    b"BM" + (70).to_bytes(4, "little") + bytes(4) + (54).to_bytes(4, "little") + (40).to_bytes(4, "little")
    + (30000).to_bytes(4, "little") * 2 + (1).to_bytes(2, "little") + (24).to_bytes(2, "little") + bytes(40),
    b"ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty float x\nproperty float y\n"
    b"property float z\nend_header\n\0\0\0\0",
    b"\x7fELF\x02\x01\x01" + bytes(60),
    b"\x80\x04cos\nsystem\n(S'false'\ntR.",  # a pickle that would run a program
    b"SQLite format 3\0" + b"\0" * 84,
    gzip.compress(bytes(1 << 20)),
    _zip_bomb(),
)  # fmt: skip


def damaged(data: bytes, rng: Rng) -> bytes:
    """One to four kinds of damage, one after the other; now and then a file of another kind."""
    if rng.random() < 0.02:
        return OTHER_KINDS[rng.integers(len(OTHER_KINDS))]
    for _ in range(min(rng.geometric(0.5), 4)):
        data = DAMAGES[rng.integers(len(DAMAGES))](data, rng)
    return data


def _places(data: bytes, rng: Rng) -> tuple[int, int]:
    """A block, mostly a short one."""
    start = int(rng.integers(len(data) + 1))
    length = int(min(rng.geometric(0.02), len(data) - start))
    return start, start + length


def _flip_bits(data: bytes, rng: Rng) -> bytes:
    flipped = bytearray(data)
    for _ in range(int(rng.integers(1, 9)) if data else 0):
        flipped[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    return bytes(flipped)


def _truncate(data: bytes, rng: Rng) -> bytes:
    return data[: rng.integers(len(data) + 1)]


def _cut_out(data: bytes, rng: Rng) -> bytes:
    start, end = _places(data, rng)
    return data[:start] + data[end:]


def _repeat(data: bytes, rng: Rng) -> bytes:
    start, end = _places(data, rng)
    return data[:end] + data[start:end] * int(rng.integers(1, 50)) + data[end:]


def _splice(data: bytes, rng: Rng) -> bytes:
    start, end = _places(data, rng)
    there = int(rng.integers(len(data) + 1))
    return data[:there] + data[start:end] + data[there + end - start :]


def _fill(data: bytes, rng: Rng) -> bytes:
    start, end = _places(data, rng)
    filled = (bytes(end - start), b"\xff" * (end - start), rng.bytes(end - start))[rng.integers(3)]
    return data[:start] + filled + data[end:]


def _insert(data: bytes, rng: Rng) -> bytes:
    there = int(rng.integers(len(data) + 1))
    return data[:there] + rng.bytes(int(rng.geometric(0.1))) + data[there:]


def _extreme_number(data: bytes, rng: Rng) -> bytes:
    """In the place of what may be a size, an offset or a coordinate."""
    size = int(rng.choice((1, 2, 4, 8)))
    order = ("little", "big")[rng.integers(2)]
    number = (EXTREMES[rng.integers(len(EXTREMES))] % (1 << 8 * size)).to_bytes(size, order)
    if size >= 4 and rng.random() < 0.3:
        number = FLOATS[rng.integers(len(FLOATS))].astype(f"f{size}").tobytes()
    there = int(rng.integers(len(data) + 1)) // size * size
    return data[:there] + number + data[there + size :]


DAMAGES: tuple[Damage, ...] = (
    _flip_bits, _flip_bits, _truncate, _cut_out, _repeat, _splice, _fill, _insert, _extreme_number, _extreme_number,
)  # fmt: skip
