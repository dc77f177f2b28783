"""The room around: floor, walls, framed pictures. World frame: z up, the table top is z = 0, metres."""

from __future__ import annotations

import cv2
import numpy as np

from tracker.geometry import Pose
from tracker.sources.synthetic.rendering.world import Placed
from tracker.sources.synthetic.scenes.furniture import FLOOR_M
from tracker.sources.synthetic.scenes.wood import WALNUT, waves, wood
from tracker.sources.synthetic.things.drawing import Picture, Rgb, Sheet
from tracker.sources.synthetic.things.solids import BOX_SIDES, box
from tracker.sources.synthetic.things.texture import Texture, glossy, pack, plain
from tracker.sources.synthetic.things.thing import Thing

WALL_BEHIND_M = 0.80  # y of the wall behind the table


def walls(rng: np.random.Generator, paint: Rgb) -> list[Placed]:
    """Floor, ceiling and four walls around the table, with framed pictures and a socket."""
    floor = wood(3600, 3600, WALNUT, 24, rng, 0.3)
    pictures: dict[str, Texture] = {
        "floor": glossy(floor, 0.3),
        "ceiling": plain((236, 234, 230), 0),
        "wall": glossy(_wall(3600, paint, rng), 0),
    }
    texture, w = pack(pictures)
    size = np.array([3.6, 3.6, 2.8])
    windows = {**dict.fromkeys(BOX_SIDES, w["wall"]), "top": w["ceiling"], "bottom": w["floor"]}
    shell = box(size.tolist(), windows)
    T_world_shell = Pose(np.eye(3), np.array([0, WALL_BEHIND_M - size[1] / 2, FLOOR_M + size[2] / 2]))
    hung = [(poster(rng, 0), -0.46, 0.36), (poster(rng, 1), 0.50, 0.40), (socket(), 0.05, -0.32)]
    room = [Placed(Thing("room", shell.inside_out(), texture), T_world_shell)]
    room += [Placed(thing, Pose(np.eye(3), np.array([x, WALL_BEHIND_M - 0.008, z]))) for thing, x, z in hung]
    quarter = np.array([[0, 1.0, 0], [-1.0, 0, 0], [0, 0, 1]])
    for side, number in ((-1, 2), (1, 3)):
        turn = quarter.T if side < 0 else quarter
        room.append(Placed(poster(rng, number), Pose(turn, np.array([side * 1.792, 0.25, 0.25]))))
    return room


def _wall(length_mm: float, paint: Rgb, rng: np.random.Generator) -> Picture:
    """Painted plaster with a skirting board."""
    sheet = Sheet(length_mm, 2800, paint, 0.25)
    sheet.rectangle(0, 2710, length_mm, 90, (232, 230, 224))
    sheet.rectangle(0, 2704, length_mm, 6, (150, 146, 138))
    picture = sheet.finished
    tone = 1 + 0.018 * waves(picture.shape[:2], (6, 9), rng) + 0.012 * rng.normal(0, 1, picture.shape[:2])
    return (picture * tone[..., None]).clip(0, 255).astype(np.uint8)


def poster(rng: np.random.Generator, number: int) -> Thing:
    """A framed picture, 50 x 40 cm, that faces -y: one of four, its colours by the generator."""
    sheet = Sheet(500, 400, (30, 28, 28), 0.8)
    sheet.rectangle(14, 14, 472, 372, (246, 243, 236))
    hue = int(rng.integers(0, 180))
    colours = [_hsv((hue + shift) % 180, s, v) for shift, s, v in ((0, 150, 170), (20, 120, 220), (90, 140, 150))]
    sheet.rectangle(60, 50, 380, 300, colours[1])
    if number == 0:
        for k in range(5):
            x = np.linspace(60, 440, 40)
            y = 180 + 38 * k + 26 * np.sin(x / (40 + 9 * k) + 2 * k)
            tone = tuple(int(c * (1 - 0.16 * k)) for c in colours[0])
            sheet.polygon(
                [(60, 350), *zip(x.tolist(), y.tolist(), strict=True), (440, 350)], (tone[0], tone[1], tone[2])
            )
        sheet.disc(330, 110, 34, colours[2])
    elif number == 1:
        for k in range(6):
            sheet.rectangle(60 + 64 * k, 50, 60, 60 + 240 * float(rng.random()), colours[k % 3])
    else:
        for _ in range(14):
            x, y = rng.uniform(110, 390), rng.uniform(95, 300)
            sheet.disc(x, y, float(rng.uniform(10, 42)), colours[int(rng.integers(3))])
    texture, w = pack({"front": glossy(sheet.finished, 0.25), "frame": plain((30, 28, 28), 0.3)})
    return Thing(
        f"poster {number}",
        box((0.5, 0.016, 0.4), {**dict.fromkeys(BOX_SIDES, w["frame"]), "front": w["front"]}),
        texture,
    )


def socket() -> Thing:
    sheet = Sheet(90, 90, (238, 238, 234))
    sheet.ring(45, 45, 26, (200, 200, 196), 2)
    sheet.disc(37, 45, 3, (60, 60, 60))
    sheet.disc(53, 45, 3, (60, 60, 60))
    texture, w = pack({"front": glossy(sheet.finished, 0.4), "edge": plain((220, 220, 216), 0.3)})
    return Thing(
        "socket", box((0.09, 0.016, 0.09), {**dict.fromkeys(BOX_SIDES, w["edge"]), "front": w["front"]}), texture
    )


def _hsv(hue: int, saturation: int, value: int) -> Rgb:
    r, g, b = cv2.cvtColor(np.array([[[hue, saturation, value]]], np.uint8), cv2.COLOR_HSV2RGB)[0, 0]
    return int(r), int(g), int(b)
