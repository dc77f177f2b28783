"""Scenarios in which something else stands where the object was."""

from __future__ import annotations

import numpy as np

from tracker.geometry import Pose
from tracker.sources.synthetic.motion import Motion, through
from tracker.sources.synthetic.rendering.world import Placed
from tracker.sources.synthetic.scenes.layout import Layout
from tracker.sources.synthetic.scenes.stage import ELSEWHERE_M, GAP_M, between, placed_on_mat, stage
from tracker.sources.synthetic.things import clutter
from tracker.sources.synthetic.things.look_alike import look_alike
from tracker.sources.synthetic.things.objects import OBJECTS, tracked_object
from tracker.sources.synthetic.things.thing import Thing

OUTSIDE_M = 0.85  # x of what has been taken out of the picture
CARRIED_S = 0.45  # how long that takes
LIFT_M = 0.05
Stop = tuple[float, float, float, float]  # seconds, x and y in metres, yaw in degrees
SIMILAR = 3  # so many things nearest in size may take the object's place


def away(seed: int, hero: str) -> Layout:
    """The object is taken out of the picture and comes back elsewhere and turned. While it is away a look-alike is put
    about where it was, which stays."""
    st = stage(seed, hero, 46)
    side, out, back = st.rng.choice([-1, 1], 3)
    start_m = st.T_world_hero(0.0).translation_m
    end_m = [side * (st.reach_m + GAP_M + st.rng.uniform(0, 0.03)), st.rng.uniform(-0.04, 0.03)]
    other_m = [-side * (st.reach_m + GAP_M + st.rng.uniform(0, 0.03)), st.rng.uniform(-0.04, 0.03)]
    yaw_deg, turn_deg = st.rng.uniform(-180, 180), st.rng.choice([-1, 1]) * st.rng.uniform(40, 130)
    leaves_s, absent_s = st.rng.uniform(0.45, 0.65), st.rng.uniform(0.75, 1.0)
    gone_s = leaves_s + CARRIED_S
    returns_s = gone_s + absent_s
    leaving = _carried(
        st.hero,
        (leaves_s, start_m[0], start_m[1], yaw_deg),
        (gone_s, out * OUTSIDE_M, -0.03, yaw_deg),
    )
    returning = _carried(
        st.hero,
        (returns_s, back * OUTSIDE_M, -0.03, yaw_deg + turn_deg / 2),
        (returns_s + CARRIED_S, end_m[0], end_m[1], yaw_deg + turn_deg),
    )
    other = look_alike(st.hero, st.rng.uniform(90, 270))
    other_yaw_deg = yaw_deg + st.rng.uniform(-40, 40)
    other_way = _carried(
        other,
        (gone_s + 0.1, -out * OUTSIDE_M, -0.03, other_yaw_deg),
        (gone_s + 0.1 + CARRIED_S, other_m[0], other_m[1], other_yaw_deg),
    )

    def hero_way(time_s: float) -> Pose:
        return leaving(time_s) if time_s < (gone_s + returns_s) / 2 else returning(time_s)

    return Layout([Placed(st.hero, hero_way)], [*st.surroundings, Placed(other, other_way)], st.T_world_cam)


def swapped(seed: int, hero: str) -> Layout:
    """From one frame to the next another thing of about the object's size is where the object was, and stays there. The
    object, and its pose, are behind the wall from then on."""
    st = stage(seed, hero, 47)
    swap_s = between(int(st.rng.integers(24, 34)))
    others = sorted(_others(hero), key=lambda thing: abs(thing.mesh.diameter_m - st.hero.mesh.diameter_m))
    other = others[st.rng.integers(SIMILAR)]

    def in_its_place(time_s: float) -> Pose:
        place = st.T_world_hero(time_s)
        yaw_deg = np.degrees(np.arctan2(place.rotation[1, 0], place.rotation[0, 0]))
        return placed_on_mat(other, place.translation_m[0], place.translation_m[1], yaw_deg)

    def hero_motion(time_s: float) -> Pose:
        return st.T_world_hero(time_s) if time_s < swap_s else placed_on_mat(st.hero, *ELSEWHERE_M, 0)

    def other_motion(time_s: float) -> Pose:
        return placed_on_mat(other, *ELSEWHERE_M, 0) if time_s < swap_s else in_its_place(time_s)

    return Layout([Placed(st.hero, hero_motion)], [*st.surroundings, Placed(other, other_motion)], st.T_world_cam)


def _others(hero: str) -> list[Thing]:
    things = [tracked_object(name) for name in OBJECTS if name != hero]
    return [*things, clutter.parcel(140, 70, 90), clutter.parcel(160, 60, 230), clutter.jar("coffee")]


def _carried(thing: Thing, start: Stop, end: Stop) -> Motion:
    """From one place to the other, lifted a little in between."""
    way = through([start[0], end[0]], [start[1:], end[1:]])

    def motion(time_s: float) -> Pose:
        x_m, y_m, yaw_deg = (float(value) for value in way(time_s))
        nearest_m = min(float(np.hypot(x_m - stop[1], y_m - stop[2])) for stop in (start, end))
        return placed_on_mat(thing, x_m, y_m, yaw_deg, min(LIFT_M, nearest_m))

    return motion
