"""Turns of an object that nobody can tell apart, so that poses equivalent under them count as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tracker.errors import ConfigError
from tracker.geometry import ROTATION_TOLERANCE, Floats, Pose

MOST_TURNS = 360
AXIS_SLACK_RAD = 0.02  # how far a listed turn may miss the free axis; datasets' are measured, not exact
SAME_ELEMENT = 1e-3  # rad: two turns of a group nearer than this are one; turns of a degree are told apart
TIE = 1e-9  # of the half angle's cosine: equivalents that are equally near by so much keep the pose that was given


@dataclass(frozen=True, slots=True, eq=False)
class Symmetry:
    """The object looks the same after every one of the `turns`, and after any turn about the axis before it.

    turns: (S, 3, 3) rotations about the origin, the identity first. origin_m: (3,) in object coordinates, metres.
    axis: (3,) unit, through the origin, of an object that may be turned by any angle; None where there is none. With
    an axis, the turns that are left to tell are the identity and one that swaps its ends.
    """

    turns: Floats
    origin_m: Floats
    axis: Floats | None = None

    @classmethod
    def generated(cls, turns: Sequence[Floats], origin_m: Floats, axis: Floats | None = None) -> Symmetry:
        """The group that rotations (3, 3) and a free axis generate.

        Raises ConfigError where it has more than 360 turns, or where a turn moves the axis, as only a ball allows.
        """
        if axis is not None:
            return cls(_beside_the_axis(turns, axis), origin_m, axis)
        group = np.eye(3)[None]
        reached = group
        while len(reached):  # the products of what was new the last time
            products = [step @ turn for step in reached for turn in turns]
            before = len(group)
            for one in products:
                if angles_rad(group, one).min() > SAME_ELEMENT:
                    group = np.concatenate((group, one[None]))
                if len(group) > MOST_TURNS:
                    raise ConfigError(f"these turns make more than {MOST_TURNS} others: they fit no object's symmetry")
            reached = group[before:]
        return cls(group, origin_m)

    def __str__(self) -> str:
        if self.axis is None:
            return "none" if self.trivial else f"{len(self.turns)} turns look the same"
        ends = ", and its ends may be swapped" if len(self.turns) > 1 else ""
        return f"any turn about ({', '.join(f'{part:.2f}' for part in self.axis)}) looks the same{ends}"

    @property
    def trivial(self) -> bool:
        return len(self.turns) == 1 and self.axis is None

    def equivalents(self, T_cam_obj: Pose) -> list[Pose]:
        """The poses after each of the turns, the given one first; turns about the axis are left out."""
        return [self._turned(T_cam_obj, turn) for turn in self.turns]

    def nearest(self, T_cam_obj: Pose, to: Pose) -> Pose:
        """The equivalent pose at the least angle from another pose.

        About the axis a, in closed form: let the unit quaternion (w, v) be the rotation from `to` to a pose. Turned by
        t about a, its scalar part is w cos(t/2) - (v . a) sin(t/2), the cosine of half the angle that is left. Its
        magnitude is greatest, sqrt(w^2 + (v . a)^2), at t/2 = atan2(-(v . a), w): the twist of the swing-twist
        decomposition is undone. Where that is 0 all turns leave 180 degrees, and none is made.
        """
        if self.trivial:
            return T_cam_obj
        between = Rotation.from_matrix(to.rotation.T @ T_cam_obj.rotation @ self.turns, assume_valid=True)
        between = between.as_quat(scalar_first=True)
        twist = between[:, 1:] @ self.axis if self.axis is not None else np.zeros(len(between))
        cosine = np.hypot(between[:, 0], twist)
        k = 0 if cosine[0] > cosine.max() - TIE else int(cosine.argmax())
        turn = self.turns[k]
        if self.axis is not None and cosine[k] > TIE:
            turn = turn @ about(self.axis, 2 * np.arctan2(-twist[k], between[k, 0]))
        return self._turned(T_cam_obj, turn)

    def same(self, a: Pose, b: Pose, angle_rad: float, distance_m: float) -> bool:
        """Whether two poses are equivalent up to an angle and a distance, that of the symmetry's origin."""
        apart_m = np.linalg.norm(a @ self.origin_m[None] - b @ self.origin_m[None])
        return bool(apart_m <= distance_m) and self.nearest(a, b).angle_to_rad(b) <= angle_rad

    def distinct(self, poses: Sequence[Pose], angle_rad: float, distance_m: float) -> list[int]:
        """Indices of the poses that are not equivalent to one before them; of an object without symmetry, all."""
        kept: list[int] = []
        for k, pose in enumerate(poses):
            if self.trivial or not any(self.same(pose, poses[j], angle_rad, distance_m) for j in kept):
                kept.append(k)
        return kept

    def _turned(self, T_cam_obj: Pose, turn: Floats) -> Pose:
        return T_cam_obj @ Pose(turn, self.origin_m - turn @ self.origin_m)

    def packed(self) -> dict[str, Any]:
        """JSON-ready; `unpacked` reads it."""
        axis = None if self.axis is None else self.axis.tolist()
        return {"turns": self.turns.tolist(), "origin_m": self.origin_m.tolist(), "axis": axis}

    @classmethod
    def unpacked(cls, entry: Mapping[str, Any]) -> Symmetry:
        """Raises ValueError where it cannot be a symmetry."""
        try:
            turns, origin_m = np.array(entry["turns"], np.float64), np.array(entry["origin_m"], np.float64)
            axis = None if entry["axis"] is None else np.array(entry["axis"], np.float64)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"a symmetry has turns, origin_m and axis: {error!r}") from error
        if turns.ndim != 3 or turns.shape[1:] != (3, 3) or not 1 <= len(turns) <= MOST_TURNS:
            raise ValueError(f"a symmetry has 1 to {MOST_TURNS} turns of 3x3, got shape {turns.shape}")
        off = max(np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max(), np.abs(turns[0] - np.eye(3)).max())
        if not off < ROTATION_TOLERANCE or np.linalg.det(turns).min() < 0:
            raise ValueError("a symmetry's turns are rotations, the identity first")
        if origin_m.shape != (3,) or not np.isfinite(origin_m).all():
            raise ValueError(f"a symmetry's origin_m is three finite numbers, got {origin_m.tolist()}")
        if axis is not None and (axis.shape != (3,) or not abs(np.linalg.norm(axis) - 1) < ROTATION_TOLERANCE):
            raise ValueError(f"a symmetry's axis is a unit vector or null, got {axis.tolist()}")
        return cls(turns, origin_m, axis)


