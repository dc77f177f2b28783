"""What is printed on the round things: a soup can, a mug, a bowl; and the colours of the spring clamp.

Wrapped pictures start at azimuth 0 (+x) and run against the clock seen from above: +x, +y, -x, -y (the front).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from tracker.sources.synthetic.things.drawing import Picture, Rgb, Sheet
from tracker.sources.synthetic.things.motifs import INK, PAPER, barcode, facts, leaf, small_print, star

CAN_LABEL_MM: Final = (211.0, 90.0)  # circumference, height
MUG_WRAP_MM: Final = (264.0, 88.0)

RED, CREAM, GOLD, GREEN = (178, 34, 34), (248, 240, 214), (206, 166, 70), (46, 110, 52)
NAVY, CORAL, SAND, SKY, GLAZE = (36, 52, 92), (232, 98, 78), (240, 200, 132), (150, 196, 208), (240, 238, 230)
VIOLET = (152, 72, 190)


def _tomato(sheet: Sheet, x_mm: float, y_mm: float, radius_mm: float) -> None:
    for share, colour in ((1.0, (150, 18, 16)), (0.93, (212, 44, 30)), (0.72, (230, 66, 44))):
        offset = (1 - share) * radius_mm * 0.5
        sheet.ellipse(x_mm - offset, y_mm - offset, radius_mm * share, radius_mm * 0.86 * share, colour)
    sheet.ellipse(
        x_mm - radius_mm * 0.4, y_mm - radius_mm * 0.38, radius_mm * 0.2, radius_mm * 0.11, (250, 190, 170), 0, -30
    )
    for turn in (-160, -125, -90, -55, -20):
        leaf(sheet, x_mm, y_mm - radius_mm * 0.72, radius_mm * 0.62, turn, GREEN, (110, 160, 80))


def soup_label() -> Picture:
    """Tomatoes in front (-y, three quarters along the picture), nutrition to their left, recipe and bar code behind."""
    width, height = CAN_LABEL_MM
    front = 0.75 * width
    sheet = Sheet(width, height, CREAM, 6.0)
    sheet.shade((204, 44, 40), (150, 22, 26), 0, 36)
    sheet.rectangle(0, 36, width, 1.6, GOLD)
    sheet.shade((222, 206, 160), CREAM, 37.6, 12)
    sheet.rectangle(0, 84, width, 6, GREEN)
    sheet.text("Old Garden", front, 10, 8.5, CREAM, 66, "italic")
    sheet.text("TOMATO", front, 25, 12.5, (255, 232, 170), 74)
    for x, y, radius in ((-21, 66, 13), (23, 67, 12), (1, 63, 17)):
        _tomato(sheet, front + x, y, radius)
    sheet.text("creamy soup", front, 87, 3.6, CREAM, 44, "plain")
    star(sheet, front + 32, 46, 9, 14, 0.84, GOLD)
    sheet.text("400 g", front + 32, 46, 3.8, INK, 13)
    facts(sheet, 74, 40, 42)
    sheet.text("per can", 95, 26, 6, CREAM, 40)
    sheet.text("Serve hot", 24, 26, 8, CREAM, 40)
    small_print(sheet, 5, 45, 38, 9, INK, 31, 4.2)
    barcode(sheet, 47, 44, 23, 34, 6)
    return sheet.finished


def metal_lid() -> Picture:
    """A band of bare metal with pressed rings; rows run from the rim to the middle."""
    sheet = Sheet(60, 34, (196, 196, 192))
    for y, line, colour in ((2, 2, (228, 228, 224)), (5, 1.4, (120, 120, 118)), (12, 1, (150, 150, 148)),
                            (14, 1, (222, 222, 220)), (21, 1, (150, 150, 148)), (23, 1, (222, 222, 220))):  # fmt: skip
        sheet.rectangle(0, y, 60, line, colour)
    return sheet.finished


def mug_wrap() -> Picture:
    """Hills under a sun all around, a greeting on one side, birds on the other."""
    width, height = MUG_WRAP_MM
    sheet = Sheet(width, height, GLAZE, 5.0)
    sheet.shade(GLAZE, (226, 232, 226), 14, 40)
    sheet.disc(66, 40, 16, CORAL)
    sheet.disc(196, 30, 7, SAND)
    x = np.linspace(0, width, 121)
    turn = 2 * np.pi * x / width
    layers: tuple[tuple[Rgb, float, int, float], ...] = ((SKY, 44, 5, 1.0), (SAND, 54, 4, 2.6), (CORAL, 64, 7, 0.4))
    for colour, level, waves, phase in (*layers, (NAVY, 73, 6, 4.0)):
        crest = level - 7 * np.sin(waves * turn + phase) - 4 * np.sin((waves + 3) * turn + 2 * phase)
        sheet.polygon([(0, height), *zip(x.tolist(), crest.tolist(), strict=True), (width, height)], colour)
    for tree in (20, 30, 108, 118, 131, 214, 240):
        for level in range(3):
            y, reach = 62 + 5 * level, 3.2 + 1.4 * level
            sheet.polygon([(tree, y - 7), (tree - reach, y), (tree + reach, y)], (30, 74, 66))
    for bird in ((150, 20), (161, 26), (172, 17), (36, 18)):
        sheet.line([(bird[0] - 5, bird[1] - 2.6), bird, (bird[0] + 5, bird[1] - 2.6)], NAVY, 1.0)
    sheet.text("good morning", 112, 18, 8.5, NAVY, 62, "italic")
    sheet.text("hello hills", 216, 14, 6, NAVY, 50, "bold")
    sheet.rectangle(0, 0, width, 2.4, NAVY)
    return sheet.finished


def bowl_rings() -> Picture:
    """Rings only: every column of the picture is the same, so nothing tells how the bowl is turned.

    Rows run from the middle of the inside over the rim down to the foot; the rim is at half the height.
    """
    sheet = Sheet(12, 200, (236, 232, 220), 4.0)
    sheet.shade((34, 110, 126), (112, 188, 190), 0, 84)
    for y, line, colour in ((0, 12, NAVY), (14, 3, GLAZE), (40, 2.5, GLAZE), (62, 5, NAVY), (71, 2, GLAZE)):
        sheet.rectangle(0, y, 12, line, colour)
    sheet.rectangle(0, 84, 12, 12, GLAZE)
    sheet.rectangle(0, 96, 12, 8, (150, 92, 50))
    for y, line, colour in ((112, 9, NAVY), (125, 3, CORAL), (132, 3, CORAL), (146, 14, NAVY), (168, 3, CORAL)):
        sheet.rectangle(0, y, 12, line, colour)
    sheet.rectangle(0, 182, 12, 18, (190, 150, 110))
    return sheet.finished


def clamp_arm(tip: Rgb, grip: Rgb) -> Picture:
    """Along the arm: coloured jaw, dark plastic with a ribbed stretch, ribbed grip; all around alike."""
    sheet = Sheet(30, 170, (38, 40, 44))
    sheet.rectangle(0, 0, 30, 24, tip)
    sheet.rectangle(0, 24, 30, 1.2, INK)
    for y in np.arange(36, 80, 5.0):
        sheet.rectangle(0, float(y), 30, 1.4, (58, 60, 64))
    sheet.rectangle(0, 118, 30, 52, grip)
    for y in np.arange(124, 168, 6.0):
        sheet.rectangle(0, float(y), 30, 1.6, (round(grip[0] * 0.75), round(grip[1] * 0.75), round(grip[2] * 0.75)))
    return sheet.finished


def pivot_cap() -> Picture:
    """The cap over the spring: a pale disc with a size on it, its picture's right along +x."""
    sheet = Sheet(26, 26, (52, 54, 58), 10.0)
    sheet.disc(13, 13, 10.5, PAPER)
    sheet.text("50", 13, 11, 7, INK, 14)
    sheet.text("mm", 13, 18.5, 3.2, RED, 9)
    return sheet.finished
