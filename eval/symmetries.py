"""An object's symmetries as BOP lists them, and the finite set of motions over which symmetric errors take a minimum.

A dataset's list is taken as it stands: no products are added and no turn is moved to the nearest one of a group, as
numbers are compared with those of the BOP toolkit, which does neither (`misc.get_symmetry_transformations`).
https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from tracker.geometry import ROTATION_TOLERANCE, Floats

MAX_SYM_DISC_STEP = 0.01  # BOP: no vertex moves by more than this share of the diameter between two steps
MOST_LISTED = 1000  # each is followed by every step about each axis: what a file can ask for is bounded
STEPS = int(np.ceil(np.pi / MAX_SYM_DISC_STEP))  # 315 an axis


@dataclass(frozen=True, slots=True, eq=False)
class Motions:
    """x -> turns[s] @ x + shifts_m[s] in object coordinates. turns: (S, 3, 3). shifts_m: (S, 3). The first is none."""

    turns: Floats
    shifts_m: Floats

    def __len__(self) -> int:
        return len(self.turns)

    def of_point(self, point_m: Floats) -> Floats:
        """(S, 3) where each of the motions takes one point."""
        return self.turns @ point_m + self.shifts_m


@dataclass(frozen=True, slots=True, eq=False)
class ObjectSymmetries:
    """What an object's shape and look allow.

    discrete: the motions of the list, the identity first. axes: (C, 3) unit vectors in object coordinates about which
    any turn looks the same. offsets_m: (C, 3) a point on each.
    """

    discrete: Motions
    axes: Floats
    offsets_m: Floats

    @classmethod
    def listed(
        cls, discrete: npt.ArrayLike = (), axes: npt.ArrayLike = (), offsets_m: npt.ArrayLike = ()
    ) -> ObjectSymmetries:
        """discrete: (D, 4, 4) rigid motions, metres, without the identity. axes: (C, 3), offsets_m: (C, 3).

        Raises ValueError where one is no rigid motion, or no direction.
        """
        matrices = np.concatenate((np.eye(4)[None], np.reshape(np.asarray(discrete, np.float64), (-1, 4, 4))))
        turns = matrices[:, :3, :3]
        off = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max()
        last_rows = np.abs(matrices[:, 3] - [0, 0, 0, 1]).max()
        # written so that what is not a number fails too
        if not max(off, last_rows) < ROTATION_TOLERANCE or not np.linalg.det(turns).min() > 0:
            raise ValueError(f"a symmetry is a rotation and a shift, row by row 4x4; got {matrices[1:].tolist()}")
        directions = np.reshape(np.asarray(axes, np.float64), (-1, 3))
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        points_m = np.reshape(np.asarray(offsets_m, np.float64), (-1, 3))
        if not np.isfinite(matrices).all() or not np.isfinite(points_m).all() or not (lengths > 0).all():
            raise ValueError(f"a symmetry is finite and its axis a direction; got {directions.tolist()}")
        if max(len(matrices), len(directions)) > MOST_LISTED:
            raise ValueError(
                f"at most {MOST_LISTED} motions and axes are read, got {len(matrices)} and {len(directions)}"
            )
        if len(points_m) != len(directions):
            raise ValueError(f"every axis has a point on it; got {len(directions)} axes and {len(points_m)} points")
        return cls(Motions(turns, matrices[:, :3, 3]), directions / lengths, points_m)

    @classmethod
    def from_models_info(cls, entry: Mapping[str, Any]) -> ObjectSymmetries:
        """Of one object's entry in models_info.json: `symmetries_discrete` and `symmetries_continuous`, millimetres.

        Raises ValueError, KeyError or TypeError where the entry is not what BOP has there.
        """
        discrete = np.reshape(np.array(entry.get("symmetries_discrete", ()), np.float64), (-1, 4, 4))
        discrete[:, :3, 3] /= 1000
        continuous = entry.get("symmetries_continuous", ())
        offsets_m = np.array([c["offset"] for c in continuous], np.float64) / 1000
        return cls.listed(discrete, [c["axis"] for c in continuous], offsets_m)

    @property
    def trivial(self) -> bool:
        return len(self.discrete) == 1 and not len(self.axes)

    def motions(self, steps: int = STEPS) -> Motions:
        """All discrete motions, each followed by every turn about an axis, `steps` of them a round.

        Of several axes the turns stand side by side, as in the BOP toolkit; they are not combined.
        """
        if not len(self.axes):
            return self.discrete
        angles = 2 * np.pi * np.arange(steps) / steps
        turns = np.concatenate([Rotation.from_rotvec(np.outer(angles, axis)).as_matrix() for axis in self.axes])
        offsets_m = np.repeat(self.offsets_m, steps, axis=0)
        shifts_m = offsets_m - np.einsum("tij,tj->ti", turns, offsets_m)
        after = [(turns @ turn, turns @ shift_m + shifts_m) for turn, shift_m in self._pairs()]
        return Motions(np.concatenate([turn for turn, _ in after]), np.concatenate([shift_m for _, shift_m in after]))

    def _pairs(self) -> list[tuple[Floats, Floats]]:
        return list(zip(self.discrete.turns, self.discrete.shifts_m, strict=True))


ASYMMETRIC = ObjectSymmetries.listed()
