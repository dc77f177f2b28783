"""A scene before it is built, and putting things into it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.sources.synthetic.motion import Motion, lying, upright
from tracker.sources.synthetic.rendering.world import Placed
from tracker.sources.synthetic.things.thing import Thing


def faultless(frame: Frame) -> Frame:
    return frame


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """A scene before it is built. tracked: the objects with known poses. T_world_cam: fixed, or a motion. fault: what
    goes wrong with a frame after the sensor has taken it."""

    tracked: Sequence[Placed]
    surroundings: Sequence[Placed]
    T_world_cam: Pose | Motion
    fault: Callable[[Frame], Frame] = faultless


def stand(thing: Thing, x_m: float, y_m: float, yaw_deg: float, base_m: float = 0.0) -> Placed:
    return Placed(thing, upright(x_m, y_m, yaw_deg, thing.mesh.half_height_m, base_m))


def lay(thing: Thing, x_m: float, y_m: float, yaw_deg: float, base_m: float = 0.0) -> Placed:
    half_depth_m = float(np.ptp(thing.mesh.vertices_m[:, 1])) / 2
    return Placed(thing, lying(x_m, y_m, yaw_deg, half_depth_m, base_m))


def flat(book: Thing, x_m: float, y_m: float, yaw_deg: float, base_m: float) -> Placed:
    """A book on its side: cover (+x) up, spine (-y) to the camera."""
    turn = Rotation.from_euler("yz", [-90, yaw_deg], degrees=True).as_matrix()
    half_m = float(np.ptp(book.mesh.vertices_m[:, 0])) / 2
    return Placed(book, Pose(turn, np.array([x_m, y_m, base_m + half_m])))


def nudged(placed: Placed, rng: np.random.Generator) -> Placed:
    """The same, if it stands still, a few millimetres and degrees elsewhere, so that seeds differ."""
    if not isinstance(placed.T_world_thing, Pose):
        return placed
    nudge = Rotation.from_euler("z", rng.normal(0, 3), degrees=True).as_matrix()
    shift_m = np.append(rng.uniform(-0.005, 0.005, 2), 0.0)
    pose = placed.T_world_thing
    return Placed(placed.thing, Pose(nudge @ pose.rotation, pose.translation_m + shift_m))
