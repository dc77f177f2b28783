"""Pictures of the page: the overlay as it is drawn elsewhere, and maps whose colours are their values."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.test_overlay import SHAPES, T_CAM_OBJ, plain, result
from tracker.errors import OutputError
from tracker.overlay import draw_overlay
from tracker.saliency import Query, Saliency, SaliencyBackend
from tracker.view import ObjectView
from tracker.web.board import Shown
from tracker.web.pictures import concept_picture, overlay_picture, strongest


def decoded(jpeg: bytes) -> np.ndarray:
    """(H, W, 3) RGB."""
    bgr = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert bgr is not None
    return bgr[:, :, ::-1]


def constant(view: ObjectView, **values: float) -> Saliency:
    maps = np.array([np.full((9, 7), value) for value in values.values()], np.float32)
    return Saliency(tuple(values), maps, view.box)


def test_the_overlay_is_the_one_that_is_drawn_elsewhere() -> None:
    frame, results = plain(120), (result(T_CAM_OBJ),)
    frame.rgb[..., 0] = 200
    shown = decoded(overlay_picture(Shown(1, frame, results, {}), SHAPES))
    expected = draw_overlay(frame, results, SHAPES, {})
    assert shown.shape == expected.shape
    assert np.abs(shown.astype(int) - expected).mean() < 4


def test_the_strongest_concepts_of_the_object_come_first(can_view: ObjectView) -> None:
    told = strongest(can_view, constant(can_view, red=0.2, round=0.9, flat=0.5))
    assert [label for label, _ in told] == ["round", "flat", "red"]
    assert [mean for _, mean in told] == pytest.approx([0.9, 0.5, 0.2], abs=1e-3)


def test_what_a_backend_says_can_be_shown(can_view: ObjectView, attributes: SaliencyBackend) -> None:
    (saliency,) = attributes([Query(can_view, attributes.labels_for(None))])
    told = strongest(can_view, saliency)
    assert sorted(label for label, _ in told) == sorted(saliency.labels)
    picture = decoded(concept_picture(can_view, saliency, told[0][0]))
    assert min(picture.shape[:2]) >= 80


def test_a_map_has_a_colour_on_the_object_and_none_beside_it(can_view: ObjectView) -> None:
    saliency = constant(can_view, low=0.0, high=1.0)
    low, high = (decoded(concept_picture(can_view, saliency, label)).astype(int) for label in ("low", "high"))
    middle = tuple(side // 2 for side in low.shape[:2])
    assert (low[middle][2] > low[middle][1], high[middle][1] > 150, high[middle][2] < 120) == (True, True, True)
    corner = low[2, 2]
    assert np.ptp(corner) < 20
    assert np.abs(corner - high[2, 2]).max() < 20


def test_a_concept_that_was_not_asked_for_is_refused(can_view: ObjectView) -> None:
    with pytest.raises(OutputError, match="'blue' was not asked for; there are red"):
        concept_picture(can_view, constant(can_view, red=0.5), "blue")
