"""Confidence against what it was worth, on cases that can be counted by hand."""

from __future__ import annotations

import numpy as np
import pytest

from eval.instances import InstanceError
from eval.reliability import is_right, reliability


def instance(image_id: int, off_m: float = 0.001, symmetric_deg: float = 1.0, turned_deg: float = 1.0) -> InstanceError:
    missing = not np.isfinite(off_m)
    errors = (0.12, off_m, off_m, turned_deg, off_m, missing, symmetric_deg, off_m, 5.0, 0.5, None, None)
    return InstanceError(1, image_id, "mug", *errors)


def test_bins_counts_shares_and_calibration_error_are_those_counted_by_hand() -> None:
    rows = [instance(0), instance(1), instance(2, off_m=0.05), instance(3), instance(4, symmetric_deg=40), instance(5)]
    stated = dict(enumerate((0.92, 0.98, 0.95, 1.0, 0.3, 0.34)))
    found = reliability(rows, {(1, "mug", image_id): c for image_id, c in stated.items()})
    assert found is not None
    assert [b.count for b in found.bins] == [0, 0, 0, 2, 0, 0, 0, 0, 0, 4]
    assert [(b.low, b.high) for b in found.bins][3] == pytest.approx((0.3, 0.4))
    low, high = found.bins[3], found.bins[9]
    assert (low.confidence, low.right) == pytest.approx((0.32, 0.5))
    assert (high.confidence, high.right) == pytest.approx((0.9625, 0.75))
    assert found.calibration_error == pytest.approx((2 * 0.18 + 4 * 0.2125) / 6)
    assert found.count == 6
    assert np.isnan(found.bins[0].right)


def test_missing_poses_and_poses_without_a_confidence_are_not_in_it() -> None:
    rows = [instance(0), instance(1, off_m=np.inf), instance(2)]
    found = reliability(rows, {(1, "mug", 0): 0.8, (1, "mug", 1): 0.0})
    assert found is not None
    assert found.count == 1
    assert reliability(rows, {}) is None
    assert reliability([], {(1, "mug", 0): 0.8}) is None


def test_a_pose_is_right_within_both_limits_up_to_a_symmetry() -> None:
    assert is_right(instance(0, off_m=0.0199, symmetric_deg=9.9, turned_deg=180))
    assert not is_right(instance(0, off_m=0.02))
    assert not is_right(instance(0, symmetric_deg=10.0))


@pytest.mark.parametrize("tenths", range(11))
def test_a_confidence_on_an_edge_belongs_to_the_bin_above_it_and_one_to_the_last(tenths: int) -> None:
    found = reliability([instance(0)], {(1, "mug", 0): tenths / 10})
    assert found is not None
    assert [b.count for b in found.bins].index(1) == min(tenths, 9)
