"""BOP's average recalls, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from eval.average_recall import ar_mspd, ar_mssd, ar_vsd


def test_mssd_is_counted_in_diameters_of_each_object() -> None:
    # 0.12 of 0.1 m is under 0.15 and eight more thresholds up to 0.50, nothing of an infinite error
    assert ar_mssd([0.012], [0.1]) == pytest.approx(0.8)
    assert ar_mssd([0.012, 0.012, np.inf], [0.1, 0.2, 0.2]) == pytest.approx((0.8 + 0.9 + 0) / 3)


def test_mspd_is_counted_from_5_to_50_pixels() -> None:
    assert ar_mspd([12.0]) == pytest.approx(0.8)
    assert ar_mspd([4.9, 50.0]) == pytest.approx(0.5)


def test_vsd_is_counted_over_misalignments_and_thresholds() -> None:
    assert ar_vsd([[0.12] * 10]) == pytest.approx(0.8)
    assert ar_vsd([[1.0] * 5 + [0.0] * 5, [np.inf] * 10]) == pytest.approx(0.25)


def test_an_error_at_a_threshold_is_not_under_it() -> None:
    assert ar_mspd([5.0]) == pytest.approx(0.9)
    assert ar_mssd([0.25], [0.5]) == 0
    assert ar_vsd([[0.5] * 10]) == 0
    assert ar_vsd([[0.05] * 10]) == pytest.approx(0.9)


def test_nothing_is_not_a_number() -> None:
    assert np.isnan([ar_mssd([], []), ar_mspd([]), ar_vsd([])]).all()
