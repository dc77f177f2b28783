"""MATLAB's files: the numbers that others write come back, and what does not fit together is refused."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.io import savemat

from eval.datasets.mat_file import LARGEST_FIELD, read_arrays
from tracker.errors import SourceError

KINDS = [np.dtype(name) for name in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")]


@given(
    array=hnp.arrays(st.sampled_from(KINDS), hnp.array_shapes(min_dims=2, max_dims=3, min_side=0, max_side=4)),
    compressed=st.booleans(),
)
def test_numbers_of_every_type_and_shape_come_back(
    array: np.ndarray, compressed: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("mat") / "a.mat"
    savemat(path, {"of_a_long_name": array, "x": 5, "text": "abc"}, do_compression=compressed)
    found = read_arrays(path, ("of_a_long_name", "x", "nowhere"))
    assert sorted(found) == ["of_a_long_name", "x"]
    assert found["x"].tolist() == [[5]]
    assert np.array_equal(found["of_a_long_name"], array, equal_nan=array.dtype.kind == "f")


def write(path: Path, *elements: bytes) -> Path:
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"".join(elements))
    return path


def element(kind: int, content: bytes, size: int | None = None) -> bytes:
    padding = b"" if kind == 15 else bytes(-len(content) % 8)
    return struct.pack("<II", kind, len(content) if size is None else size) + content + padding


def matrix(shape: tuple[int, ...], stored: bytes, kind: int = 9, array_class: int = 6) -> bytes:
    parts = (struct.pack("<II", array_class, 0), struct.pack(f"<{len(shape)}i", *shape), b"a", stored)
    return element(14, b"".join(element(k, part) for k, part in zip((6, 5, 1, kind), parts, strict=True)))


def test_what_is_written_by_hand_is_read(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mat", matrix((2, 1), struct.pack("<2d", 1, 2)))
    assert read_arrays(path, ("a",))["a"].tolist() == [[1], [2]]


@pytest.mark.parametrize(
    ("elements", "complaint"),
    [
        ((matrix((2, 2), struct.pack("<2d", 1, 2)),), r"field a has 2 numbers, its shape is \[2, 2\]"),
        ((matrix((1 << 30, 1 << 30), b""),), "field a has 0 numbers"),
        ((matrix((-1, -2), struct.pack("<2d", 1, 2)),), "its shape is"),
        ((matrix((1, 1), b"x", kind=16),), "field a is no array of real numbers"),
        ((matrix((1, 1), b"x" * 8, array_class=2),), "field a is no array of real numbers"),
        ((element(14, b"12345678", size=1 << 31),), "does not fit in"),
        ((b"\1\2\3",), "requires a buffer"),
        ((element(15, b"not compressed"),), "incorrect header check"),
    ],
)
def test_what_does_not_fit_together_is_refused(elements: tuple[bytes, ...], complaint: str, tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=rf"a\.mat: the MATLAB file is damaged \(.*{complaint}"):
        read_arrays(write(tmp_path / "a.mat", *elements), ("a",))


def test_a_field_that_unpacks_to_more_than_any_has_is_not_unpacked(tmp_path: Path) -> None:
    bomb = element(15, zlib.compress(matrix((LARGEST_FIELD, 1), bytes(8 * LARGEST_FIELD)), 1))
    path = write(tmp_path / "a.mat", bomb, matrix((1, 1), struct.pack("<d", 7)))
    assert len(bomb) < LARGEST_FIELD
    assert read_arrays(path, ("a",))["a"].tolist() == [[7]]


def test_what_is_no_such_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"none\.mat: cannot be read"):
        read_arrays(tmp_path / "none.mat", ("a",))
    (tmp_path / "b.mat").write_bytes(b"\0" * 200)
    with pytest.raises(SourceError, match=r"b\.mat: not a MATLAB 5 file"):
        read_arrays(tmp_path / "b.mat", ("a",))
