"""Colours are compared as if the same light fell on them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracker.lighting import LEAST_POINTS, NO_LIGHT, colours_apart

RNG = np.random.default_rng(4)
COUNT = 400
NORMALS = RNG.normal(size=(COUNT, 3))
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)
LAB = np.column_stack((RNG.uniform(20, 80, COUNT), RNG.uniform(-40, 60, COUNT), RNG.uniform(-40, 60, COUNT)))
ALL = np.ones(COUNT, bool)


def lit(lab: np.ndarray, slope: tuple[float, float, float], gain: float = 1.0) -> np.ndarray:
    """The same paint where light falls from one side."""
    return (gain + NORMALS @ np.array(slope))[:, None] * (lab - NO_LIGHT) + NO_LIGHT


@pytest.mark.parametrize("slope", [(0.0, 0.0, 0.0), (0.15, 0.0, 0.0), (-0.1, 0.1, 0.08)])
@pytest.mark.parametrize("gain", [0.7, 1.0, 1.4])
def test_light_from_one_side_makes_no_other_colour(slope: tuple[float, float, float], gain: float) -> None:
    apart, usual = colours_apart(lit(LAB, slope, gain), LAB, NORMALS, ALL)
    assert np.percentile(apart, 95) < 2.5
    assert usual == pytest.approx(np.exp(-0.5 * (np.log(gain) / 0.5) ** 2), abs=0.05)


def test_print_that_is_elsewhere_is_told_from_light() -> None:
    printed = RNG.random(COUNT) < 0.25
    other = LAB.copy()
    other[printed] += (25, -60, 30)
    apart, _ = colours_apart(lit(other, (0.2, 0.1, 0.0)), LAB, NORMALS, ALL)
    assert np.median(apart[printed]) > 40
    assert np.median(apart[~printed]) < 3


def test_a_cast_of_colour_is_taken_off_at_a_cost() -> None:
    apart, usual = colours_apart(LAB + np.array((0, 10, -12)), LAB, NORMALS, ALL)
    assert apart.max() < 1e-6
    assert 0.3 < usual < 0.9


def test_brightness_of_another_object_is_not_explained_by_any_light() -> None:
    white, black = np.tile((95.0, 0, 0), (COUNT, 1)), np.tile((5.0, 0, 0), (COUNT, 1))
    assert colours_apart(white, black, NORMALS, ALL)[1] < 0.5


def test_only_what_is_known_says_what_the_light_is() -> None:
    known = np.arange(COUNT) < COUNT // 2
    other = lit(LAB, (0.2, 0.0, 0.1))
    other[~known] = (50, 80, -80)
    apart, _ = colours_apart(other, LAB, NORMALS, known)
    assert np.percentile(apart[known], 95) < 2.5
    assert np.median(apart[~known]) > 40


def test_it_turns_with_the_axes() -> None:
    R = Rotation.random(rng=np.random.default_rng(2)).as_matrix()
    other = lit(LAB, (0.2, -0.1, 0.1)) + RNG.normal(0, 3, LAB.shape)
    plain, turned = (colours_apart(other, LAB, normals, ALL) for normals in (NORMALS, NORMALS @ R.T))
    assert np.allclose(plain[0], turned[0], atol=1e-9)
    assert plain[1] == pytest.approx(turned[1])


def test_a_few_points_say_nothing_of_the_light() -> None:
    apart, usual = colours_apart(LAB, LAB, NORMALS, np.arange(COUNT) < LEAST_POINTS - 1)
    assert np.isinf(apart).all()
    assert usual == 0
