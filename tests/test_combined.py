"""Backends asked together: whose concept is whose, and how much each counts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.tiny_networks import save_siglip
from tracker.errors import ConfigError
from tracker.frame import PosedFrame
from tracker.geometry import Pose
from tracker.saliency import BackendOptions, Query, Saliency, SaliencyBackend, open_backend
from tracker.saliency.attributes import TERMS
from tracker.saliency.combined import Combined
from tracker.view import ObjectView, ViewConfig, view_object


class Halves:
    """Knows "left" and "right", of the box of the view."""

    name, weights, fingerprint = "halves", "none", "halves-1"

    def labels_for(self, wanted: Sequence[str] | None) -> tuple[str, ...]:
        return tuple(wanted or ("left", "right"))

    def __call__(self, queries: Sequence[Query]) -> list[Saliency]:
        half = {"left": [[1.0, 0.0]], "right": [[0.0, 1.0]]}
        return [
            Saliency(q.labels, np.array([half.get(label, [[0.0, 0.0]]) for label in q.labels], np.float32), q.view.box)
            for q in queries
        ]


@pytest.fixture(scope="module")
def ball(globe: Callable[..., PosedFrame]) -> ObjectView:
    posed = globe(Pose(np.eye(3), np.array([0.01, -0.005, 0.35])))
    view = view_object(posed.frame, posed.mask, 0.1, ViewConfig())
    assert view is not None
    return view


def test_concepts_stand_one_after_the_other_each_times_its_weight(
    ball: ObjectView, attributes: SaliencyBackend
) -> None:
    both = Combined([(Halves(), 1.0), (attributes, 0.5)])
    labels = both.labels_for(None)
    assert labels == ("left", "right", *TERMS)
    (saliency,) = both([Query(ball, labels)])
    (alone,) = attributes([Query(ball, TERMS)])
    assert saliency.labels == labels
    assert np.allclose(saliency.maps[2:], 0.5 * alone.maps, atol=1e-5)
    left, right = saliency.maps[:2]
    middle = ball.camera.width // 2
    assert left[:, : middle - 20].max() > 0.9 > 0.1 > right[:, : middle - 20].max()
    assert not saliency.maps[:, ~ball.inside].any()


def test_a_vocabulary_that_is_complete_stays_as_it_is(ball: ObjectView, attributes: SaliencyBackend) -> None:
    """A model of both parts asks for all its labels again."""
    both = Combined([(Halves(), 1.0), (attributes, 1.0)])
    labels = both.labels_for(["right"])
    assert labels == ("right", *TERMS)
    assert both.labels_for(labels) == labels
    assert both([Query(ball, labels)])[0].maps.shape[0] == 1 + len(TERMS)


def test_of_two_concepts_of_one_name_the_measured_one_is_kept(ball: ObjectView, attributes: SaliencyBackend) -> None:
    both = Combined([(Halves(), 1.0), (attributes, 1.0)])
    labels = both.labels_for(["left", "Red", "rim"])
    assert labels == ("left", *TERMS)
    (alone,) = attributes([Query(ball, ("red",))])
    (saliency,) = both([Query(ball, labels)])
    assert np.allclose(saliency.maps[labels.index("red")], alone.maps[0], atol=1e-5)


def test_a_part_of_which_nothing_is_wanted_is_not_asked(ball: ObjectView, attributes: SaliencyBackend) -> None:
    class Mute(Halves):
        def __call__(self, queries: Sequence[Query]) -> list[Saliency]:
            assert all(query.labels for query in queries)
            return super().__call__(queries)

    both = Combined([(Mute(), 1.0), (attributes, 1.0)])
    several = both([Query(ball, both.labels_for(["Red"])), Query(ball, both.labels_for(["left"]))])
    assert [one.maps.shape[0] for one in several] == [len(TERMS), 1 + len(TERMS)]
    assert several[0].labels == TERMS


def test_the_name_and_the_fingerprint_tell_weights_apart(attributes: SaliencyBackend) -> None:
    full, half = (Combined([(Halves(), 1.0), (attributes, w)]) for w in (1.0, 0.5))
    assert (full.name, half.name) == ("halves+attributes", "halves+attributes*0.5")
    assert full.fingerprint != half.fingerprint


def test_a_network_and_the_measured_terms_are_opened_together(
    ball: ObjectView, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    weights = str(save_siglip(tmp_path / "weights"))
    both = open_backend("siglip2+attributes*0.7", BackendOptions(weights, "cpu"))
    labels = both.labels_for(["handle", "lid"])
    (saliency,) = both([Query(ball, labels)])
    assert saliency.maps.shape == (2 + len(TERMS), *ball.inside.shape)
    assert saliency.maps[2:].max() <= 0.7


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("siglip2+tea", ("'tea'", "attributes", "dinotxt")),
        ("attributes+attributes", ("twice",)),
        ("attributes*2", ("weight", "'2'")),
        ("attributes*0+clip", ("weight",)),
        ("attributes*much+clip", ("weight", "'much'")),
        ("+attributes", ("''",)),
    ],
)
def test_parts_that_do_not_exist_and_weights_that_are_none_are_refused(name: str, words: tuple[str, ...]) -> None:
    with pytest.raises(ConfigError) as refusal:
        open_backend(name)
    assert all(word in str(refusal.value) for word in words)
