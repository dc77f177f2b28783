"""Directions that are spread over the sphere, and choosing among them the ones that are farthest apart."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from reference.viewsphere import (
    farthest_point_sampling,
    icosphere_directions,
    nearest_direction,
    widest_sampling,
)
from tracker.geometry import Floats


def directions(count: int, seed: int) -> Floats:
    drawn = np.random.default_rng(seed).normal(size=(count, 3))
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


def between_rad(a: Floats, b: Floats) -> Floats:
    """(N, M) angles."""
    return np.arccos(np.clip(a @ b.T, -1, 1))


@pytest.mark.parametrize(
    ("subdivisions", "least_deg", "most_deg"), [(0, 63, 64), (1, 31, 37), (2, 15, 19), (3, 7, 9.5)]
)
def test_an_icosphere_has_unit_directions_that_are_nearly_evenly_spread(
    subdivisions: int, least_deg: float, most_deg: float
) -> None:
    sphere = icosphere_directions(subdivisions)
    assert sphere.shape == (10 * 4**subdivisions + 2, 3)
    assert np.linalg.norm(sphere, axis=1) == pytest.approx(1)
    assert np.abs(sphere.mean(axis=0)).max() < 1e-12
    apart = between_rad(sphere, sphere) + 10 * np.eye(len(sphere))
    nearest_deg = np.degrees(apart.min(axis=1))
    assert least_deg < nearest_deg.min() <= nearest_deg.max() < most_deg
    assert between_rad(-sphere, sphere).min(axis=1).max() < 1e-6


@given(seed=st.integers(0, 10_000))
def test_the_nearest_direction_is_the_one_of_least_angle(seed: int) -> None:
    sphere, asked = icosphere_directions(2), directions(20, seed)
    angles = between_rad(asked, sphere)
    chosen = angles[np.arange(20), nearest_direction(asked, sphere)]
    assert chosen == pytest.approx(angles.min(axis=1), abs=1e-6)
    assert np.degrees(chosen.max()) < 11.5


def test_of_equally_near_directions_the_first_is_taken() -> None:
    axes = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    assert nearest_direction(np.array([[0, 1, 1.0], [1, 1, 1], [1, 0, 1]]), axes).tolist() == [1, 0, 0]


@given(seed=st.integers(0, 10_000), count=st.integers(1, 12))
def test_each_choice_is_as_far_as_can_be_from_those_before_it(seed: int, count: int) -> None:
    among = directions(40, seed)
    chosen = farthest_point_sampling(among, count, seed % 40)
    assert len(chosen) == len(set(chosen)) == count
    assert chosen[0] == seed % 40
    for k in range(1, count):
        distance_rad = between_rad(among, among[chosen[:k]]).min(axis=1)
        assert distance_rad[chosen[k]] == pytest.approx(distance_rad.max(), abs=1e-7)


@given(seed=st.integers(0, 10_000), turn=st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_the_choice_does_not_depend_on_how_the_sphere_is_turned(seed: int, turn: list[float]) -> None:
    among = directions(30, seed)
    turned = among @ Rotation.from_rotvec(turn).as_matrix().T
    assert farthest_point_sampling(turned, 8, 3) == farthest_point_sampling(among, 8, 3)


def test_the_choice_goes_on_where_it_stopped_when_more_are_wanted() -> None:
    among = directions(50, 1)
    assert farthest_point_sampling(among, 12, 7)[:5] == farthest_point_sampling(among, 5, 7)


def test_from_the_six_axes_the_opposite_one_comes_second_and_then_the_first_of_the_rest() -> None:
    axes = np.array([[0, 0, 1.0], [0, 0, -1], [0, 1, 0], [0, -1, 0], [1, 0, 0], [-1, 0, 0]])
    assert farthest_point_sampling(axes, 4, 4) == [4, 5, 0, 1]
    assert sorted(farthest_point_sampling(axes, 99, 0)) == [0, 1, 2, 3, 4, 5]


def test_copies_of_what_is_chosen_are_not_chosen() -> None:
    among = np.repeat(directions(3, 0), [4, 1, 5], axis=0)
    chosen = farthest_point_sampling(among, 10, 2)
    assert chosen[0] == 2
    assert len(chosen) == 3
    assert len(np.unique(among[chosen], axis=0)) == 3


def test_directions_that_differ_by_a_hair_are_told_apart() -> None:
    hair_rad = 3e-6
    among = np.array([[np.sin(k * hair_rad), 0, np.cos(k * hair_rad)] for k in range(4)])
    assert farthest_point_sampling(among, 3, 0) == [0, 3, 1]


def test_an_angle_counts_as_much_as_its_direction_is_worth() -> None:
    fan = np.array([[np.cos(a), np.sin(a), 0] for a in np.radians((0, 30, 70))])
    assert farthest_point_sampling(fan, 2, 0) == [0, 2]
    assert farthest_point_sampling(fan, 2, 0, np.array([1, 1, 0.4])) == [0, 1]


def test_the_widest_sampling_does_not_begin_in_the_middle_unless_one_is_wanted() -> None:
    fan = np.array([[np.cos(a), np.sin(a), 0] for a in np.radians((0, -40, -20, 20, 40))])
    assert sorted(widest_sampling(fan, 2, np.ones(5))) == [1, 4]
    assert widest_sampling(fan, 1, np.ones(5)) == [0]
    assert sorted(widest_sampling(fan, 3, np.ones(5))) == [0, 1, 4]
    assert sorted(widest_sampling(fan, 2, np.array([1, 0.2, 1, 1, 1]))) == [2, 4]
