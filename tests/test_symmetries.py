"""Symmetries as BOP lists them: how many motions they make, that each is one, and what cannot be one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from eval.symmetries import ASYMMETRIC, STEPS, ObjectSymmetries

OVER = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]  # half a turn about x
ROUND = {"axis": [0, 0, 2], "offset": [10, 0, 0]}


def test_an_axis_is_stepped_through_as_the_bop_toolkit_does() -> None:
    assert STEPS == 315
    assert len(ASYMMETRIC.motions()) == 1
    for entry, count in (
        ({"symmetries_discrete": [OVER]}, 2),
        ({"symmetries_continuous": [ROUND]}, 315),
        ({"symmetries_continuous": [ROUND], "symmetries_discrete": [OVER]}, 630),
        ({"symmetries_continuous": [ROUND, {"axis": [1, 0, 0], "offset": [0, 0, 0]}]}, 630),
        ({"symmetries_continuous": [], "symmetries_discrete": []}, 1),
    ):
        symmetries = ObjectSymmetries.from_models_info(entry)
        assert len(symmetries.motions()) == count
        assert symmetries.trivial == (count == 1)


def test_turns_about_an_axis_leave_its_points_and_come_after_the_discrete_ones() -> None:
    listed = list(OVER)
    listed[11] = 7  # millimetres up
    symmetries = ObjectSymmetries.from_models_info({"symmetries_continuous": [ROUND], "symmetries_discrete": [listed]})
    motions = symmetries.motions(4)
    assert len(motions) == 8
    assert np.allclose(motions.of_point(np.array([0.01, 0, 0.5]))[:4], [0.01, 0, 0.5])
    # (11, 2, 3) mm goes over to (11, -2, -3 + 7), which is (1, -2) beside the axis; then quarter turns about that
    place_mm = 1000 * motions.of_point(np.array([0.011, 0.002, 0.003]))
    assert np.allclose(place_mm[4:], [[11, -2, 4], [12, 1, 4], [9, 2, 4], [8, -1, 4]])


def test_motions_are_rigid_and_the_first_is_none() -> None:
    motions = ObjectSymmetries.from_models_info(
        {"symmetries_continuous": [ROUND], "symmetries_discrete": [OVER]}
    ).motions()
    assert np.allclose(motions.turns @ motions.turns.transpose(0, 2, 1), np.eye(3))
    assert np.allclose(np.linalg.det(motions.turns), 1)
    assert (motions.turns[0] == np.eye(3)).all()
    assert not motions.shifts_m[0].any()


@pytest.mark.parametrize(
    "entry",
    [
        {"symmetries_discrete": [[1, 0, 0]]},
        {"symmetries_discrete": [[-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]},  # a mirror
        {"symmetries_discrete": [[float("nan")] * 16]},
        {"symmetries_discrete": [[*OVER[:3], float("nan"), *OVER[4:]]]},
        {"symmetries_discrete": np.transpose(np.reshape([*OVER[:3], 900.0, *OVER[4:]], (4, 4))).tolist()},
        {"symmetries_discrete": [np.eye(4).ravel().tolist()] * 2000},
        {"symmetries_continuous": [{"axis": [0, 0, 0], "offset": [0, 0, 0]}]},
        {"symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, float("inf")]}]},
        {"symmetries_continuous": [{"axis": [0, 0, 1], "offset": []}]},
    ],
)
def test_what_is_no_symmetry_is_refused(entry: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"symmetry|reshape|axis|at most 1000 motions"):
        ObjectSymmetries.from_models_info(entry)
