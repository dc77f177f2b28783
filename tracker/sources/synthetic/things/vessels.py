"""The round objects: a soup can, a mug, a bowl. Object frame: centre of the bounding box, z up, metres."""

from __future__ import annotations

import numpy as np

from tracker.sources.synthetic.things import round_prints
from tracker.sources.synthetic.things.mesh import joined
from tracker.sources.synthetic.things.solids import Strip, curve, revolved, swept
from tracker.sources.synthetic.things.texture import glossy, pack, plain
from tracker.sources.synthetic.things.thing import Thing


def soup_can() -> Thing:
    pictures = {
        "label": glossy(round_prints.soup_label(), 0.35),
        "lid": glossy(round_prints.metal_lid(), 1.0),
        "rim": plain((206, 206, 202), 1.0),
    }
    texture, w = pack(pictures)
    left, top, right, bottom = w["lid"]
    middle_out = (left, bottom, right, top)  # the lid's picture begins at the rim, the profile in the middle
    strips = [
        Strip([(0, 0.0480), (0.0312, 0.0480)], middle_out),
        Strip([(0.0312, 0.0480), (0.0318, 0.0508), (0.0330, 0.0515), (0.0342, 0.0508), (0.0342, 0.0480)], w["rim"]),
        Strip([(0.0342, 0.0480), (0.0335, 0.0455)], w["rim"]),
        Strip([(0.0335, 0.0455), (0.0335, -0.0455)], w["label"]),
        Strip([(0.0335, -0.0455), (0.0342, -0.0480)], w["rim"]),
        Strip(
            [(0.0342, -0.0480), (0.0342, -0.0508), (0.0330, -0.0515), (0.0318, -0.0508), (0.0312, -0.0480)], w["rim"]
        ),
        Strip([(0.0312, -0.0480), (0, -0.0480)], w["lid"]),
    ]
    return Thing("soup_can", revolved(strips), texture)


def mug() -> Thing:
    glaze, coral = plain(round_prints.GLAZE, 0.6), plain(round_prints.CORAL, 0.6)
    violet = plain(round_prints.VIOLET, 0.6)  # nothing else on the mug is of the handle's colour
    texture, w = pack({"wrap": glossy(round_prints.mug_wrap(), 0.6), "glaze": glaze, "coral": coral, "violet": violet})
    cup = revolved(
        [
            Strip([(0, -0.041), (0.034, -0.041), (0.037, -0.038), (0.0378, 0.044)], w["coral"]),
            Strip([(0.0378, 0.044), (0.0388, 0.0465), (0.0402, 0.0472), (0.0414, 0.0465), (0.042, 0.0440)], w["glaze"]),
            Strip([(0.042, 0.0440), (0.0418, 0.0), (0.0412, -0.0405)], w["wrap"]),
            Strip([(0.0412, -0.0405), (0.0395, -0.0455), (0.037, -0.0470), (0.034, -0.0470)], w["glaze"]),
            Strip([(0.034, -0.0470), (0.032, -0.0445), (0, -0.0445)], w["glaze"]),
        ]
    )
    path = curve([(0.0405, 0.029), (0.054, 0.031), (0.068, 0.022), (0.072, 0.001), (0.065, -0.020), (0.0400, -0.030)])
    ends = 1 + 0.35 * np.linspace(-1, 1, len(path)) ** 8  # the handle widens where it meets the wall
    handle = swept(path, 0.0042 * ends, 0.0068 * ends).in_window(*w["violet"])
    return Thing("mug", joined([cup, handle], separate=True).centred(), texture)


def bowl() -> Thing:
    texture, windows = pack({"rings": glossy(round_prints.bowl_rings(), 0.55)})
    left, top, right, bottom = windows["rings"]
    angle = np.linspace(0, np.pi / 2, 20)
    inside = [(0.0745 * np.sin(a), 0.0275 - 0.0475 * np.cos(a)) for a in angle]
    outside = [(0.0330 + 0.0455 * np.cos(a) ** 0.8, 0.0275 - 0.0490 * np.sin(a)) for a in angle]
    rim = [(0.0765 - 0.002 * np.cos(a), 0.0275 + 0.002 * np.sin(a)) for a in np.linspace(0, np.pi, 9)]
    foot = [(0.0330, -0.0215), (0.0315, -0.0290), (0.0285, -0.0290), (0.0270, -0.0245), (0, -0.0245)]
    shares = (0.0, 0.48, 0.52, 0.91, 1.0)
    strips = [
        Strip(
            [(float(r), float(z)) for r, z in points], (left, top + (bottom - top) * a, right, top + (bottom - top) * b)
        )
        for points, a, b in zip((inside, rim, outside, foot), shares[:-1], shares[1:], strict=True)
    ]
    return Thing("bowl", revolved(strips, 128).centred(), texture, symmetric=True)
