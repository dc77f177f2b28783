"""What things stand on: a table, a mat, shelves. World frame: the table top is z = 0, metres."""

from __future__ import annotations

import numpy as np

from tracker.geometry import Pose
from tracker.sources.synthetic.motion import upright
from tracker.sources.synthetic.rendering.world import Placed
from tracker.sources.synthetic.scenes.wood import OAK, PINE, wood
from tracker.sources.synthetic.things.drawing import Rgb, Sheet
from tracker.sources.synthetic.things.mesh import joined
from tracker.sources.synthetic.things.solids import BOX_SIDES, box
from tracker.sources.synthetic.things.texture import glossy, pack, plain
from tracker.sources.synthetic.things.thing import Thing

MAT_M = 0.002  # thickness
TABLE_M = (1.40, 0.90, 0.03)
FLOOR_M = -0.74  # height of the floor


def table(rng: np.random.Generator, colour: Rgb = OAK) -> Placed:
    """A table of planks on four legs."""
    width, depth, thickness = (1000 * m for m in TABLE_M)
    top = wood(width, depth, colour, 7, rng, 1.35)
    edge = wood(width, thickness, colour, 1, rng, 1.0)
    texture, w = pack({"top": glossy(top, 0.35), "edge": glossy(edge, 0.3)})
    slab = box(TABLE_M, {**dict.fromkeys(BOX_SIDES, w["edge"]), "top": w["top"]})
    slab = slab.moved(Pose(np.eye(3), np.array([0, 0, -TABLE_M[2] / 2])))
    leg = box((0.06, 0.06, -FLOOR_M - TABLE_M[2]), dict.fromkeys(BOX_SIDES, w["edge"]))
    legs = [
        leg.moved(Pose(np.eye(3), np.array([0.62 * x, 0.38 * y, (FLOOR_M - TABLE_M[2]) / 2])))
        for x in (-1, 1)
        for y in (-1, 1)
    ]
    return Placed(Thing("table", joined([slab, *legs], separate=True), texture), Pose.identity())


def mat(rng: np.random.Generator, colour: Rgb, x_m: float, y_m: float, yaw_deg: float) -> Placed:
    """A woven cloth with stripes."""
    size = (420.0, 300.0)
    sheet = Sheet(*size, colour, 2.0)
    dark, pale = [tuple(int(c) for c in np.clip(np.array(colour) * f, 0, 255)) for f in (0.62, 1.25)]
    for x in (18, 26, 30, 60, 360, 390, 394, 402):
        sheet.rectangle(x - 2, 0, 4 if x in (18, 402) else 2, size[1], (dark[0], dark[1], dark[2]))
    for x in (40, 376):
        sheet.rectangle(x, 0, 9, size[1], (pale[0], pale[1], pale[2]))
    picture = sheet.finished
    rows, columns = picture.shape[:2]  # threads differ a little: an even weave would give moire
    threads = rng.normal(0, 0.04, (rows, 1)) + rng.normal(0, 0.04, (1, columns)) + rng.normal(0, 0.04, (rows, columns))
    cloth = (picture * (1 + threads[..., None])).clip(0, 255).astype(np.uint8)
    texture, w = pack({"cloth": glossy(cloth, 0.02), "hem": plain((dark[0], dark[1], dark[2]), 0)})
    mesh = box((size[0] / 1000, size[1] / 1000, MAT_M), {**dict.fromkeys(BOX_SIDES, w["hem"]), "top": w["cloth"]})
    return Placed(Thing("mat", mesh, texture), upright(x_m, y_m, yaw_deg, MAT_M / 2))


def bookcase(rng: np.random.Generator, boards_m: tuple[float, ...], colour: Rgb = PINE) -> Placed:
    """Boards, 84 x 30 cm, at the given heights of their upper faces, between two sides and before a back."""
    board = wood(840, 300, colour, 3, rng, 1.4)
    edge = wood(840, 20, colour, 1, rng, 1.4)
    pictures = {"board": board, "side": np.rot90(board).copy(), "edge": edge, "post": np.rot90(edge).copy()}
    pictures["back"] = np.rot90(wood(900, 880, colour, 8, rng, 0.7)).copy()
    texture, w = pack({name: glossy(picture, 0.3) for name, picture in pictures.items()})
    low, high = boards_m[0] - 0.06, boards_m[-1] + 0.02
    middle_m = (low + high) / 2
    flat = {**dict.fromkeys(BOX_SIDES, w["edge"]), "top": w["board"], "bottom": w["board"]}
    tall = {**dict.fromkeys(BOX_SIDES, w["post"]), "left": w["side"], "right": w["side"]}
    parts = [(box((0.84, 0.30, 0.02), flat), (0.0, 0.0, height - 0.01)) for height in boards_m]
    parts += [(box((0.02, 0.31, high - low), tall), (side * 0.43, 0.0, middle_m)) for side in (-1, 1)]
    parts.append((box((0.88, 0.01, high - low), dict.fromkeys(BOX_SIDES, w["back"])), (0.0, 0.16, middle_m)))
    bodies = [mesh.moved(Pose(np.eye(3), np.array(at))) for mesh, at in parts]
    return Placed(Thing("bookcase", joined(bodies, separate=True), texture), Pose.identity())