NO_SYMMETRY = Symmetry(np.eye(3)[None], np.zeros(3))


def about(axis: Floats, angle_rad: float) -> Floats:
    """(3, 3) turn about a unit vector."""
    return np.asarray(Rotation.from_rotvec(axis * angle_rad).as_matrix(), np.float64)


def angles_rad(turns: Floats, to: Floats) -> Floats:
    """(S,) angle between each of the rotations (S, 3, 3) and another (3, 3)."""
    # the chord |A - B| = 2 sqrt(2) sin(angle / 2) keeps its precision at small angles, where the trace has none
    chord = np.linalg.norm(turns - to, axis=(1, 2)) / np.sqrt(8)
    return np.asarray(2 * np.arcsin(np.minimum(chord, 1)), np.float64)


def _beside_the_axis(turns: Sequence[Floats], axis: Floats) -> Floats:
    """Of turns, what turns about the axis do not make already: nothing but the identity, or one that swaps its ends."""
    swap = []
    for turn in turns:
        along = float(axis @ turn @ axis)
        if abs(along) < np.cos(AXIS_SLACK_RAD):
            raise ConfigError(
                f"a turn moves the axis {np.round(axis, 3).tolist()}, about which every angle looks the same: "
                "beside such an axis only turns about it and half turns across it can be"
            )
        if along < 0 and not swap:
            swap.append(turn)
    return np.stack((np.eye(3), *swap))
