"""Whether what is seen goes on beyond a surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tracker.frame import Frame
from tracker.surroundings import goes_on
from tracker.view import ObjectView, ViewConfig, view_object

LAB = np.array((60.0, 10.0, 10.0), np.float32)
SAME, OTHER = np.array((8, 0, 0), np.float32), np.array((0, 20, 0), np.float32)


@pytest.fixture
def table_view(can_frames: list[Frame]) -> ObjectView:
    """All of it is at one depth."""
    frame = replace(can_frames[0], depth_m=np.full(can_frames[0].depth_m.shape, 0.7, np.float32))
    mask = np.zeros(frame.depth_m.shape, bool)
    mask[20:100, 40:120] = True
    view = view_object(frame, mask, 0.1, ViewConfig())
    assert view is not None
    return view


def patch(view: ObjectView, every: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of a square in the middle of the view."""
    height, width = view.inside.shape
    rows, columns = np.mgrid[height // 3 : 2 * height // 3 : every, width // 3 : 2 * width // 3 : every]
    return rows.ravel(), columns.ravel()


def lab_of(view: ObjectView, apart: np.ndarray) -> np.ndarray:
    """The patch in one colour, all around it in one that is so far apart."""
    lab = np.full((*view.inside.shape, 3), LAB + apart, np.float32)
    rows, columns = patch(view)
    lab[rows, columns] = LAB
    return lab


@pytest.mark.parametrize("every", [1, 3])  # the points of a model leave gaps
@pytest.mark.parametrize(("apart", "share"), [(SAME, 1.0), (OTHER, 0.0)])
def test_a_patch_of_a_table_goes_on_and_what_has_another_colour_does_not(
    every: int, apart: np.ndarray, share: float, table_view: ObjectView
) -> None:
    found = goes_on(*patch(table_view, every), lab_of(table_view, apart), table_view, 1.0)
    assert found == pytest.approx(share, abs=0.1)


def test_where_half_of_what_is_around_lies_elsewhere_half_goes_on(table_view: ObjectView) -> None:
    depth_m = table_view.depth_m.copy()
    depth_m[:, : depth_m.shape[1] // 2] = 0  # behind a mask's border, say
    view = replace(table_view, depth_m=depth_m)
    assert goes_on(*patch(view), lab_of(view, SAME), view, 1.0) == pytest.approx(0.5, abs=0.05)


def test_specks_say_nothing(table_view: ObjectView) -> None:
    row, column = (np.array(pixels[:1]) for pixels in patch(table_view))
    assert goes_on(row, column, lab_of(table_view, SAME), table_view, 1.0) == 0.0
    nothing = np.zeros(0, np.intp)
    assert goes_on(nothing, nothing, lab_of(table_view, SAME), table_view, 1.0) == 0.0
