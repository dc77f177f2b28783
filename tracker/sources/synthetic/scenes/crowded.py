"""Scenes with all objects among clutter, seen by a camera that is carried around."""

from __future__ import annotations

import numpy as np

from tracker.geometry import Pose
from tracker.sources.synthetic.motion import around, handheld, looking, swing, through
from tracker.sources.synthetic.rendering.world import Placed
from tracker.sources.synthetic.scenes import furniture, room
from tracker.sources.synthetic.scenes.layout import Layout, flat, lay, nudged, stand
from tracker.sources.synthetic.scenes.stage import placed_on_mat
from tracker.sources.synthetic.things import books, clutter
from tracker.sources.synthetic.things.objects import SECOND, tracked_object


def tabletop(seed: int, _hero: str) -> Layout:
    rng = np.random.default_rng([seed, 10])
    tracked = [
        stand(tracked_object("cereal_box"), -0.13, 0.15, 16),
        stand(tracked_object("tea_box"), 0.19, 0.13, -24),
        stand(tracked_object("soup_can"), 0.03, 0.095, 14),
        stand(tracked_object("mug"), -0.075, -0.055, -28),
        lay(tracked_object("clamp"), -0.25, -0.03, 28),
        stand(tracked_object("bowl"), 0.155, -0.055, 0),
    ]
    things = [
        stand(clutter.fruit("apple"), 0.025, -0.125, 0),
        stand(clutter.fruit("orange"), -0.165, -0.115, 40),
        stand(clutter.jar("honey"), -0.335, 0.10, -60),
        stand(clutter.jar("coffee"), 0.29, 0.03, -100),
        stand(clutter.pencil_pot(), -0.005, 0.012, 0),
        flat(books.gardens(), 0.43, 0.17, -14, 0.0),
        flat(books.rivers(), 0.43, 0.175, 8, 0.024),
        stand(clutter.plant(), -0.42, 0.31, 0),
        stand(clutter.parcel(210, 150, 120), 0.26, 0.32, 12),
        stand(books.night(), -0.02, 0.34, 80),
    ]
    camera = handheld(
        lambda t: around(
            [0.01, 0.0, 0.07],
            50 * swing(t, 6.0),
            30 + 6 * np.sin(2 * np.pi * t / 4.3 + 0.4),
            0.70 + 0.05 * np.sin(2 * np.pi * t / 5.1),
        ),
        seed,
    )
    placed = [nudged(p, rng) for p in tracked]
    around_it = [furniture.table(rng), *room.walls(rng, (204, 208, 202)), *(nudged(p, rng) for p in things)]
    return Layout(placed, around_it, camera)


def shelf(seed: int, _hero: str) -> Layout:
    rng = np.random.default_rng([seed, 14])
    low, middle, high = 0.0, 0.27, 0.55
    tracked = [
        stand(tracked_object("tea_box"), -0.20, -0.06, 12, middle),
        stand(tracked_object("soup_can"), -0.05, -0.08, -10, middle),
        stand(tracked_object("mug"), 0.10, -0.07, -40, middle),
        stand(tracked_object("cereal_box"), -0.26, -0.02, -10, low),
        stand(tracked_object("bowl"), -0.01, 0.0, 0, low),
        lay(tracked_object("clamp"), 0.22, -0.07, -150, low + 0.064),
    ]
    things = [
        flat(books.gardens(), 0.22, -0.02, -6, low),
        flat(books.night(), 0.22, -0.02, 4, low + 0.024),
        stand(books.rivers(), 0.21, 0.0, 0, middle),
        stand(books.paths(), 0.245, 0.0, 0, middle),
        stand(books.salt(), 0.287, 0.0, 0, middle),
        stand(clutter.jar("honey"), -0.13, 0.05, -90, low),
        stand(clutter.jar("coffee"), 0.04, 0.06, -90, middle),
        stand(clutter.fruit("apple"), 0.075, -0.125, 0, low),
        stand(clutter.fruit("orange"), -0.32, -0.05, 0, middle),
    ]

    def camera(time_s: float) -> Pose:
        side = swing(time_s, 7.0)
        eye_m = [0.30 * side, -0.78 + 0.05 * np.sin(1.7 * time_s), 0.40 + 0.10 * np.sin(1.3 * time_s + 1)]
        return looking(eye_m, [0.10 * side, 0.0, 0.24])

    around_it = [furniture.bookcase(rng, (low, middle, high)), *room.walls(rng, (190, 200, 206)), *things]
    return Layout([nudged(p, rng) for p in tracked], around_it, handheld(camera, seed))


def twins(seed: int, hero: str) -> Layout:
    """Two that are alike; one is taken along before the other, which it hides, to that one's other side."""
    rng = np.random.default_rng([seed, 15])
    one, other = tracked_object(hero), tracked_object(f"{hero}{SECOND}")
    past = through((0.6, 2.4), [(-0.17, 0.0), (0.17, 100.0)])

    def motion(time_s: float) -> Pose:
        x_m, turned_deg = past(time_s)
        return placed_on_mat(other, x_m, -0.09, -20 + turned_deg)

    camera = handheld(lambda t: around([0.0, 0.0, 0.06], 3 + 4 * np.sin(t), 22, 0.66), seed)
    around_it = [
        furniture.table(rng),
        furniture.mat(rng, (112, 128, 132), 0.0, 0.02, 3),
        *room.walls(rng, (214, 204, 190)),
        nudged(stand(clutter.jar("coffee"), -0.25, 0.25, -80), rng),
        nudged(stand(clutter.parcel(210, 150, 120), 0.07, 0.29, -8), rng),
        nudged(stand(clutter.fruit("orange"), 0.28, 0.12, 0), rng),
    ]
    return Layout(
        [nudged(Placed(one, placed_on_mat(one, 0.0, 0.05, -50)), rng), Placed(other, motion)], around_it, camera
    )
