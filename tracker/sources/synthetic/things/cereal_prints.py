"""What is printed on the six sides of a box of breakfast cereal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from tracker.sources.synthetic.things.drawing import Picture, Rgb, Sheet
from tracker.sources.synthetic.things.motifs import INK, PAPER, barcode, facts, ribbon, small_print, star, sunburst

SIZE_MM: Final = (158.0, 56.0, 238.0)  # width, depth, height
RED, YELLOW, BLUE, MILK = (196, 30, 38), (250, 196, 42), (24, 66, 150), (250, 250, 246)


def _loops(sheet: Sheet, x_mm: float, y_mm: float, rx_mm: float, ry_mm: float, count: int, seed: int) -> None:
    """Cereal rings scattered over an ellipse."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        angle, far = rng.uniform(0, 2 * np.pi), np.sqrt(rng.random())
        x, y = x_mm + rx_mm * far * np.cos(angle), y_mm + ry_mm * far * np.sin(angle)
        tilt, squeeze = rng.uniform(0, 180), rng.uniform(0.6, 1.0)
        colour: Rgb = ((214, 142, 56), (226, 104, 62), (232, 178, 74), (190, 116, 44))[rng.integers(4)]
        sheet.ellipse(x, y + 0.8, 6.2, 6.2 * squeeze, (122, 70, 26), 3.6, tilt)
        sheet.ellipse(x, y, 6, 6 * squeeze, colour, 3.2, tilt)
        sheet.ellipse(x - 0.6, y - 0.8, 6, 6 * squeeze, (250, 222, 160), 0.5, tilt)


def _front() -> Picture:
    width, _, height = SIZE_MM
    sheet = Sheet(width, height, YELLOW)
    sheet.shade((252, 208, 60), (238, 132, 30))
    sunburst(sheet, 79, 160, 22, (255, 222, 104))
    ribbon(sheet, 79, 62, 170, 62, 12, (146, 16, 26))
    ribbon(sheet, 79, 59, 170, 58, 12, RED)
    sheet.text("SUNNY", 79.8, 39.6, 24, (110, 10, 20), 120)
    sheet.text("SUNNY", 79, 38.5, 24, MILK, 120)
    sheet.text("LOOPS", 80, 69.2, 27, (110, 10, 20), 136)
    sheet.text("LOOPS", 79, 68, 27, (255, 226, 84), 136)
    sheet.text("crunchy whole grain oat rings", 79, 98, 6, (120, 44, 10), 130, "italic")
    around = np.linspace(0, np.pi, 33)
    for shrink, colour in ((1.0, (16, 46, 112)), (0.93, BLUE), (0.7, (40, 92, 184))):
        belly = np.stack((80 + 66 * shrink * np.cos(around), 166 + 56 * np.sin(around)), axis=1)
        sheet.polygon(belly.tolist(), colour)
    sheet.rectangle(54, 216, 52, 7, (16, 46, 112))
    sheet.ellipse(80, 166, 66, 24, (70, 120, 204))
    sheet.ellipse(80, 166, 61, 20, MILK)
    _loops(sheet, 80, 160, 50, 18, 34, 3)
    _loops(sheet, 92, 124, 28, 12, 7, 8)
    star(sheet, 130, 118, 20, 16, 0.82, (40, 128, 62))
    sheet.text("NEW", 130, 113, 6.5, MILK, 26)
    sheet.text("+ honey", 130, 122, 5, (255, 236, 140), 28)
    sheet.text("375 g", 139, 229, 5, INK, 26)
    sheet.text("serving suggestion", 27, 232, 2.6, INK, 40, "plain")
    return sheet.finished


