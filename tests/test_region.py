"""Regions of an object's surface: where they are, how large, and which one where there are several."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.geometry import Floats, Pose
from tracker.region import Region, region_of

DIAMETER_M = 0.2
STEP_M = 0.004


def plate(width_m: float, height_m: float, at: tuple[float, float, float]) -> Floats:
    """A flat rectangle of points, STEP_M apart, centred at a place."""
    x, y = np.meshgrid(np.arange(0, width_m, STEP_M), np.arange(0, height_m, STEP_M))
    points = np.stack((x.ravel(), y.ravel(), np.zeros(x.size)), axis=1)
    return points - points.mean(axis=0) + at


def found(points: Floats, saliency: Floats) -> Region:
    region = region_of("red", points, saliency, DIAMETER_M)
    assert region is not None
    return region


BODY, HANDLE = plate(0.12, 0.08, (0, 0, 0)), plate(0.06, 0.02, (0.12, 0, 0))
BOTH = np.concatenate((BODY, HANDLE))
ON_HANDLE = np.r_[np.full(len(BODY), 0.02), np.full(len(HANDLE), 0.7)]


def test_a_region_is_where_the_concept_is_and_as_large() -> None:
    region = found(BOTH, ON_HANDLE)
    assert len(region.points) == len(HANDLE)
    assert region.centre_m == pytest.approx([0.12, 0, 0], abs=1e-6)
    assert region.extent_m == pytest.approx([0.056, 0.016, 0], abs=2.1 * STEP_M)
    assert abs(region.axes[0, 0]) == pytest.approx(1, abs=1e-6)
    assert np.linalg.det(region.axes) == pytest.approx(1)
    assert region.share == pytest.approx(1)
    assert region.weights == pytest.approx(1)


def test_where_it_was_seen_more_densely_it_is_not_pulled_to() -> None:
    once = found(BOTH, ON_HANDLE)
    end = HANDLE[HANDLE[:, 0] > 0.14]
    again = np.concatenate((BOTH, *[end + np.array((0, 0, 1e-4 * k)) for k in range(1, 6)]))
    twice = found(again, np.r_[ON_HANDLE, np.full(5 * len(end), 0.7)])
    assert np.linalg.norm(twice.centre_m - once.centre_m) < 0.002
    assert twice.points.mean(axis=0)[0] > once.points.mean(axis=0)[0] + 0.005  # their mean is


def test_of_two_places_the_heavier_counts_and_says_that_there_is_another() -> None:
    small = plate(0.02, 0.02, (-0.12, 0, 0))
    region = found(np.concatenate((BOTH, small)), np.r_[ON_HANDLE, np.full(len(small), 0.7)])
    assert region.centre_m[0] == pytest.approx(0.12, abs=1e-6)
    assert region.share == pytest.approx(len(HANDLE) / (len(HANDLE) + len(small)))


def test_a_large_faint_place_is_no_region_but_faint_edges_of_a_clear_one_are_of_it() -> None:
    faint = np.r_[np.full(len(BODY), 0.25), np.full(len(HANDLE), 0.7)]
    faint[len(BODY) :][HANDLE[:, 0] < 0.11] = 0.2
    region = found(BOTH, faint)
    assert region.centre_m == pytest.approx([0.12, 0, 0], abs=1e-6)
    assert region.weights.min() == pytest.approx(0.2 / 0.7)


@pytest.mark.parametrize("saliency", [np.zeros(len(BOTH)), np.full(len(BOTH), 0.05)])
def test_what_is_clear_nowhere_is_not_there(saliency: Floats) -> None:
    assert region_of("red", BOTH, saliency, DIAMETER_M) is None
    assert region_of("red", BOTH[:0], saliency[:0], DIAMETER_M) is None


@given(st.integers(0, 10_000))
def test_a_region_moves_with_the_object(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T = Pose.from_quaternion(rng.normal(size=4), rng.normal(size=3))
    moved, alone = found(T @ BOTH, ON_HANDLE), found(BOTH, ON_HANDLE).moved(T)
    assert np.allclose(moved.centre_m, alone.centre_m, atol=1e-9)
    assert np.allclose(moved.extent_m, alone.extent_m, atol=1e-9)
    assert np.allclose(np.abs(np.diag(moved.axes.T @ alone.axes)), 1, atol=1e-6)
    assert np.allclose(moved.points, alone.points)
