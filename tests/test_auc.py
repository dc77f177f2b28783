"""The integrations against the constants of metrics.md, and what holds for each of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eval.auc import auc_exact, auc_mean_recall, auc_trapezoid, auc_vocap, recall_below, share_over

CLASS_A_M = np.array([4, 8, 12, 60, 130]) / 1000
CLASS_B_M = np.array([10, 30]) / 1000
INTEGRATIONS: list[Callable[..., float]] = [auc_vocap, auc_exact, auc_trapezoid, auc_mean_recall]

errors_m = st.lists(st.floats(0, 0.3) | st.just(np.inf), min_size=1, max_size=30)


@pytest.mark.parametrize(
    ("auc", "a", "b", "mean_of_classes", "pooled"),
    [
        (auc_vocap, "75.20", "95.00", "85.10", "76.57"),
        (auc_exact, "63.20", "80.00", "71.60", "68.00"),
        (auc_trapezoid, "63.60", "80.50", "72.05", "68.43"),
        (auc_mean_recall, "63.40", "81.00", "72.20", "68.43"),
        (partial(auc_mean_recall, steps=10), "68.00", "85.00", "76.50", "72.86"),
    ],
)
def test_agrees_with_the_constants(
    auc: Callable[..., float], a: str, b: str, mean_of_classes: str, pooled: str
) -> None:
    values = auc(CLASS_A_M), auc(CLASS_B_M)
    assert [f"{value:.2f}" for value in values] == [a, b]
    assert f"{np.mean(values):.2f}" == mean_of_classes
    assert f"{auc(np.concatenate((CLASS_A_M, CLASS_B_M))):.2f}" == pooled


@pytest.mark.parametrize("auc", INTEGRATIONS)
def test_no_pose_within_the_threshold_is_zero(auc: Callable[..., float]) -> None:
    assert auc([np.inf, 0.1001]) == 0


@pytest.mark.parametrize("auc", INTEGRATIONS)
def test_all_poses_perfect_is_a_hundred(auc: Callable[..., float]) -> None:
    assert auc([0.0, 0.0]) == pytest.approx(100)


@pytest.mark.parametrize("measure", [*INTEGRATIONS, lambda e: recall_below(e, 0.1), lambda e: share_over(e, 0.1)])
def test_no_instance_at_all_is_not_a_number_and_warns(measure: Callable[..., float]) -> None:
    with pytest.warns(RuntimeWarning, match="not one instance"):
        assert np.isnan(measure([]))


@pytest.mark.parametrize("measure", [*INTEGRATIONS, lambda e: recall_below(e, 0.1), lambda e: share_over(e, 0.1)])
def test_an_error_that_is_not_a_number_is_refused(measure: Callable[..., float]) -> None:
    with pytest.raises(ValueError, match="NaN"):
        measure([0.01, np.nan])


@pytest.mark.parametrize("auc", INTEGRATIONS)
@given(errors=errors_m, position=st.integers(0, 29), factor=st.floats(0, 1))
def test_a_smaller_error_never_lowers_it(
    auc: Callable[..., float], errors: list[float], position: int, factor: float
) -> None:
    better = list(errors)
    better[position % len(errors)] = min(0.3, better[position % len(errors)]) * factor
    assert auc(better) >= auc(errors) - 1e-9


@pytest.mark.parametrize("auc", INTEGRATIONS)
@given(errors=errors_m)
def test_it_is_a_percentage_whatever_the_order(auc: Callable[..., float], errors: list[float]) -> None:
    assert -1e-9 <= auc(errors) <= 100 + 1e-9
    assert auc(errors[::-1]) == pytest.approx(auc(errors))


@given(errors=errors_m)
def test_vocap_lies_over_the_exact_integral_by_at_most_one_instance(errors: list[float]) -> None:
    assert -1e-9 <= auc_vocap(errors) - auc_exact(errors) <= 100 / len(errors) + 1e-9


@given(errors=errors_m)
def test_fine_trapezoids_tend_to_the_exact_integral(errors: list[float]) -> None:
    assert auc_trapezoid(errors, steps=20_000) == pytest.approx(auc_exact(errors), abs=0.01)


def test_recall_and_share_are_strict_and_count_missing_poses() -> None:
    errors = [0.005, 0.01, 0.02, np.inf]
    assert recall_below(errors, 0.01) == 25
    assert share_over(errors, 0.01) == 50
    assert recall_below(errors, [0.006, 0.011, 0.01, 0.5]) == 50
