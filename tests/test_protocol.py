"""What an evaluation may choose, and what does not go together."""

from __future__ import annotations

from dataclasses import replace

import pytest

from eval.protocol import Protocol
from tracker.config import TrackerConfig
from tracker.errors import ConfigError
from tracker.saliency import SaliencyBackend


@pytest.fixture(scope="module")
def protocol(attributes: SaliencyBackend) -> Protocol:
    return Protocol(attributes, TrackerConfig(), views=1)


def test_a_method_that_goes_on_from_a_pose_is_refused_without_one(protocol: Protocol) -> None:
    for method in ("icp", "colored-icp"):
        with pytest.raises(ConfigError, match=f"method {method} .* needs --init gt"):
            replace(protocol, method=method)
    with pytest.raises(ConfigError, match="--init gt needs --prior on"):
        replace(protocol, config=TrackerConfig(prior=False), initialisation="gt")
    with pytest.raises(ConfigError, match="no method 'best'"):
        replace(protocol, method="best")


def test_what_does_not_go_together_is_refused(protocol: Protocol) -> None:
    carried = TrackerConfig(masks="carried")
    for changes, message in (
        ({"views": 0}, "--views: at least one reference frame is needed, got 0"),
        ({"concepts": 0}, "--concepts: at least one concept is needed, got 0"),
        ({"config": carried, "method": "sift"}, "--masks carried is of no use"),
        ({"complete": True, "method": "sift"}, "--complete is of no use"),
        ({"smooth": "offline", "poses": "raw"}, "--smooth offline smooths this tracker's filtered poses"),
    ):
        with pytest.raises(ConfigError, match=message):
            replace(protocol, **changes)


def test_the_first_concepts_are_the_backend_s_own_where_no_vocabulary_is_given(protocol: Protocol) -> None:
    assert protocol.labels_of("mug") is None
    assert replace(protocol, concepts=3).labels_of("mug") == protocol.backend.labels_for(None)[:3]
