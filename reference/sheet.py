"""A white sheet that pictures and lines of text are put on, and its PNG file."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from tracker.errors import OutputError

Picture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

INK, FAINT = (30, 30, 30), (120, 120, 120)
TEXT_SCALE = 1 / 38  # of OpenCV's font, a pixel of line height


class Sheet:
    """width, height: pixels. line_px: height of a line of text, which suits the width. rgb: (H, W, 3) uint8."""

    def __init__(self, width: int, height: int) -> None:
        self.rgb: Picture = np.full((height, width, 3), 255, np.uint8)
        self.width, self.height, self.line_px = width, height, line_px(width)

    def put(self, picture: Picture, left: int, top: int) -> None:
        """A picture, as far as it is on the sheet."""
        place = self.rgb[top : top + picture.shape[0], left : left + picture.shape[1]]
        place[:] = picture[: place.shape[0], : place.shape[1]]

    def write(self, text: str, left: int, top: int, colour: Colour = INK, width: int | None = None) -> int:
        """Lines of text, no wider than asked for (else than the sheet); the row below them."""
        room = self.width - left - 4 if width is None else width
        for line in self._lines(text, room):
            place = (left, top + round(0.74 * self.line_px))
            scale = self.line_px * TEXT_SCALE
            cv2.putText(self.rgb, line, place, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
            top += self.line_px
        return top

    def _lines(self, text: str, width: int) -> list[str]:
        ascii_only = text.encode("ascii", "replace").decode()  # the built-in font has no other letters
        lines = [""]
        for word in ascii_only.split():
            longer = f"{lines[-1]} {word}".strip()
            if lines[-1] and self._extent(longer) > width:
                lines.append(word)
            else:
                lines[-1] = longer
        return lines

    def _extent(self, text: str) -> int:
        return int(cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, self.line_px * TEXT_SCALE, 1)[0][0])


def line_px(width: int) -> int:
    """Height of a line of text on a sheet of this width."""
    return max(14, min(22, width // 60))


def fitted(picture: Picture, width: int, height: int) -> Picture:
    """The picture as large as it goes into so many pixels."""
    scale = min(width / picture.shape[1], height / picture.shape[0])
    size = (max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale)))
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, size, interpolation=how), np.uint8)


def write_png(path: Path, picture: Picture) -> None:
    """Raises OutputError where it cannot be written."""
    encoded, data = cv2.imencode(".png", np.ascontiguousarray(picture[:, :, ::-1]))
    try:
        path.write_bytes(data.tobytes() if encoded else b"")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
