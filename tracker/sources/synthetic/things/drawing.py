"""A sheet to print on: shapes and lettering placed in millimetres, drawn large and shrunk once at the end."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

Rgb = tuple[int, int, int]
Picture = npt.NDArray[np.uint8]
Points = Sequence[tuple[float, float]]

OVERSAMPLING = 2  # drawn at twice the resolution: shrinking smooths every edge alike
FONTS = {"bold": cv2.FONT_HERSHEY_TRIPLEX, "plain": cv2.FONT_HERSHEY_SIMPLEX, "italic": cv2.FONT_HERSHEY_SCRIPT_COMPLEX}


class Sheet:
    """Width x height in millimetres, the origin at the top left, y down. `finished` answers the (H, W, 3) picture."""

    def __init__(self, width_mm: float, height_mm: float, colour: Rgb, px_per_mm: float = 4.0) -> None:
        self.width_mm, self.height_mm = width_mm, height_mm
        self._scale = px_per_mm * OVERSAMPLING
        size = (round(height_mm * px_per_mm) * OVERSAMPLING, round(width_mm * px_per_mm) * OVERSAMPLING)
        self.pixels: Picture = np.empty((*size, 3), np.uint8)
        self.rectangle(0, 0, width_mm, height_mm, colour)

    @property
    def finished(self) -> Picture:
        size = (self.pixels.shape[1] // OVERSAMPLING, self.pixels.shape[0] // OVERSAMPLING)
        return cv2.resize(self.pixels, size, interpolation=cv2.INTER_AREA).astype(np.uint8)

    def rectangle(self, x_mm: float, y_mm: float, width_mm: float, height_mm: float, colour: Rgb) -> None:
        (left, top), (right, bottom) = self._px([(x_mm, y_mm), (x_mm + width_mm, y_mm + height_mm)]).tolist()
        if right > left and bottom > top:
            cv2.rectangle(self.pixels, (left, top), (right - 1, bottom - 1), colour, cv2.FILLED)

    def polygon(self, points_mm: Points, colour: Rgb) -> None:
        cv2.fillPoly(self.pixels, [self._px(points_mm)], colour)

    def line(self, points_mm: Points, colour: Rgb, width_mm: float) -> None:
        cv2.polylines(self.pixels, [self._px(points_mm)], False, colour, max(1, round(width_mm * self._scale)))

    def ellipse(
        self,
        x_mm: float,
        y_mm: float,
        rx_mm: float,
        ry_mm: float,
        colour: Rgb,
        width_mm: float = 0,
        turn_deg: float = 0,
    ) -> None:
        """Around (x, y). Filled unless a line width is given."""
        centre, radii = self._px([(x_mm, y_mm)])[0], self._px([(rx_mm, ry_mm)])[0]
        thickness = max(1, round(width_mm * self._scale)) if width_mm else cv2.FILLED
        cv2.ellipse(self.pixels, centre.tolist(), np.maximum(radii, 1).tolist(), turn_deg, 0, 360, colour, thickness)

    def disc(self, x_mm: float, y_mm: float, radius_mm: float, colour: Rgb) -> None:
        self.ellipse(x_mm, y_mm, radius_mm, radius_mm, colour)

    def ring(self, x_mm: float, y_mm: float, radius_mm: float, colour: Rgb, width_mm: float) -> None:
        self.ellipse(x_mm, y_mm, radius_mm, radius_mm, colour, width_mm)

    def shade(self, top: Rgb, bottom: Rgb, y_mm: float = 0, height_mm: float | None = None) -> None:
        """A band over the whole width that runs from one colour to another."""
        first, last = (round(y * self._scale) for y in (y_mm, y_mm + (height_mm or self.height_mm - y_mm)))
        band = self.pixels[first:last]
        share = np.linspace(0, 1, len(band))[:, None, None]
        band[:] = (np.asarray(top) * (1 - share) + np.asarray(bottom) * share).round()

    def text(
        self,
        words: str,
        x_mm: float,
        y_mm: float,
        height_mm: float,
        colour: Rgb,
        width_mm: float = np.inf,
        font: str = "bold",
        quarter_turns: int = 0,
        flush_left: bool = False,
    ) -> None:
        """Lettering centred at (x, y), or beginning there, capitals that high unless it would get too wide.

        Drawn apart and scaled to its place, so it fills the same box whatever font the installed OpenCV brings.
        """
        canvas = np.zeros((150, 80 + 75 * len(words)), np.uint8)
        cv2.putText(canvas, words, (30, 100), FONTS[font], 2.2, (255,), 6 if font == "bold" else 3, cv2.LINE_AA)
        inked = np.flatnonzero(canvas.any(axis=0))
        stencil = canvas[20:126, inked[0] : inked[-1] + 1]  # the same rows for all words; capitals in the middle
        factor = min(height_mm * self._scale / 55, width_mm * self._scale / stencil.shape[1])  # capitals are 55 high
        size = (max(1, round(stencil.shape[1] * factor)), max(1, round(stencil.shape[0] * factor)))
        x_mm += size[0] / self._scale / 2 * flush_left
        stencil = np.asarray(cv2.resize(stencil, size, interpolation=cv2.INTER_AREA), np.uint8)
        self._blend(np.rot90(stencil, quarter_turns), x_mm, y_mm, colour)

    def paste(self, picture: Picture, x_mm: float, y_mm: float, width_mm: float, height_mm: float) -> None:
        """Another picture with its top left corner at (x, y), cut off where it leaves the sheet."""
        (left, top), (right, bottom) = self._px([(x_mm, y_mm), (x_mm + width_mm, y_mm + height_mm)])
        target = self.pixels[top:bottom, left:right]
        scaled = cv2.resize(picture, (right - left, bottom - top), interpolation=cv2.INTER_AREA)
        target[:] = scaled[: target.shape[0], : target.shape[1]]

    def _blend(self, stencil: npt.NDArray[np.uint8], x_mm: float, y_mm: float, colour: Rgb) -> None:
        x, y = self._px([(x_mm, y_mm)])[0] - np.array(stencil.shape[::-1]) // 2
        top, left = max(y, 0), max(x, 0)
        target = self.pixels[top : y + stencil.shape[0], left : x + stencil.shape[1]]
        cut = stencil[top - y :, left - x :][: target.shape[0], : target.shape[1], None] / 255
        target[:] = (target * (1 - cut) + np.asarray(colour) * cut).round()

    def _px(self, points_mm: Points) -> npt.NDArray[np.int32]:
        return np.round(np.asarray(points_mm, float) * self._scale).astype(np.int32)


def grained(picture: Picture, strength: float) -> Picture:
    """With the unevenness of a natural surface."""
    rng = np.random.default_rng(1)
    grain = rng.normal(0, strength, picture.shape[:2])[..., None]
    return (picture + grain).clip(0, 255).astype(np.uint8)
