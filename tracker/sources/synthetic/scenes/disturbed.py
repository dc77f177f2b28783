"""Scenarios in which something comes between a camera and the object that it follows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tracker.frame import Frame
from tracker.geometry import Floats, Pose
from tracker.sources.synthetic.faults import relit, without_depth
from tracker.sources.synthetic.motion import through
from tracker.sources.synthetic.rendering.world import Placed
from tracker.sources.synthetic.scenes.layout import Layout, faultless
from tracker.sources.synthetic.scenes.stage import Stage, between, facing_camera, stage, turned
from tracker.sources.synthetic.things import clutter
from tracker.sources.synthetic.things.hand import hand as drawn_hand

JERK_M, JERK_DEG = 0.15, 40.0
BLIND_FRAMES = 10
WARM, DARK = 0.28, 0.75  # greatest changes: log of red against blue is twice the one, log of all the other


def hidden(seed: int, hero: str) -> Layout:
    """A carton held into the line of sight covers the object for a second, whatever it does meanwhile."""
    st = stage(seed, hero, 41)
    start_s, side = st.rng.uniform(0.40, 0.60), st.rng.choice([-1, 1])
    times_s = start_s + np.array([0.0, 0.30, 1.20, 1.50])
    across = through(times_s.tolist(), side * np.array([-0.50, -0.02, 0.02, 0.50]))
    wide_mm = 10 * round(66 * st.hero.mesh.diameter_m + 9)
    carton = clutter.parcel(wide_mm, 24, wide_mm)

    def motion(time_s: float) -> Pose:
        T_world_cam = st.T_world_cam(time_s)
        middle_cam = (T_world_cam.inverse() @ st.T_world_hero(time_s)).translation_m
        at_m = 0.66 * middle_cam + [float(across(time_s)), 0.0, 0.0]
        return facing_camera(T_world_cam, at_m)

    return _of(st, Placed(carton, motion))


def hand(seed: int, hero: str) -> Layout:
    """A hand reaches before a third of the object, stays for a second, and goes."""
    st = stage(seed, hero, 42)
    start_s, stay_s = st.rng.uniform(0.3, 0.5), st.rng.uniform(0.7, 1.0)
    away_m = through([start_s, start_s + 0.35, start_s + 0.35 + stay_s, start_s + 0.7 + stay_s], [0.45, 0, 0, 0.45])
    angle_rad = np.radians(st.rng.choice([st.rng.uniform(-15, 60), st.rng.uniform(120, 195)]))
    overlap = st.rng.uniform(0.7, 1.1)  # of what the object reaches from its middle towards the hand
    along = np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])

    def motion(time_s: float) -> Pose:
        T_world_cam = st.T_world_cam(time_s)
        T_cam_hero = T_world_cam.inverse() @ st.T_world_hero(time_s)
        points_m = T_cam_hero @ st.hero.mesh.vertices_m
        middle = T_cam_hero.translation_m
        edge_m = float(((points_m - middle) @ along).max())
        nearer = (points_m[:, 2].min() - 0.03) / middle[2]
        at_m = middle * nearer + along * (edge_m * (1 - overlap) * nearer + float(away_m(time_s)))
        return facing_camera(T_world_cam, at_m, angle_rad)

    return _of(st, Placed(drawn_hand(int(st.rng.integers(3))), motion))


def jerk(seed: int, hero: str) -> Layout:
    """The camera jumps by 15 cm and 40 degrees between two frames: to another bearing, to another roll, or past the
    object, which it finds again half a second later by another such jump."""
    st = stage(seed, hero, 43)
    kind, side = (seed + seed // 6) % 3, int(st.rng.choice([-1, 1]))
    first_frame = int(st.rng.integers(22, 30))
    first_s, second_s = between(first_frame), between(first_frame + int(st.rng.integers(12, 18)))
    slope_rad = st.rng.uniform(0, np.pi / 2)
    sideways_m = JERK_M * np.array([side, 0.0, 0.0])
    back_m = -JERK_M * np.array([0.0, np.cos(slope_rad), np.sin(slope_rad)])  # or up

    def motion(time_s: float) -> Pose:
        pose, jumped = st.T_world_cam(time_s), time_s >= first_s
        if kind == 0:
            half_deg = side * JERK_DEG / 2
            return turned(_shifted(pose, back_m), "y", half_deg) if jumped else turned(pose, "y", -half_deg)
        if kind == 1:
            return turned(_shifted(pose, sideways_m), "z", side * JERK_DEG) if jumped else pose
        if jumped and time_s < second_s:
            return turned(_shifted(pose, sideways_m), "y", side * JERK_DEG)
        return _shifted(_shifted(pose, sideways_m), back_m) if jumped else pose

    return Layout([Placed(st.hero, st.T_world_hero)], st.surroundings, motion)


def lights(seed: int, hero: str) -> Layout:
    """The light gets brighter or darker, and warmer or colder, in a frame or in a third of a second."""
    st = stage(seed, hero, 44)
    start_s = between(int(st.rng.integers(24, 34)))
    brightness, warmth = (st.rng.choice([-1, 1], 2) * st.rng.uniform(0.5, 1.0, 2)) * (DARK, WARM)
    change = through([start_s, start_s + float(st.rng.choice([0.01, 0.33]))], [0.0, 1.0])
    end = brightness + warmth * np.array([1.0, 0.0, -1.0])

    def fault(frame: Frame) -> Frame:
        share = float(change(frame.stamp_ns / 1e9))
        return relit(frame, np.exp(share * end)) if share > 0 else frame

    return _of(st, fault=fault)


def blind(seed: int, hero: str) -> Layout:
    """No pixel has depth for a third of a second."""
    st = stage(seed, hero, 45)
    first = int(st.rng.integers(22, 32))

    def fault(frame: Frame) -> Frame:
        return without_depth(frame) if first <= frame.index < first + BLIND_FRAMES else frame

    return _of(st, fault=fault)


def _shifted(pose: Pose, shift_m: Floats) -> Pose:
    """Moved along its own axes."""
    return pose @ Pose(np.eye(3), shift_m)


def _of(st: Stage, *beside: Placed, fault: Callable[[Frame], Frame] = faultless) -> Layout:
    return Layout([Placed(st.hero, st.T_world_hero)], [*st.surroundings, *beside], st.T_world_cam, fault)
