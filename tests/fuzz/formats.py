"""Damage of binary files behind their checksums and headers: what random bytes would hardly ever reach."""

from __future__ import annotations

import json
import sqlite3
import struct
import zlib
from io import BytesIO
from typing import Any

import numpy as np
from scipy.io import loadmat, savemat

from tests.fuzz.damage import EXTREMES, FLOATS, Rng, damaged
from tests.fuzz.trees import change
from tests.fuzz.words import reworded

PNG_START = b"\x89PNG\r\n\x1a\n"
DTYPES = ("F64", "F32", "F16", "BF16", "I64", "I32", "U8", "BOOL", "F8_E4M3", "X")


def changed_png(data: bytes, rng: Rng) -> bytes:
    """The header claims another size or kind, or pixels decompress to something else; checksums are right."""
    if rng.random() < 0.5 or not data.startswith(PNG_START):
        return damaged(data, rng)
    header = bytearray(data[16:29])
    field = int(rng.integers(6))
    if field < 2:
        sizes = (0, 1, 3, 47, 8000, 20_000, 40_000, 100_000, 10**6, 2**31 - 1, 2**32 - 1)
        header[4 * field : 4 * field + 4] = int(rng.choice(sizes)).to_bytes(4, "big")
    else:
        header[6 + field] = int(rng.choice((0, 1, 2, 3, 4, 6, 8, 16, 255)))
    whole = PNG_START + _chunk(b"IHDR", bytes(header)) + data[33:]
    if rng.random() < 0.3:
        pixels = damaged(bytes(2000), rng) if rng.random() < 0.5 else bytes(10**6)
        whole = whole[:33] + _chunk(b"IDAT", zlib.compress(pixels)) + _chunk(b"IEND", b"")
    return whole


def _chunk(kind: bytes, content: bytes) -> bytes:
    return len(content).to_bytes(4, "big") + kind + content + zlib.crc32(kind + content).to_bytes(4, "big")


def changed_model(data: bytes, rng: Rng) -> bytes:
    """A concept model: the header of safetensors, or the JSON of the model within it, is another; or numbers are."""
    what = rng.random()
    length = int.from_bytes(data[:8], "little")
    header, body = json.loads(data[8 : 8 + length]), data[8 + length :]
    if what < 0.25:
        return damaged(data, rng)
    if what < 0.7:
        text = header["__metadata__"]["concept_model"]
        header["__metadata__"]["concept_model"] = json.dumps(change(json.loads(text), rng))
    elif what < 0.85:
        header = change(header, rng)
    elif what < 0.93:
        name = str(rng.choice([name for name in header if name != "__metadata__"]))
        header[name]["dtype"] = str(rng.choice(DTYPES))
    else:
        body = _with_other_number(body, rng)
    told = header if isinstance(header, bytes) else json.dumps(header).encode()
    return len(told).to_bytes(8, "little") + told + body


def _with_other_number(body: bytes, rng: Rng) -> bytes:
    there = int(rng.integers(len(body) // 8)) * 8
    return body[:there] + struct.pack("<d", FLOATS[rng.integers(len(FLOATS))]) + body[there + 8 :]


def changed_mat(data: bytes, rng: Rng) -> bytes:
    """MATLAB's file with a field of another type or shape."""
    if rng.random() < 0.5:
        return damaged(data, rng)
    fields = {name: value for name, value in loadmat(BytesIO(data)).items() if not name.startswith("__")}
    name = list(fields)[rng.integers(len(fields))]
    value = fields[name]
    others: tuple[Any, ...] = (
        None, "text", np.array([]), np.zeros((0, 3)), value.astype(complex), value.astype(str), value.astype(object),
        value.ravel(), value[..., None, None], np.full_like(value, 255), value.astype(float) * np.nan,
        -value.astype(float),
        value.astype(float) * 1e300, np.array(EXTREMES[rng.integers(len(EXTREMES))], np.uint64), {"a": value},
        value.T, [value, "x"],
        value.astype(bool), np.tile(value, 3),
    )  # fmt: skip
    fields[name] = others[rng.integers(len(others))]
    held = BytesIO()
    savemat(held, {name: value for name, value in fields.items() if value is not None})
    return damaged(held.getvalue(), rng) if rng.random() < 0.1 else held.getvalue()


def changed_ply(data: bytes, rng: Rng) -> bytes:
    """A header with other words, before the same body."""
    end = data.find(b"end_header")
    if rng.random() < 0.4 or end < 0:
        return damaged(data, rng)
    return reworded(data[:end], rng) + data[end:]


def changed_sqlite(data: bytes, rng: Rng) -> bytes:
    """A database of ROS 2 that is whole, of which a message or a topic is not."""
    if rng.random() < 0.5:
        return damaged(data, rng)
    connection = sqlite3.connect(":memory:")
    connection.deserialize(data)
    rows = connection.execute("SELECT id, data FROM messages").fetchall()
    number, message = rows[rng.integers(len(rows))]
    what = rng.random()
    if what < 0.7:
        connection.execute("UPDATE messages SET data = ? WHERE id = ?", (damaged(message, rng), number))
    elif what < 0.85:
        column = ("name", "type", "serialization_format", "offered_qos_profiles")[rng.integers(4)]
        value = ("x", "", "sensor_msgs/msg/Image", 5, b"\xff")[rng.integers(5)]
        connection.execute(f"UPDATE topics SET {column} = ? WHERE id = 1", (value,))  # noqa: S608 - one of four names
    else:
        value = ("x", -1, 2**62, 1.5, b"\0")[rng.integers(5)]
        connection.execute("UPDATE messages SET timestamp = ? WHERE id = ?", (value, number))
    connection.commit()
    return connection.serialize()
