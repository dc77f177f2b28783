"""Confidence as a detector of bad poses, on cases that can be counted by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eval.scenarios.confidence import auroc, confidence_quality
from eval.scenarios.frame_log import FrameLog

GOOD = FrameLog(0, 1.0, True, False, "tracking", 0.9, "", error_m=0.001, error_deg=1.0)
BAD = replace(GOOD, error_m=0.05, confidence=0.2)
LOST = FrameLog(0, 1.0, True, False, "lost", 0.0, "")


def test_pairs_in_the_right_order_are_counted_and_ties_are_halves() -> None:
    assert auroc([0.9, 0.8, 0.2], [True, True, False]) == 1.0
    assert auroc([0.1, 0.2], [True, False]) == 0.0
    assert auroc([0.5, 0.5], [True, False]) == 0.5
    assert auroc([0.9, 0.4, 0.6, 0.4], [True, True, False, False]) == pytest.approx((2 + 0.5) / 4)


def test_it_is_that_of_all_pairs() -> None:
    rng = np.random.default_rng(3)
    right = rng.random(60) < 0.6
    scores = np.round(rng.random(60) + 0.3 * right, 1)  # with ties
    pairs = [(g > b) + 0.5 * (g == b) for g in scores[right] for b in scores[~right]]
    assert auroc(scores.tolist(), right.tolist()) == pytest.approx(np.mean(pairs))


def test_with_one_kind_only_there_is_nothing_to_detect() -> None:
    assert auroc([0.5, 0.6], [True, True]) is None
    assert auroc([0.5, 0.6], [False, False]) is None
    assert auroc([], []) is None


def test_poses_are_pooled_and_frames_without_one_are_left_out() -> None:
    hidden = replace(GOOD, visible=0.0, confidence=0.8)  # as good as can be, of what nobody sees
    found = confidence_quality([GOOD, GOOD, BAD, hidden, LOST])
    assert (found.poses, found.bad, found.auroc) == (4, 2, 1.0)
    assert found.reliability is not None
    assert found.reliability.count == 4
    assert [b.count for b in found.reliability.bins] == [0, 0, 1, 0, 0, 0, 0, 0, 1, 2]
    assert found.reliability.calibration_error == pytest.approx((0.2 + 0.8 + 2 * 0.1) / 4)
    nothing = confidence_quality([LOST])
    assert (nothing.poses, nothing.bad, nothing.auroc, nothing.reliability) == (0, 0, None, None)
