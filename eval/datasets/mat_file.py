"""Arrays of numbers in MATLAB's level 5 files, read strictly: sizes are checked before anything is made of them.

`scipy.io.loadmat` reads more kinds, but may end the whole program at a file whose tags are damaged.
https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tracker.errors import SourceError

HEADER_BYTES = 128
BYTE_ORDERS = {b"IM": "<", b"MI": ">"}
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}  # miINT8 ..
MATRIX, COMPRESSED = 14, 15
NUMERIC_CLASSES = range(6, 16)  # mxDOUBLE_CLASS .. mxUINT64_CLASS
COMPLEX = 0x0800
LARGEST_FIELD = 1 << 24  # bytes that a field may decompress to: any list of poses, and YCB-Video's maps of vertices


def read_arrays(path: Path, names: Collection[str]) -> dict[str, npt.NDArray]:
    """The arrays of these names, those that are there. Raises SourceError where the file cannot be read, is of another
    level, or damaged; and where one of the names is no array of real numbers."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SourceError(f"{path}: cannot be read ({error.strerror})") from error
    order = BYTE_ORDERS.get(data[126:HEADER_BYTES])
    if not data.startswith(b"MATLAB 5.0 MAT-file") or order is None:
        raise SourceError(f"{path}: not a MATLAB 5 file ({len(data)} bytes)")
    try:
        return dict(_arrays(data[HEADER_BYTES:], order, names))
    except (ValueError, struct.error, zlib.error) as error:
        raise SourceError(f"{path}: the MATLAB file is damaged ({error})") from error


def _arrays(data: bytes, order: str, names: Collection[str]) -> Iterator[tuple[str, npt.NDArray]]:
    for kind, content in _elements(data, order, padded=False):
        if kind == COMPRESSED:
            inflater = zlib.decompressobj()
            content = inflater.decompress(content, LARGEST_FIELD)
            if inflater.unconsumed_tail:
                continue  # larger than any field that is asked for
            kind, content = next(_elements(content, order), (0, b""))
        if kind == MATRIX:
            parts = list(_elements(content, order))
            name = parts[2][1].decode("latin-1") if len(parts) > 2 else ""
            if name in names:
                yield name, _array(name, parts, order)


def _array(name: str, parts: list[tuple[int, bytes]], order: str) -> npt.NDArray:
    """parts: flags, dimensions, name, and the numbers, column by column."""
    flags = struct.unpack_from(f"{order}I", parts[0][1])[0]
    shape = np.frombuffer(parts[1][1], f"{order}i4").tolist()
    kind, stored = parts[3] if len(parts) == 4 else (0, b"")
    if flags & 0xFF not in NUMERIC_CLASSES or flags & COMPLEX or kind not in NUMBERS:
        raise ValueError(f"field {name} is no array of real numbers")
    values = np.frombuffer(stored, f"{order}{NUMBERS[kind]}")
    if min(shape, default=0) < 0 or math.prod(shape) != len(values):
        raise ValueError(f"field {name} has {len(values)} numbers, its shape is {shape}")
    return values.astype(values.dtype.newbyteorder("=")).reshape(shape, order="F")


def _elements(data: bytes, order: str, *, padded: bool = True) -> Iterator[tuple[int, bytes]]:
    """Type and content of each; up to four bytes stand within the tag."""
    at = 0
    while at < len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        begin, step = at + 8, 8 + size
        if kind >> 16:
            kind, size, begin, step = kind & 0xFFFF, kind >> 16, at + 4, 8
        if size > (4 if step == 8 and begin == at + 4 else len(data) - begin):
            raise ValueError(f"an element of {size} bytes at byte {at} does not fit in")
        yield kind, data[begin : begin + size]
        at += step + (-step % 8 if padded else 0)
