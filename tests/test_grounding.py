"""Where a concept is: of the model, of a tracked frame, in the vocabulary and outside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reference import onboard, read_reference_frames
from tracker.concept import ConceptModel
from tracker.errors import ConfigError, ModelError
from tracker.frame import Frame
from tracker.geometry import Floats, Pose
from tracker.pipeline import ObjectTracker
from tracker.saliency import Query, Saliency, SaliencyBackend
from tracker.saliency.attributes import TERMS, Attributes
from tracker.sources.synthetic import SyntheticScene, open_scene
from tracker.sources.synthetic.things import round_prints
from tracker.sources.synthetic.things.objects import tracked_object

WITHIN_M = 0.015
UNSEEN = (12, 25, 40, 55, 70)  # frames of the scene of which no model is made


class Planted:
    """A backend that also knows the handle: it is wherever a pixel is nearly of its colour, whatever the light."""

    name, weights, fingerprint = "planted", "none", "planted-1"

    def labels_for(self, wanted: Sequence[str] | None) -> tuple[str, ...]:
        if wanted is not None and set(wanted) - {"handle", *TERMS}:
            raise ConfigError(f"planted knows no {wanted}")
        return tuple(wanted or ("handle", *TERMS))

    def __call__(self, queries: Sequence[Query]) -> list[Saliency]:
        return [self._maps(query) for query in queries]

    def _maps(self, query: Query) -> Saliency:
        (measured,) = Attributes()([Query(query.view, TERMS)])
        rgb = query.view.rgb / np.maximum(query.view.rgb.sum(axis=2, keepdims=True), 1)
        paint = np.array(round_prints.VIOLET) / sum(round_prints.VIOLET)
        handle = (np.linalg.norm(rgb - paint, axis=2) < 0.1) & query.view.inside
        maps = {"handle": handle.astype(np.float32), **dict(zip(TERMS, measured.maps, strict=True))}
        return Saliency(query.labels, np.stack([maps[label] for label in query.labels]), query.view.box)


@pytest.fixture(scope="module")
def scene() -> SyntheticScene:
    return open_scene("tabletop?frames=90")


@pytest.fixture(scope="module")
def handle_centre_m() -> Floats:
    """(3,) centre of the box of the handle's part of the mesh: what stands out of the cup's wall."""
    vertices = tracked_object("mug").mesh.vertices_m
    middle = (vertices[:, 1].min() + vertices[:, 1].max()) / 2
    radius = (vertices[:, 1].max() - vertices[:, 1].min()) / 2
    axis_x = vertices[:, 0].min() + radius
    handle = vertices[np.hypot(vertices[:, 0] - axis_x, vertices[:, 1] - middle) > radius * 1.02]
    return (handle.min(axis=0) + handle.max(axis=0)) / 2


def made_by(backend: SaliencyBackend, scene: SyntheticScene) -> ConceptModel:
    return onboard(read_reference_frames(scene, "mug", 2), backend)


@pytest.fixture(scope="module")
def mug(scene: SyntheticScene, attributes: SaliencyBackend) -> ConceptModel:
    return made_by(attributes, scene)


@pytest.mark.parametrize(("kind", "label"), [("attributes", "purple handle"), ("planted", "handle")])
def test_the_handle_of_the_mug_is_found_in_views_unlike_the_references(
    kind: str, label: str, scene: SyntheticScene, attributes: SaliencyBackend, handle_centre_m: Floats
) -> None:
    backend = attributes if kind == "attributes" else Planted()
    model = made_by(backend, scene)
    for index in UNSEEN:
        (result,) = ObjectTracker(model, backend=backend).step(scene[index])
        seen = result.locate(model.locate(label, backend) or label)
        assert seen is not None
        truth = scene.sightings("mug")[index].T_cam_obj
        assert np.linalg.norm(seen.cam.centre_m - (truth @ handle_centre_m[None])[0]) < WITHIN_M, index
        assert np.linalg.norm(seen.obj.centre_m - handle_centre_m) < WITHIN_M


def test_a_term_of_the_vocabulary_needs_no_views_and_another_does(mug: ConceptModel) -> None:
    blind = replace(mug, references=())
    region = blind.locate("purple")
    assert region is not None
    assert region.centre_m[0] > 0.03
    with pytest.raises(ModelError, match=r"no reference views.*purple"):
        blind.locate("purple handle")


def test_what_was_not_asked_for_can_still_be_asked_after_the_model_was_saved(
    scene: SyntheticScene, attributes: SaliencyBackend, tmp_path: Path
) -> None:
    few = onboard(read_reference_frames(scene, "mug", 2), attributes, vocabulary=("white", "red"))
    few.save(tmp_path / "mug.concept")
    region = ConceptModel.load(tmp_path / "mug.concept").locate("purple handle")
    assert few.labels == ("white", "red")
    assert region is not None
    assert region.label == "purple handle"
    assert 0.03 < region.centre_m[0] < 0.06


def test_a_concept_that_the_object_has_not_is_nowhere_and_one_that_cannot_be_asked_is_an_error(
    mug: ConceptModel,
) -> None:
    assert mug.locate("green") is None
    with pytest.raises(ConfigError, match="cannot measure 'spout'"):
        mug.locate("spout")
    with pytest.raises(ModelError, match="planted-1"):
        mug.locate("handle", Planted())


def test_a_region_that_is_turned_away_is_not_in_view(
    mug: ConceptModel, scene: SyntheticScene, attributes: SaliencyBackend
) -> None:
    (result,) = ObjectTracker(mug, backend=attributes).step(scene[12])
    region, inside = mug.locate("purple"), mug.locate("red nearby")
    assert region is not None
    assert inside is not None
    there = result.locate(region)
    assert there is not None
    assert there.visible > 0.4
    half_a_turn = Pose(np.diag((-1.0, -1.0, 1.0)), np.zeros(3))
    away = result.locate(region.moved(half_a_turn))
    assert away is not None
    assert away.visible < 0.2


def test_without_a_pose_nothing_is_located(
    mug: ConceptModel, scene: SyntheticScene, attributes: SaliencyBackend
) -> None:
    frame: Frame = replace(scene[12], masks={})
    (result,) = ObjectTracker(mug, backend=attributes).step(frame)
    assert result.pose is None
    assert result.locate("purple") is None
