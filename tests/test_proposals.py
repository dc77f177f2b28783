"""Where in a whole picture an object might be: mostly where it is, and lawfully a ball around a place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from reference.onboard import onboard, read_reference_frames
from tracker.cloud import CloudConfig
from tracker.concept import ConceptModel
from tracker.frame import Frame, Mask
from tracker.matching import MatchingConfig
from tracker.proposals import ProposalConfig, Proposals
from tracker.saliency import Query, SaliencyBackend
from tracker.sources.synthetic import SyntheticScene

CONFIG = ProposalConfig()
RADII = 2 * 1.01 * CONFIG.radius


def searcher(model: ConceptModel, config: ProposalConfig = CONFIG) -> Proposals:
    return Proposals(model, config, MatchingConfig(), torch.device("cpu"))


def proposed(
    model: ConceptModel, frame: Frame, attributes: SaliencyBackend, config: ProposalConfig = CONFIG
) -> list[Mask]:
    proposals = searcher(model, config)
    picture = proposals.picture(frame, frame.depth_m > 0)
    assert picture is not None
    return proposals.masks(picture, attributes([Query(picture, model.labels)])[0], CloudConfig())


def covered(mask: Mask, visible: Mask) -> float:
    """The share of what is visible that the mask has."""
    return np.count_nonzero(mask & visible) / np.count_nonzero(visible)


def points_of(mask: Mask, frame: Frame) -> np.ndarray:
    rows, columns = np.nonzero(mask)
    return frame.intrinsics.unproject(columns, rows, frame.depth_m[rows, columns].astype(np.float64))


def test_most_objects_on_the_table_are_at_one_of_the_places(
    table_scene: SyntheticScene, attributes: SaliencyBackend
) -> None:
    """By chance it is one in twelve."""
    found = []
    for name in ("cereal_box", "tea_box", "mug"):
        model = onboard(read_reference_frames(table_scene, name, 3), attributes)
        for index in (3, 60):
            frame = table_scene[index]
            masks = proposed(model, frame, attributes)
            found.append(max(covered(mask, frame.masks[name]) for mask in masks) > 0.7)
    assert sum(found) >= 5


def test_a_can_before_a_plain_background_is_at_the_first_place(
    can_frames: list[Frame], can_model: ConceptModel, attributes: SaliencyBackend
) -> None:
    for frame in can_frames[::5]:
        assert covered(proposed(can_model, frame, attributes)[0], frame.masks["soup_can"]) > 0.7


@pytest.mark.parametrize("places", [1, 2, 5])
def test_there_are_as_many_as_asked_for_the_likeliest_first(
    places: int, table_scene: SyntheticScene, table_models: dict[str, ConceptModel], attributes: SaliencyBackend
) -> None:
    few = proposed(table_models["mug"], table_scene[3], attributes, ProposalConfig(places=places))
    more = proposed(table_models["mug"], table_scene[3], attributes, ProposalConfig(places=places + 1))
    assert len(few) == places
    assert all(np.array_equal(one, other) for one, other in zip(few, more, strict=False))


def test_a_place_is_what_was_measured_within_a_ball(
    table_scene: SyntheticScene, table_models: dict[str, ConceptModel], attributes: SaliencyBackend
) -> None:
    frame, model = table_scene[3], table_models["mug"]
    masks = proposed(model, frame, attributes)
    for mask in masks:
        assert mask.shape == frame.depth_m.shape
        assert mask.dtype == np.bool_
        assert mask.any()
        assert (frame.depth_m[mask] > 0).all()
        points = points_of(mask, frame)
        spread_m = np.linalg.norm(points - points[0], axis=1).max()
        assert spread_m < RADII * model.diameter_m
    assert not any(np.array_equal(a, b) for k, a in enumerate(masks) for b in masks[:k])


def test_a_larger_radius_takes_in_more(
    table_scene: SyntheticScene, table_models: dict[str, ConceptModel], attributes: SaliencyBackend
) -> None:
    small, large = (
        proposed(table_models["mug"], table_scene[3], attributes, ProposalConfig(radius=radius))
        for radius in (0.4, 0.8)
    )
    for inner, outer in zip(small, large, strict=True):
        assert outer[inner].all()
        assert np.count_nonzero(outer) > np.count_nonzero(inner)


def test_the_picture_is_as_coarse_as_suits_the_object(
    table_scene: SyntheticScene, table_models: dict[str, ConceptModel]
) -> None:
    """At the median depth of the picture the object would be `pixels_across` of its pixels wide, up to rounding."""
    for across in (12, 24):
        picture = searcher(table_models["tea_box"], ProposalConfig(pixels_across=across)).picture(
            table_scene[3], table_scene[3].depth_m > 0
        )
        assert picture is not None
        assert picture.pixels_across == pytest.approx(across, rel=0.3)


def test_without_depth_there_is_no_picture(table_scene: SyntheticScene, table_models: dict[str, ConceptModel]) -> None:
    nothing = replace(table_scene[3], depth_m=np.zeros_like(table_scene[3].depth_m))
    assert searcher(table_models["mug"]).picture(nothing, nothing.depth_m > 0) is None


def test_with_hardly_any_depth_there_are_no_places(
    table_scene: SyntheticScene, table_models: dict[str, ConceptModel], attributes: SaliencyBackend
) -> None:
    frame = table_scene[3]
    depth_m = np.zeros_like(frame.depth_m)
    depth_m[100:106, 100:106] = 0.6
    assert proposed(table_models["mug"], replace(frame, depth_m=depth_m), attributes) == []


def test_the_same_picture_has_the_same_places(
    table_scene: SyntheticScene, table_models: dict[str, ConceptModel], attributes: SaliencyBackend
) -> None:
    one, two = (proposed(table_models["mug"], table_scene[3], attributes) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))
