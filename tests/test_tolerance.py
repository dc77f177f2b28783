"""Frames that cannot be right: left out and counted, until there is nothing else."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from tests.conftest import draw_globe
from tracker.errors import FrameError, SourceError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.sources.tolerance import Tolerance

FRAME = draw_globe(Pose(np.eye(3), np.array([0.0, 0.0, 0.5]))).frame


def damaged() -> Frame:
    raise FrameError("frame 7 of cam: half of it")


def test_a_damaged_frame_is_left_out_counted_and_told_once_in_a_row(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    tolerance = Tolerance("cam")
    makers = [lambda: FRAME, damaged, damaged, lambda: FRAME, damaged]
    assert [tolerance.made(make) for make in makers] == [FRAME, None, None, FRAME, None]
    assert tolerance.refused == 3
    assert [record.message for record in caplog.records] == ["left out: frame 7 of cam: half of it"] * 2


def test_a_camera_that_shows_nothing_else_ends() -> None:
    tolerance = Tolerance("cam", most_in_a_row=3)
    assert [tolerance.made(make) for make in (damaged, damaged, lambda: FRAME, damaged, damaged)][2] is FRAME
    with pytest.raises(SourceError, match="cam: 3 frames in a row cannot be right: frame 7 of cam: half of it"):
        tolerance.made(damaged)


def test_a_mistake_in_the_program_is_no_damage_of_a_frame() -> None:
    with pytest.raises(ZeroDivisionError):
        Tolerance("cam").made(lambda: 1 // 0)  # pyright: ignore[reportArgumentType]
