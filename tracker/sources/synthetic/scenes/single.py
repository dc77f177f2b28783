"""Scenes of one object before a background: it is still, it moves, or it is lost from view."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tracker.geometry import Pose
from tracker.sources.synthetic.motion import around, handheld, looking, through, upright
from tracker.sources.synthetic.rendering.world import Placed
from tracker.sources.synthetic.scenes import furniture, room
from tracker.sources.synthetic.scenes.furniture import MAT_M
from tracker.sources.synthetic.scenes.layout import Layout, nudged, stand
from tracker.sources.synthetic.scenes.wood import WALNUT
from tracker.sources.synthetic.things import books, clutter
from tracker.sources.synthetic.things.objects import tracked_object


def _background(rng: np.random.Generator) -> list[Placed]:
    """A table with a mat and things at its far side, for one object in front."""
    return [
        furniture.table(rng, WALNUT),
        furniture.mat(rng, (112, 128, 132), 0.0, 0.02, 3),
        *room.walls(rng, (214, 204, 190)),
        stand(clutter.jar("coffee"), -0.25, 0.25, -80),
        stand(books.paths(), -0.155, 0.27, 15),
        stand(books.rivers(), -0.125, 0.27, 15),
        stand(books.night(), -0.085, 0.275, 15),
        stand(clutter.parcel(210, 150, 120), 0.07, 0.29, -8),
        stand(clutter.pencil_pot(), 0.23, 0.24, 0),
        stand(clutter.fruit("orange"), 0.28, 0.12, 0),
        stand(clutter.fruit("apple"), -0.28, 0.10, 0),
        stand(clutter.plant(), 0.38, 0.30, 0),
    ]


def turn(seed: int, hero: str) -> Layout:
    """The object is taken from one side of the mat to the other, as by a hand that is not to be seen."""
    rng = np.random.default_rng([seed, 11])
    thing = tracked_object(hero)
    start_deg = rng.uniform(-70, -40)
    way = through(
        (0.0, 0.4, 1.2, 2.0, 2.7, 3.0),
        [(-0.11, 0.02, 0, 0), (-0.11, 0.02, 0.02, 0), (-0.03, -0.03, 0.07, 1), (0.06, -0.02, 0.06, -0.6),
         (0.11, 0.04, 0.0, 0), (0.11, 0.04, 0.0, 0)],
    )  # fmt: skip

    def motion(time_s: float) -> Pose:
        x, y, lift, tilt = way(time_s % 6 if time_s % 6 <= 3 else 6 - time_s % 6)
        turned = Rotation.from_euler("ZXY", [start_deg + 38 * time_s, 12 * tilt, 8 * tilt], degrees=True)
        return Pose(turned.as_matrix(), np.array([x, y, MAT_M + thing.mesh.half_height_m + lift]))

    camera = around([0.0, 0.05, 0.08], 4, 30, 0.68)
    return Layout([Placed(thing, motion)], _background(rng), camera)


def still(seed: int, hero: str) -> Layout:
    """Nothing moves: what trembles in an estimate is the tracker's and the sensor's."""
    rng = np.random.default_rng([seed, 12])
    placed = stand(tracked_object(hero), 0.0, 0.02, -30, MAT_M)
    return Layout([nudged(placed, rng)], _background(rng), around([0.0, 0.03, 0.06], -8, 34, 0.64))


def leave(seed: int, hero: str) -> Layout:
    """A parcel is pushed through between camera and object; later the camera turns away and comes back."""
    rng = np.random.default_rng([seed, 13])
    placed = stand(tracked_object(hero), 0.0, 0.05, -25, MAT_M)
    wide = clutter.parcel(290, 100, 290)
    pushed = through((0.0, 0.5, 1.3, 1.7, 2.5), (-0.52, -0.52, -0.02, 0.02, 0.52))
    glance = through((2.4, 2.6, 3.5, 3.8, 4.7, 4.9), (0.0, 0.0, 0.62, 0.62, 0.0, 0.0))

    def parcel_motion(time_s: float) -> Pose:
        return upright(float(pushed(time_s)), -0.11, 4, wide.mesh.half_height_m, MAT_M)

    def camera_motion(time_s: float) -> Pose:
        look_m = np.array([0.9 * float(glance(time_s)), 0.05, 0.07])
        return looking(around([0.0, 0.05, 0.07], 6 + 4 * np.sin(1.1 * time_s), 27, 0.74).translation_m, look_m)

    occluder = Placed(wide, parcel_motion)
    return Layout([nudged(placed, rng)], [*_background(rng), occluder], handheld(camera_motion, seed))
