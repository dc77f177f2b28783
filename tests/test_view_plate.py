"""The plate of the reference views: covered and uncovered sides of the sphere, and a mark where each view is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reference.sheet import Picture
from reference.view_plate import MARGIN_PX, MARK, UNSEEN, view_plate
from tracker.concept import ConceptModel


def marked(picture: Picture, colour: tuple[int, int, int]) -> np.ndarray:
    return (picture == colour).all(axis=2)


@pytest.mark.parametrize("width", [640, 1600])
def test_it_is_as_wide_as_asked_and_nothing_is_cut_off(width: int, can_model: ConceptModel) -> None:
    picture = view_plate(can_model, width)
    assert picture.shape[1] == width
    assert (picture[:, -2:] == 255).all()
    assert (picture[-2:] == 255).all()


@pytest.mark.parametrize(("side", "disc"), [(1, 0), (-1, 1)])
def test_a_view_from_above_or_below_covers_the_middle_of_its_own_disc(
    side: int, disc: int, can_model: ConceptModel
) -> None:
    model = replace(can_model, view_directions=np.array([(0.0, 0, side)]), references=can_model.references[:1])
    picture = view_plate(model, 1000)
    size = (1000 - 3 * MARGIN_PX) // 4 - MARGIN_PX
    halves = [marked(picture[:, left : left + size], UNSEEN) for left in (MARGIN_PX, 2 * MARGIN_PX + size)]
    disc_px = np.pi / 4 * size**2
    # within 60 degrees is half of a half sphere, as areas are true
    assert halves[disc].sum() / disc_px == pytest.approx(0.5, abs=0.02)
    assert halves[1 - disc].sum() / disc_px == pytest.approx(1, abs=0.02)
    _, columns = np.nonzero(marked(picture, MARK))
    assert columns.mean() == pytest.approx((MARGIN_PX, 2 * MARGIN_PX + size)[disc] + size / 2, abs=3)


def test_x_is_to_the_right_from_above_and_to_the_left_from_below(can_model: ConceptModel) -> None:
    size = (1000 - 3 * MARGIN_PX) // 4 - MARGIN_PX
    for side, left in ((1, MARGIN_PX), (-1, 2 * MARGIN_PX + size)):
        direction = np.array((0.6, 0.0, 0.8 * side))
        model = replace(can_model, view_directions=direction[None], references=())
        _, columns = np.nonzero(marked(view_plate(model, 1000), MARK))
        assert (columns.mean() - left - size / 2) * side > size / 10
