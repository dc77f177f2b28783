"""A spring clamp: two curved arms around a pivot, the lower one longer. Concave, dark, with coloured tips."""

from __future__ import annotations

import numpy as np

from tracker.geometry import Pose
from tracker.sources.synthetic.things import round_prints
from tracker.sources.synthetic.things.mesh import Mesh, joined
from tracker.sources.synthetic.things.solids import BOX_SIDES, Strip, box, curve, revolved, swept
from tracker.sources.synthetic.things.texture import Window, glossy, pack, plain
from tracker.sources.synthetic.things.thing import Thing

# The middle of the upper arm from jaw to grip: (x, z) in metres.
UPPER_ARM_M = (
    (0.080, 0.0062),
    (0.072, 0.016),
    (0.048, 0.027),
    (0.020, 0.017),
    (0, 0.012),
    (-0.030, 0.023),
    (-0.078, 0.048),
)
GRIP_STRETCH = 1.16  # the lower arm's, so that turning the clamp over does not map it to itself
DARK, ORANGE = (38, 40, 44), (236, 120, 24)


def clamp() -> Thing:
    pictures = {
        "upper": glossy(round_prints.clamp_arm(ORANGE, (214, 92, 20)), 0.3),
        "lower": glossy(round_prints.clamp_arm(ORANGE, DARK), 0.3),
        "cap": glossy(round_prints.pivot_cap(), 0.3),
        "dark": plain(DARK, 0.3),
        "coil": plain((150, 150, 152), 1.0),
    }
    texture, w = pack(pictures)
    upper = _arm(1.0, 1.0, w["upper"])
    lower = _arm(GRIP_STRETCH, -1.0, w["lower"])
    badge = box((0.017, 0.003, 0.017), {**dict.fromkeys(BOX_SIDES, w["dark"]), "front": w["cap"]})
    badge = badge.moved(Pose(np.eye(3), np.array([0, -0.0137, 0])))
    return Thing("clamp", joined([upper, lower, _pivot(w["dark"], w["coil"]), badge], separate=True).centred(), texture)


def _arm(stretch: float, side: float, window: Window) -> Mesh:
    path = curve([(x * (stretch if x < 0 else 1.0), side * z) for x, z in UPPER_ARM_M])
    along = np.linspace(0, 1, len(path))
    half_widths = np.interp(along, [0, 0.12, 0.4, 1], [0.0045, 0.0075, 0.0085, 0.0065])
    return swept(path, half_widths, np.full(len(path), 0.0105), roundness=0.55).in_window(*window)


def _pivot(dark: Window, coil: Window) -> Mesh:
    """A spring between two caps, its axis along y."""
    cylinder = revolved(
        [
            Strip([(0, 0.0135), (0.0118, 0.0135)], dark),
            Strip([(0.0118, 0.0135), (0.013, 0.0122), (0.013, 0.0105)], dark),
            Strip([(0.013, 0.0105), (0.013, -0.0105)], coil),
            Strip([(0.013, -0.0105), (0.013, -0.0122), (0.0118, -0.0135)], dark),
            Strip([(0.0118, -0.0135), (0, -0.0135)], dark),
        ],
        48,
    )
    return cylinder.moved(Pose(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.zeros(3)))
