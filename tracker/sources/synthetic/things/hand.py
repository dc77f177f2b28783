"""A hand with a sleeve, as it reaches for things: hand frame at the finger tips, x towards the arm, y out of its back.

Metres. The palm faces -y, the thumb is at +z.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from tracker.sources.synthetic.things.drawing import Rgb, Sheet, grained
from tracker.sources.synthetic.things.mesh import Mesh, joined
from tracker.sources.synthetic.things.solids import curve, swept
from tracker.sources.synthetic.things.texture import Window, glossy, pack
from tracker.sources.synthetic.things.thing import Thing

SKINS: tuple[Rgb, ...] = ((226, 178, 148), (196, 140, 104), (120, 78, 54))
SLEEVES: tuple[Rgb, ...] = ((62, 84, 128), (140, 44, 48), (206, 204, 198))
FINGERS = ((-0.031, 0.016), (-0.010, 0.004), (0.011, 0.0), (0.031, 0.008))  # z, and where along x the tip is
KNUCKLES_M, WRIST_M, ELBOW_M = 0.085, 0.175, 0.55


@cache
def hand(number: int) -> Thing:
    """One of a few, by the number."""
    skin = Sheet(60, 60, SKINS[number % len(SKINS)], 2.0)
    sleeve = Sheet(60, 60, SLEEVES[number % len(SLEEVES)], 2.0)
    for y in range(0, 60, 4):
        sleeve.rectangle(0, y, 60, 0.8, (40, 42, 48))
    pictures = {"skin": glossy(grained(skin.finished, 4), 0.2), "sleeve": glossy(grained(sleeve.finished, 5), 0.02)}
    texture, w = pack(pictures)
    fingers = [_limb([(tip, z), (KNUCKLES_M + 0.01, z)], 0.0085, 0.0085, w["skin"]) for z, tip in FINGERS]
    thumb = _limb([(0.060, 0.068), (0.085, 0.062), (0.125, 0.036)], 0.0105, 0.0105, w["skin"])
    palm = _limb([(KNUCKLES_M - 0.006, 0.0), (0.130, 0.001), (WRIST_M, 0.0)], 0.041, 0.0135, w["skin"])
    wrist = _limb([(WRIST_M - 0.03, 0.0), (WRIST_M + 0.08, 0.0)], 0.028, 0.021, w["skin"])
    arm = _limb([(WRIST_M + 0.05, 0.0), (ELBOW_M, 0.0)], 0.042, 0.038, w["sleeve"])
    return Thing("hand", joined([*fingers, thumb, palm, wrist, arm], separate=True), texture)


def _limb(bones_m: list[tuple[float, float]], half_width_m: float, half_depth_m: float, window: Window) -> Mesh:
    """A tube along (x, z) places with round ends."""
    path = curve(bones_m)
    along = np.linspace(-1, 1, len(path))
    round_ends = np.sqrt(1 - (0.98 * along) ** 10)
    return swept(path, half_width_m * round_ends, half_depth_m * round_ends, sections=20).in_window(*window)