def _back() -> Picture:
    width, _, height = SIZE_MM
    sheet = Sheet(width, height, BLUE)
    sheet.shade((60, 132, 216), (18, 52, 130))
    sheet.text("LOOP MAZE", 79, 22, 15, (255, 226, 84), 130)
    sheet.text("help the bee to the flower", 79, 38, 5.5, PAPER, 110, "italic")
    rng = np.random.default_rng(5)
    sheet.rectangle(17, 48, 124, 112, PAPER)
    for row in range(9):
        for column in range(10):
            x, y = 19 + column * 12, 50 + row * 12
            step = (12, 0) if rng.random() < 0.5 else (0, 12)
            sheet.line([(x, y), (x + step[0], y + step[1])], BLUE, 1.8)
    sheet.ellipse(27, 57, 6, 4.5, (250, 190, 20))
    sheet.line([(25, 53), (25, 61)], INK, 1.2)
    sheet.line([(29, 53), (29, 61)], INK, 1.2)
    for petal in np.linspace(0, 2 * np.pi, 6)[:-1]:
        sheet.disc(129 + 6 * float(np.cos(petal)), 148 + 6 * float(np.sin(petal)), 4, (232, 72, 132))
    sheet.disc(129, 148, 4, (252, 206, 50))
    sheet.ellipse(38, 198, 29, 29, (255, 226, 84))
    _loops(sheet, 38, 198, 20, 20, 9, 21)
    sheet.text("Did you know?", 112, 176, 6.5, (255, 226, 84), 76)
    small_print(sheet, 74, 186, 76, 9, PAPER, 2, 4.8)
    return sheet.finished


def _left() -> Picture:
    sheet = Sheet(SIZE_MM[1], SIZE_MM[2], PAPER)
    sheet.rectangle(0, 0, 56, 30, RED)
    sheet.text("LOOPS", 28, 15, 10, (255, 226, 84), 46)
    facts(sheet, 6, 38, 44)
    sheet.text("vitamins", 28, 92, 6, (40, 128, 62), 40)
    for row, letter in enumerate("ABCDE"):
        sheet.disc(14, 106 + row * 15, 6, (40, 128, 62))
        sheet.text(letter, 14, 106 + row * 15, 6, PAPER)
        sheet.rectangle(24, 103 + row * 15, 8 + 5 * ((row * 3) % 5), 6, (236, 140, 40))
    small_print(sheet, 6, 186, 44, 12, INK, 7)
    return sheet.finished


def _right() -> Picture:
    sheet = Sheet(SIZE_MM[1], SIZE_MM[2], RED)
    sheet.shade((214, 44, 44), (150, 18, 30))
    sheet.text("SUNNY LOOPS", 22, 88, 17, (255, 226, 84), 150, quarter_turns=1)
    sheet.text("whole grain oats", 41, 88, 7, PAPER, 120, "italic", quarter_turns=1)
    small_print(sheet, 6, 176, 44, 6, PAPER, 9)
    barcode(sheet, 8, 204, 40, 26, 4)
    return sheet.finished


def _top() -> Picture:
    sheet = Sheet(SIZE_MM[0], SIZE_MM[1], YELLOW)
    sheet.rectangle(0, 26, 158, 1.0, (176, 110, 20))
    sheet.polygon([(52, 27), (106, 27), (100, 42), (58, 42)], (255, 226, 120))
    sheet.line([(52, 27), (58, 42), (100, 42), (106, 27)], (176, 110, 20), 0.8)
    sheet.text("push in here", 79, 33, 4, (150, 60, 10), 40, "plain")
    sheet.text("SUNNY LOOPS", 79, 13, 11, RED, 130)
    return sheet.finished


def _bottom() -> Picture:
    sheet = Sheet(SIZE_MM[0], SIZE_MM[1], (168, 148, 120))
    sheet.rectangle(0, 30, 158, 0.8, (120, 100, 76))
    sheet.text("BEST BEFORE 04 27  L2291 B", 60, 16, 5, (60, 48, 40), 90, "plain")
    sheet.disc(138, 42, 8, (120, 100, 76))
    return sheet.finished


SIDES: Mapping[str, Callable[[], Picture]] = {
    "front": _front,
    "right": _right,
    "back": _back,
    "left": _left,
    "top": _top,
    "bottom": _bottom,
}
