"""Books that stand about."""

from __future__ import annotations

from functools import cache

import numpy as np

from tracker.sources.synthetic.things.drawing import Rgb, Sheet
from tracker.sources.synthetic.things.motifs import barcode, small_print, star
from tracker.sources.synthetic.things.solids import box
from tracker.sources.synthetic.things.texture import glossy, pack
from tracker.sources.synthetic.things.thing import Thing

PX_PER_MM = 2.4


@cache
def book(title: str, author: str, cover: Rgb, ink: Rgb, size_mm: tuple[float, float, float]) -> Thing:
    """Standing: its back (the spine) to the front, its pages behind. size_mm: thickness, width, height."""
    thickness, width, height = size_mm
    spine = Sheet(thickness, height, cover, PX_PER_MM)
    spine.text(title, thickness / 2, height * 0.42, thickness * 0.36, ink, height * 0.6, quarter_turns=3)
    spine.text(author, thickness / 2, height * 0.86, thickness * 0.2, ink, height * 0.2, "italic", quarter_turns=3)
    for y in (6, 9, height - 8):
        spine.rectangle(0, y, thickness, 1, ink)
    front = Sheet(width, height, cover, PX_PER_MM)
    front.ellipse(width / 2, height * 0.62, width * 0.3, height * 0.2, ink)
    front.ellipse(width / 2, height * 0.62, width * 0.24, height * 0.15, cover)
    star(front, width / 2, height * 0.62, width * 0.15, 7, 0.5, ink)
    front.text(title, width / 2, height * 0.18, height * 0.08, ink, width * 0.84)
    front.text(author, width / 2, height * 0.3, height * 0.045, ink, width * 0.6, "italic")
    pages = Sheet(max(thickness, width), 30, (232, 226, 208), PX_PER_MM)
    for x in np.arange(0, pages.width_mm, 0.9):
        pages.rectangle(float(x), 0, 0.35, 30, (206, 198, 178))
    back = Sheet(width, height, cover, PX_PER_MM)
    small_print(back, width * 0.12, height * 0.2, width * 0.76, 8, ink, len(title), height * 0.035)
    barcode(back, width * 0.55, height * 0.8, width * 0.35, height * 0.13, len(title))
    pictures = {"spine": spine, "front": front, "pages": pages, "back": back}
    texture, w = pack({name: glossy(sheet.finished, 0.3) for name, sheet in pictures.items()})
    windows = {"front": w["spine"], "right": w["front"], "left": w["back"]}
    windows |= dict.fromkeys(("back", "top", "bottom"), w["pages"])
    return Thing(f"book {title}", box(np.divide(size_mm, 1000).tolist(), windows), texture)


def rivers() -> Thing:
    return book("Rivers", "A. Lind", (34, 72, 116), (240, 220, 160), (34, 132, 204))


def gardens() -> Thing:
    return book("Small Gardens", "M. Oke", (188, 92, 64), (250, 236, 210), (24, 150, 215))


def night() -> Thing:
    return book("Night Trains", "J. Sorel", (44, 44, 58), (206, 176, 92), (40, 125, 190))


def paths() -> Thing:
    return book("On Paths", "T. Havel", (206, 198, 176), (58, 84, 66), (20, 118, 182))


def salt() -> Thing:
    return book("Salt", "R. Mendes", (150, 40, 52), (244, 232, 208), (46, 130, 212))
