"""Where cameras and things are over time. World frame: z up, the table top is z = 0, metres; times in seconds."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from tracker.geometry import Floats, Pose

Motion = Callable[[float], Pose]
RATE_HZ = 30.0  # of the frames


def upright(x_m: float, y_m: float, yaw_deg: float, half_height_m: float, base_m: float = 0.0) -> Pose:
    """T_world_thing of a thing that stands with its foot at height `base_m`."""
    turn = Rotation.from_euler("z", yaw_deg, degrees=True).as_matrix()
    return Pose(turn, np.array([x_m, y_m, base_m + half_height_m]))


def lying(x_m: float, y_m: float, yaw_deg: float, half_depth_m: float, base_m: float = 0.0) -> Pose:
    """T_world_thing of a thing that lies on its back: its front (-y) looks up."""
    turn = Rotation.from_euler("xz", [-90, yaw_deg], degrees=True).as_matrix()
    return Pose(turn, np.array([x_m, y_m, base_m + half_depth_m]))


def looking(eye_m: npt.ArrayLike, target_m: npt.ArrayLike) -> Pose:
    """T_world_cam of a level camera (x right, y down, z forward) at `eye` with `target` in its middle."""
    eye = np.asarray(eye_m, float)
    forward = np.asarray(target_m, float) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return Pose(np.stack((right, np.cross(forward, right), forward), axis=1), eye)


def around(target_m: npt.ArrayLike, azimuth_deg: float, elevation_deg: float, distance_m: float) -> Pose:
    """T_world_cam of a camera that looks at the target; azimuth 0 looks along +y, positive from the right (+x)."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    level = np.cos(elevation)
    way = np.array([np.sin(azimuth) * level, -np.cos(azimuth) * level, np.sin(elevation)])
    return looking(np.asarray(target_m) + distance_m * way, target_m)


def swing(time_s: float, period_s: float) -> float:
    """From -1 (at time 0) to 1 and back in a period, at a steady pace with soft turns."""
    softness = 0.97
    return float(np.arcsin(-softness * np.cos(2 * np.pi * time_s / period_s)) / np.arcsin(softness))


def through(times_s: Sequence[float], values: npt.ArrayLike) -> Callable[[float], Floats]:
    """A smooth way through values (N,) or (N, k) that never overshoots and rests at both ends."""
    way = PchipInterpolator(times_s, np.asarray(values, float), axis=0)
    return lambda time_s: way(np.clip(time_s, times_s[0], times_s[-1]))


def handheld(motion: Motion, seed: int, turn_deg: float = 0.35, shift_m: float = 0.002) -> Motion:
    """The motion with the tremble of a hand on top: a few slow waves in each of the six directions."""
    rng = np.random.default_rng([seed, 20])
    rates_hz = rng.uniform(0.3, 2.6, (6, 4))
    phases_rad = rng.uniform(0, 2 * np.pi, (6, 4))
    sizes = rng.uniform(0.4, 1.0, (6, 4)) / np.sqrt(1 + rates_hz**2)
    sizes *= np.repeat([np.radians(turn_deg), shift_m], 3)[:, None]

    def shaken(time_s: float) -> Pose:
        twist = (sizes * np.sin(2 * np.pi * rates_hz * time_s + phases_rad)).sum(axis=1)
        return motion(time_s) @ Pose.exp(twist)

    return shaken
