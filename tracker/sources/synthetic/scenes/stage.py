"""Where the scenarios happen: an object on a cluttered table before a camera in a hand, varied by the seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tracker.geometry import Floats, Pose
from tracker.sources.synthetic.motion import RATE_HZ, Motion, around, handheld, lying, upright
from tracker.sources.synthetic.rendering.world import Placed
from tracker.sources.synthetic.scenes import furniture, room
from tracker.sources.synthetic.scenes.furniture import MAT_M
from tracker.sources.synthetic.scenes.layout import nudged, stand
from tracker.sources.synthetic.scenes.wood import OAK, PINE, WALNUT
from tracker.sources.synthetic.things import books, clutter
from tracker.sources.synthetic.things.drawing import Rgb
from tracker.sources.synthetic.things.objects import tracked_object
from tracker.sources.synthetic.things.thing import Thing

LIES = {"clamp"}
MATS: tuple[Rgb, ...] = ((112, 128, 132), (140, 104, 84), (84, 100, 84), (60, 66, 96))
PAINTS: tuple[Rgb, ...] = ((214, 204, 190), (204, 208, 202), (190, 200, 206), (222, 214, 170))
SMALL_THINGS_M = ((-0.25, 0.25), (0.23, 0.24), (0.30, 0.11), (-0.30, 0.09), (-0.38, 0.21))  # x, y
GAP_M = 0.015
ELSEWHERE_M = (0.0, 4.0)  # behind the wall: x, y of what is in the scene and not to be seen


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """hero: the object that is tracked. T_world_hero: how it stands, or is moved slowly as by a hand that is not to be
    seen. T_world_cam: a camera that hardly moves. surroundings: what is there beside. rng: for what else is varied."""

    hero: Thing
    T_world_hero: Motion
    T_world_cam: Motion
    surroundings: tuple[Placed, ...]
    rng: np.random.Generator

    @property
    def reach_m(self) -> float:
        """How far the hero reaches from its middle, seen from above."""
        return reach_m(self.hero)


def stage(seed: int, hero: str, scenario: int) -> Stage:
    """scenario: a number of its own, so that scenarios with one seed differ."""
    rng = np.random.default_rng([seed, scenario])
    thing = tracked_object(hero)
    x_m, y_m, yaw_deg = rng.uniform(-0.04, 0.04), rng.uniform(-0.03, 0.02), rng.uniform(-180, 180)
    moves = rng.random() < 0.5
    speed_mps, turning_dps = moves * rng.uniform(-0.03, 0.03, 2), moves * rng.uniform(-25, 25)

    def hero_motion(time_s: float) -> Pose:
        x, y = np.array([x_m, y_m]) + speed_mps * (time_s - 1.2)
        return placed_on_mat(thing, x, y, yaw_deg + turning_dps * time_s)

    azimuth_deg, elevation_deg, distance_m = rng.uniform(-25, 25), rng.uniform(24, 38), rng.uniform(0.60, 0.72)
    drift_dps, target_m = rng.uniform(-7, 7), np.array([rng.uniform(-0.02, 0.02), 0.0, 0.06])

    def camera_motion(time_s: float) -> Pose:
        return around(target_m, azimuth_deg + drift_dps * (time_s - 1.2), elevation_deg, distance_m)

    return Stage(thing, hero_motion, handheld(camera_motion, seed), _surroundings(rng), rng)


def placed_on_mat(thing: Thing, x_m: float, y_m: float, yaw_deg: float, lift_m: float = 0.0) -> Pose:
    """T_world_thing as the thing is wont to be put down: most stand, a clamp lies."""
    if thing.name.split()[0] in LIES:
        return lying(x_m, y_m, yaw_deg, float(np.ptp(thing.mesh.vertices_m[:, 1])) / 2, MAT_M + lift_m)
    return upright(x_m, y_m, yaw_deg, thing.mesh.half_height_m, MAT_M + lift_m)


def reach_m(thing: Thing) -> float:
    """Radius of the circle, seen from above, in which the thing fits however it is turned on the mat."""
    points_m = placed_on_mat(thing, 0, 0, 0) @ thing.mesh.vertices_m
    return float(np.hypot(points_m[:, 0], points_m[:, 1]).max())


def between(frame: int) -> float:
    """The time in seconds between a frame and the one before it: what changes then has changed in the frame."""
    return (frame - 0.5) / RATE_HZ


def facing_camera(T_world_cam: Pose, at_m: Floats, roll_rad: float = 0.0) -> Pose:
    """T_world_thing of something held before the camera at a place (3,) in camera coordinates: its x is the picture's,
    turned by the angle towards down; its y points away from the camera."""
    c, s = np.cos(roll_rad), np.sin(roll_rad)
    along, away = np.array([c, s, 0.0]), np.array([0.0, 0.0, 1.0])
    return T_world_cam @ Pose(np.stack((along, away, np.cross(along, away)), axis=1), at_m)


def turned(pose: Pose, axis: str, angle_deg: float) -> Pose:
    """Turned about one of its own axes."""
    return pose @ Pose(Rotation.from_euler(axis, angle_deg, degrees=True).as_matrix(), np.zeros(3))


def _surroundings(rng: np.random.Generator) -> tuple[Placed, ...]:
    wood = (OAK, WALNUT, PINE)[rng.integers(3)]
    small = [clutter.jar("coffee"), clutter.jar("honey"), clutter.pencil_pot(), clutter.fruit("orange")]
    small = [[*small, clutter.fruit("apple")][k] for k in rng.permutation(5)]
    things = [stand(thing, x, y, rng.uniform(-180, 180)) for thing, (x, y) in zip(small, SMALL_THINGS_M, strict=True)]
    shelf = [books.paths(), books.rivers(), books.night(), books.salt()]
    chosen = rng.permutation(4)[:3]
    things += [stand(shelf[k], x, 0.275, 15) for k, x in zip(chosen, (-0.155, -0.120, -0.080), strict=True)]
    things += [stand(clutter.parcel(210, 150, 120), 0.07, 0.30, -8), stand(clutter.plant(), 0.40, 0.31, 0)]
    kept = [thing for thing in things if rng.random() < 0.8]
    mat = furniture.mat(rng, MATS[rng.integers(len(MATS))], 0.0, 0.02, rng.uniform(-5, 5))
    walls = room.walls(rng, PAINTS[rng.integers(len(PAINTS))])
    return (furniture.table(rng, wood), mat, *walls, *(nudged(thing, rng) for thing in kept))
