"""Faults of frames: what changes, by how much, and that nothing else does."""

from __future__ import annotations

import numpy as np
import pytest

from tests.conftest import draw_globe
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.sources.synthetic.faults import relit, without_depth


@pytest.fixture(scope="module")
def taken() -> Frame:
    return draw_globe(Pose(np.eye(3), np.array([0.0, 0.0, 0.5]))).frame


def test_without_depth_there_is_none_and_the_rest_is_as_it_was(taken: Frame) -> None:
    blind = without_depth(taken)
    assert not blind.depth_m.any()
    assert taken.depth_m.all()
    assert blind.rgb is taken.rgb
    assert (blind.stamp_ns, blind.masks) == (taken.stamp_ns, taken.masks)


def test_light_multiplies_and_one_changes_nothing(taken: Frame) -> None:
    assert np.array_equal(relit(taken, np.ones(3)).rgb, taken.rgb)
    darker = relit(taken, np.array([0.5, 0.5, 0.5]))
    assert darker.depth_m is taken.depth_m
    linear = [(frame.rgb.astype(float) / 255) ** 2.2 for frame in (taken, darker)]
    assert np.abs(linear[1] - 0.5 * linear[0]).max() < 0.006  # half a step of eight bits
    twice = relit(darker, np.array([2.0, 2.0, 2.0]))
    assert np.abs(twice.rgb.astype(int) - taken.rgb).max() <= 2


def test_each_colour_has_its_own_gain_and_what_is_too_bright_is_white(taken: Frame) -> None:
    warmer = relit(taken, np.array([1.5, 1.0, 0.7])).rgb.astype(int)
    change = warmer - taken.rgb
    assert (change[..., 0] >= 0).all()
    assert (change[..., 1] == 0).all()
    assert (change[..., 2] <= 0).all()
    assert (relit(taken, np.full(3, 1e4)).rgb[taken.rgb > 60] == 255).all()
