"""What is printed on the six sides of a box of tea."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from tracker.sources.synthetic.things.drawing import Picture, Sheet
from tracker.sources.synthetic.things.motifs import INK, barcode, facts, leaf, small_print

SIZE_MM: Final = (128.0, 72.0, 76.0)  # width, depth, height
GREEN, GOLD, CREAM = (22, 74, 50), (201, 164, 82), (240, 231, 205)


def _panel(width_mm: float, height_mm: float) -> Sheet:
    """Dark green with a double gold frame and leaves in the corners."""
    sheet = Sheet(width_mm, height_mm, GREEN, 5.0)
    sheet.shade((34, 98, 66), (12, 52, 36))
    for inset, line in ((3.0, 1.0), (5.0, 0.4)):
        right, bottom = width_mm - inset, height_mm - inset
        sheet.line([(inset, inset), (right, inset), (right, bottom), (inset, bottom), (inset, inset)], GOLD, line)
    return sheet


def _front() -> Picture:
    sheet = _panel(SIZE_MM[0], SIZE_MM[2])
    for x, y, turn in ((12, 66, -50), (14, 64, -15), (116, 10, 130), (113, 12, 165), (10, 60, -85), (118, 16, 95)):
        leaf(sheet, x, y, 26, turn, (104, 160, 74), (196, 212, 130))
    sheet.ellipse(64, 36, 47, 26, GOLD)
    sheet.ellipse(64, 36, 45.4, 24.6, CREAM)
    sheet.text("Misty Hill", 64, 25, 10.5, GREEN, 74)
    sheet.rectangle(32, 35.4, 64, 0.6, GOLD)
    sheet.text("GREEN TEA", 64, 42, 7, (150, 54, 40), 62)
    sheet.text("with mint leaves", 64, 52, 4, INK, 46, "italic")
    sheet.text("20 bags  40 g", 64, 68, 3.6, CREAM, 40, "plain")
    return sheet.finished


def _back() -> Picture:
    sheet = _panel(SIZE_MM[0], SIZE_MM[2])
    sheet.rectangle(9, 9, 62, 58, CREAM)
    sheet.text("How to brew", 40, 16, 5, (150, 54, 40), 50)
    small_print(sheet, 12, 24, 54, 8, INK, 12)
    sheet.text("80 C   2 min", 40, 58, 6, GREEN, 50)
    sheet.ellipse(98, 52, 18, 8, GOLD)
    sheet.polygon([(82, 30), (114, 30), (108, 54), (88, 54)], CREAM)
    sheet.ellipse(98, 30, 16, 5, (170, 190, 90))
    sheet.ellipse(115, 40, 5, 7, CREAM, 2)
    return sheet.finished


def _left() -> Picture:
    sheet = _panel(SIZE_MM[1], SIZE_MM[2])
    for k, colour in enumerate(((150, 186, 150), (104, 156, 112), (58, 118, 78))):
        x = np.linspace(6, 66, 25)
        y = 34 + 9 * k + 6 * np.sin(x / (8 + 2 * k) + 2.1 * k)
        sheet.polygon([(6, 70), *zip(x.tolist(), y.tolist(), strict=True), (66, 70)], colour)
    sheet.disc(48, 20, 8, (236, 206, 120))
    return sheet.finished


def _right() -> Picture:
    sheet = _panel(SIZE_MM[1], SIZE_MM[2])
    sheet.text("mint", 36, 16, 8, GOLD, 50, "italic")
    small_print(sheet, 10, 28, 52, 5, CREAM, 15)
    barcode(sheet, 16, 46, 40, 22, 11)
    return sheet.finished


def _top() -> Picture:
    sheet = _panel(SIZE_MM[0], SIZE_MM[1])
    sheet.text("Misty Hill", 64, 28, 14, CREAM, 96)
    sheet.text("GREEN TEA", 64, 50, 6, GOLD, 60)
    for x, turn in ((20, 20), (108, 160)):
        leaf(sheet, x, 42, 18, turn, (104, 160, 74), (196, 212, 130))
    return sheet.finished


def _bottom() -> Picture:
    sheet = Sheet(SIZE_MM[0], SIZE_MM[1], CREAM, 5.0)
    sheet.text("L 0482  best before 09 27", 64, 50, 5, INK, 80, "plain")
    facts(sheet, 10, 8, 60, GREEN, 4)
    return sheet.finished


SIDES: Mapping[str, Callable[[], Picture]] = {
    "front": _front,
    "right": _right,
    "back": _back,
    "left": _left,
    "top": _top,
    "bottom": _bottom,
}
