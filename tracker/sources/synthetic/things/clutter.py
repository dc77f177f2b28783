"""Things that stand about and are not tracked: a parcel, fruit, a jar, a pencil pot, a coffee tin, a plant."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from tracker.geometry import Pose
from tracker.sources.synthetic.things.drawing import Picture, Rgb, Sheet, grained
from tracker.sources.synthetic.things.mesh import joined
from tracker.sources.synthetic.things.motifs import INK, PAPER, barcode, small_print, star
from tracker.sources.synthetic.things.solids import Strip, box, revolved, swept
from tracker.sources.synthetic.things.texture import Window, glossy, pack, plain
from tracker.sources.synthetic.things.thing import Thing


@cache
def parcel(width_mm: float, depth_mm: float, height_mm: float) -> Thing:
    """A brown cardboard box with tape and an address."""
    board = (178, 140, 98)
    side = Sheet(max(width_mm, depth_mm), height_mm, board, 2.0)
    side.rectangle(0, 0, side.width_mm, 1.2, (140, 106, 70))
    front = Sheet(width_mm, height_mm, board, 2.0)
    front.rectangle(width_mm * 0.12, height_mm * 0.3, width_mm * 0.5, height_mm * 0.5, PAPER)
    small_print(front, width_mm * 0.15, height_mm * 0.38, width_mm * 0.4, 4, INK, 3, height_mm * 0.07)
    barcode(front, width_mm * 0.68, height_mm * 0.55, width_mm * 0.24, height_mm * 0.25, 9)
    front.text("FRAGILE", width_mm * 0.5, height_mm * 0.16, height_mm * 0.12, (170, 40, 36), width_mm * 0.6)
    top = Sheet(width_mm, depth_mm, board, 2.0)
    top.rectangle(0, depth_mm / 2 - 24, width_mm, 48, (200, 172, 120))
    top.rectangle(0, depth_mm / 2 - 0.6, width_mm, 1.2, (140, 106, 70))
    sheets = {"front": front, "side": side, "top": top}
    texture, w = pack({name: glossy(grained(sheet.finished, 4), 0.05) for name, sheet in sheets.items()})
    windows: dict[str, Window] = dict.fromkeys(("right", "left", "back"), w["side"])
    windows |= {"front": w["front"], "top": w["top"], "bottom": w["side"]}
    return Thing("parcel", box([width_mm / 1000, depth_mm / 1000, height_mm / 1000], windows), texture)


@cache
def fruit(kind: str) -> Thing:
    """An "apple" or an "orange"."""
    angle = np.linspace(0, np.pi, 25)
    if kind == "apple":
        radius, height = 0.037 * np.sin(angle) ** 0.8, 0.033 * np.cos(angle) - 0.012 * np.exp(-((angle / 0.35) ** 2))
        skin = Sheet(240, 120, (186, 34, 36), 2.5)
        skin.shade((206, 176, 74), (176, 24, 34), 0, 34)
    else:
        radius, height = 0.038 * np.sin(angle), 0.036 * np.cos(angle)
        skin = Sheet(240, 120, (238, 138, 28), 2.5)
    rng = np.random.default_rng(len(kind))
    for x, y in rng.uniform(0, 1, (700, 2)) * [240, 120]:
        streak = 5.0 if kind == "apple" else 0.4
        skin.line([(x, y), (x + 0.3, y + streak)], (214, 120, 50) if kind == "apple" else (214, 112, 16), 0.5)
    stalk = np.stack((np.linspace(0, 0.004, 8), np.zeros(8), np.linspace(0.016, 0.036, 8)), axis=1)
    texture, w = pack({"skin": glossy(grained(skin.finished, 5), 0.45), "stalk": plain((88, 62, 34), 0.1)})
    points = [(abs(float(r)), float(z)) for r, z in zip(radius.round(6), height, strict=True)]
    bodies = [revolved([Strip(points, w["skin"])], 48)]
    if kind == "apple":
        bodies.append(swept(stalk, np.full(8, 0.0012), np.full(8, 0.0012)).in_window(*w["stalk"]))
    return Thing(kind, joined(bodies, separate=True).centred(), texture)


@cache
def jar(kind: str) -> Thing:
    """A jar of "honey" with a lid, or a "coffee" tin; both with a label all around."""
    honey = kind == "honey"
    label = Sheet(230, 60, (250, 240, 208) if honey else (46, 32, 26))
    ink: Rgb = (120, 70, 14) if honey else (232, 200, 140)
    label.rectangle(0, 3, 230, 1.2, ink)
    label.rectangle(0, 56, 230, 1.2, ink)
    for x in (57, 172):
        label.text("HONEY" if honey else "COFFEE", x, 26, 12, ink, 70)
        label.text("wild flowers" if honey else "dark roast", x, 42, 6, ink, 60, "italic")
    for x in (0, 115, 230):
        star(label, x, 30, 17, 6 if honey else 12, 0.8 if honey else 0.6, ink)
    body = plain((196, 112, 16) if honey else (46, 32, 26), 0.7)
    lid = plain((40, 92, 66) if honey else (200, 200, 196), 0.5 if honey else 1.0)
    texture, w = pack({"label": glossy(label.finished, 0.25), "body": body, "lid": lid})
    r, h = (0.034, 0.085) if honey else (0.044, 0.125)
    strips = [
        Strip([(0, h), (r - 0.003, h)], w["lid"]),
        Strip([(r - 0.003, h), (r - 0.001, h - 0.0015), (r - 0.001, h - 0.016)], w["lid"]),
        Strip([(r - 0.001, h - 0.016), (r - 0.004, h - 0.017)], w["lid"]),
        Strip([(r - 0.004, h - 0.017), (r, h - 0.024), (r, h - 0.028)], w["body"]),
        Strip([(r, h - 0.028), (r, 0.012)], w["label"]),
        Strip([(r, 0.012), (r, 0.003), (r - 0.003, 0)], w["body"]),
        Strip([(r - 0.003, 0), (0, 0)], w["body"]),
    ]
    return Thing(kind, revolved(strips, 64).centred(), texture)


@cache
def pencil_pot() -> Thing:
    """A pot with five pencils."""
    colours = ((220, 60, 50), (240, 190, 40), (40, 110, 180), (60, 150, 90), (120, 70, 150))
    pictures = {f"pencil {k}": glossy(_pencil(colour), 0.4) for k, colour in enumerate(colours)}
    texture, w = pack({"pot": plain((70, 96, 104), 0.5), **pictures})
    strips = [
        Strip([(0, 0.006), (0.033, 0.006)], w["pot"]),
        Strip([(0.033, 0.006), (0.034, 0.092)], w["pot"]),
        Strip([(0.034, 0.092), (0.0355, 0.094), (0.037, 0.092)], w["pot"]),
        Strip([(0.037, 0.092), (0.036, 0.002), (0.034, 0)], w["pot"]),
        Strip([(0.034, 0), (0, 0)], w["pot"]),
    ]
    bodies = [revolved(strips, 48)]
    height = np.array([0, 0.12, 0.121, 0.138, 0.14])
    width = np.array([0.0037, 0.0037, 0.0035, 0.0008, 0.0003])
    for k in range(len(colours)):
        path = np.stack((0.012 + 0.13 * height, 0 * height, 0.008 + height + 0.008 * np.sin(3.0 * k)), axis=1)
        turn = Pose(Rotation.from_euler("z", 72 * k + 20, degrees=True).as_matrix(), np.zeros(3))
        bodies.append(swept(path, width, width).in_window(*w[f"pencil {k}"]).moved(turn))
    return Thing("pencil_pot", joined(bodies, separate=True).centred(), texture)


@cache
def plant() -> Thing:
    """A clay pot with arching leaves, each a thin closed blade."""
    blade = Sheet(40, 90, (58, 116, 56), 3.0)
    blade.shade((30, 76, 40), (92, 156, 74))
    for x in (10, 30):  # the middle of both faces; the picture goes around
        blade.rectangle(x - 0.8, 0, 1.6, 90, (136, 184, 112))
    texture, w = pack(
        {"blade": glossy(blade.finished, 0.35), "clay": plain((176, 98, 66), 0.05), "soil": plain((60, 46, 36), 0)}
    )
    pot = [
        Strip([(0, 0.085), (0.056, 0.085)], w["soil"]),
        Strip([(0.056, 0.085), (0.057, 0.098), (0.064, 0.098), (0.064, 0.080)], w["clay"]),
        Strip([(0.064, 0.080), (0.059, 0.078), (0.045, 0)], w["clay"]),
        Strip([(0.045, 0), (0, 0)], w["clay"]),
    ]
    bodies = [revolved(pot, 48)]
    rng = np.random.default_rng(4)
    along = np.linspace(0, 1, 16)
    for k in range(34):
        reach, height = rng.uniform(0.03, 0.13), rng.uniform(0.10, 0.20)
        x, z = 0.012 + reach * along**1.4, 0.084 + height * (along - rng.uniform(0.1, 0.55) * along**3)
        width = 0.0135 * np.sin(np.pi * (0.08 + 0.915 * along) ** 1.3)
        leaf = swept(np.stack((x, 0 * x, z), axis=1), np.full(16, 0.0005), width, sections=12).in_window(*w["blade"])
        turn = Rotation.from_euler("z", 137.5 * k, degrees=True).as_matrix()  # the golden angle, as plants do
        bodies.append(leaf.moved(Pose(turn, np.zeros(3))))
    return Thing("plant", joined(bodies, separate=True).centred(), texture)


def _pencil(colour: Rgb) -> Picture:
    """Along the pencil; of the four stretches of its path the last ones are wood and lead."""
    sheet = Sheet(10, 40, colour)
    sheet.rectangle(0, 12, 10, 18, (222, 184, 132))
    sheet.rectangle(0, 29, 10, 11, INK)
    return sheet.finished
