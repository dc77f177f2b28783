"""Scenarios in which something else stands where the object was."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

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
GONE_FRAMES = 100
NEXT_DOOR = Pose(np.eye(3), np.array([20.0, 0.0, 0.0]))  # T_world_room of the other room
MOVES_M = 0.04  # at most, until it is gone
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


def gone(seed: int, hero: str) -> Layout:
    """For a hundred frames the object is not there, though a look-alike is, beside where it was; in the second half of
    them the pictures are of another, darker room, where such a look-alike is, too. Then it is back, turned."""
    here, there = stage(seed, hero, 48), stage(seed, hero, 49)
    first = int(here.rng.integers(26, 34))
    gone_s, cut_s, back_s = (between(first + frames) for frames in (0, GONE_FRAMES // 2, GONE_FRAMES))
    turn = Rotation.from_euler("z", here.rng.choice([-1, 1]) * here.rng.uniform(40, 130), degrees=True).as_matrix()
    T_world_last = here.T_world_hero(gone_s)
    T_world_back = Pose(turn @ T_world_last.rotation, T_world_last.translation_m)
    hidden = placed_on_mat(here.hero, *ELSEWHERE_M, 0)

    def hero_motion(time_s: float) -> Pose:
        if gone_s < time_s < back_s:
            return NEXT_DOOR @ hidden if time_s > cut_s else hidden
        return here.T_world_hero(time_s) if time_s < gone_s else T_world_back

    def camera(time_s: float) -> Pose:
        return NEXT_DOOR @ there.T_world_cam(time_s) if cut_s < time_s < back_s else here.T_world_cam(time_s)

    other = look_alike(here.hero, here.rng.uniform(90, 270))
    beside_m = T_world_last.translation_m[0] + here.rng.choice([-1, 1]) * (2 * here.reach_m + GAP_M + MOVES_M)
    others = [
        Placed(other, placed_on_mat(other, beside_m, -MOVES_M, here.rng.uniform(-180, 180))),
        Placed(other, NEXT_DOOR @ placed_on_mat(other, 0.0, 0.0, there.rng.uniform(-180, 180))),
    ]
    next_door = [Placed(placed.thing, NEXT_DOOR @ placed.at(0.0)) for placed in there.surroundings]
    return Layout([Placed(here.hero, hero_motion)], [*here.surroundings, *next_door, *others], camera)


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
