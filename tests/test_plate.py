"""The concept plate: a tile for every concept of every view, with what the maps say in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from reference.plate import GAP_PX, LABEL_PX, MOST_COLUMNS, SCALE_PX, TILE_PX, write_concept_plate
from tracker.concept import ConceptModel
from tracker.errors import OutputError
from tracker.saliency import SaliencyBackend


@pytest.fixture(scope="module")
def few(can_model: ConceptModel) -> ConceptModel:
    return replace(can_model, labels=("red", "green", "white nearby"), references=can_model.references[:2])


def test_a_plate_has_a_row_a_view_and_a_tile_a_concept(
    few: ConceptModel, attributes: SaliencyBackend, tmp_path: Path
) -> None:
    write_concept_plate(tmp_path / "plate.png", few, attributes)
    picture = cv2.imread(str(tmp_path / "plate.png"))
    height, width = TILE_PX + LABEL_PX + GAP_PX, TILE_PX + GAP_PX
    assert picture is not None
    assert picture.shape == (2 * height + SCALE_PX, 4 * width, 3)
    # the can's label is red and nothing on it is green: the brighter map is the red one
    red, green = (picture[30:120, k * width + 55 : k * width + 95].astype(float) for k in (1, 2))
    assert np.quantile(red[:, :, 1], 0.9) > np.quantile(green[:, :, 1], 0.9) + 20


def test_many_concepts_fill_several_rows(can_model: ConceptModel, attributes: SaliencyBackend, tmp_path: Path) -> None:
    one = replace(can_model, references=can_model.references[:1])
    write_concept_plate(tmp_path / "plate.png", one, attributes)
    picture = cv2.imread(str(tmp_path / "plate.png"))
    assert picture is not None
    assert picture.shape[0] == -(-(1 + len(one.labels)) // MOST_COLUMNS) * (TILE_PX + LABEL_PX + GAP_PX) + SCALE_PX
    assert np.all(picture[-1, -1] == 255)


def test_below_them_stands_which_colour_is_which_value(
    few: ConceptModel, attributes: SaliencyBackend, tmp_path: Path
) -> None:
    write_concept_plate(tmp_path / "plate.png", few, attributes)
    picture = cv2.imread(str(tmp_path / "plate.png"))
    assert picture is not None
    scale = cv2.cvtColor(picture[-SCALE_PX + GAP_PX + LABEL_PX // 2, :TILE_PX][None], cv2.COLOR_BGR2LAB)[0, :, 0]
    assert np.all(np.diff(scale.astype(int)) >= -1)  # lighter and lighter, but for rounding
    assert scale[-1] > scale[0] + 80


def test_a_plate_that_cannot_be_written_is_an_error_with_the_path(
    few: ConceptModel, attributes: SaliencyBackend, tmp_path: Path
) -> None:
    with pytest.raises(OutputError, match=r"absent.plate\.png"):
        write_concept_plate(tmp_path / "absent" / "plate.png", few, attributes)
