"""Pictures on disk -> arrays. A half-written file is an error here, not a half-gray picture later."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from tracker.errors import SourceError
from tracker.geometry import MOST_PIXELS
from tracker.sources.picture_size import picture_size
from tracker.sources.raw_depth import raw_to_metres, require_unit

PNG_END = b"IEND\xaeB`\x82"
JPEG_END = b"\xff\xd9"
END_MARKERS = {".png": PNG_END, ".jpg": JPEG_END, ".jpeg": JPEG_END}
GREEN, RED = 1, 2  # channels as OpenCV reads them


def read_rgb(path: Path) -> npt.NDArray[np.uint8]:
    """(H, W, 3) uint8, RGB."""
    # As the sensor has it: a picture that its orientation tag turns would no longer fit its depth.
    bgr = read_image(path, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    return np.ascontiguousarray(bgr[:, :, ::-1])


def read_depth_m(path: Path, metres_per_unit: float, *, packed: bool = False) -> npt.NDArray[np.float32]:
    """(H, W) float32 metres from a single-channel integer picture, 0 where there is none.

    packed: where the picture is of colours of 8 bits, green is the high byte and red the low one, as NOCS packs them.
    Raises SourceError if the scale is not positive: some recordings read back 0; `raw_depth.metres_per_unit` makes it
    of what a source states.
    """
    require_unit(metres_per_unit, str(path))  # before a picture is decoded
    raw = read_image(path, cv2.IMREAD_UNCHANGED)
    if packed and raw.ndim == 3 and raw.dtype == np.uint8:
        raw = raw[:, :, GREEN].astype(np.uint16) * 256 + raw[:, :, RED]
    return raw_to_metres(raw, metres_per_unit, str(path))


def read_mask(path: Path) -> npt.NDArray[np.bool_]:
    """(H, W) bool: any value or colour but 0 is the object, whatever the transparency."""
    raw = read_image(path, cv2.IMREAD_UNCHANGED)
    return np.asarray(raw if raw.ndim == 2 else raw[:, :, :3].max(axis=2)) > 0


def read_labels(path: Path) -> npt.NDArray[np.integer]:
    """(H, W) whole numbers as they are stored: of the one channel, of the red one where the picture is of colours."""
    raw = read_image(path, cv2.IMREAD_UNCHANGED)
    labels = raw if raw.ndim == 2 else raw[:, :, RED]
    if not np.issubdtype(labels.dtype, np.integer):
        raise SourceError(f"{path}: a picture of labels holds whole numbers, got {labels.dtype}")
    return labels


def decode_image(data: bytes, flag: int, where: str, end: bytes | None = None) -> npt.NDArray:
    """A PNG or JPEG, as `cv2.imdecode` gives it. Of other kinds the size is not known before they are decoded.

    end: the marker that has to be there; if None that of what the data begin like.
    Raises SourceError, which begins with `where`, for a picture that is not whole or cannot be decoded.
    """
    # OpenCV returns what it has of a truncated file and only warns, so the end marker is looked for.
    if end is None:
        end = PNG_END if data.startswith(b"\x89PNG") else JPEG_END if data.startswith(b"\xff\xd8") else b""
    if end not in data.rstrip(b"\0")[-64:]:
        raise SourceError(f"{where}: the file is truncated ({len(data)} bytes, no end marker)")
    size = picture_size(data)
    if size and size[0] * size[1] > MOST_PIXELS:
        raise SourceError(f"{where}: a picture of {size[0]} x {size[1]} pixels, expected at most {MOST_PIXELS}")
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flag) if size else None
    except cv2.error as error:
        raise SourceError(f"{where}: not a picture that can be decoded ({error})") from error
    if image is None:
        raise SourceError(f"{where}: not a picture that can be decoded ({len(data)} bytes); expected a PNG or a JPEG")
    return image


def read_image(path: Path, flag: int) -> npt.NDArray:
    """As `cv2.imread` gives it. Raises SourceError that names the file where it is missing, or not whole."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SourceError(f"{path}: cannot be read ({error.strerror})") from error
    return decode_image(data, flag, str(path), END_MARKERS.get(path.suffix.lower(), b""))


def in_order(files: Iterable[Path]) -> list[Path]:
    """By name, numbers by value."""
    listed = list(files)
    numbered = all(path.stem.isdecimal() for path in listed)
    return sorted(listed, key=lambda path: (int(path.stem) if numbered else 0, path.name))
