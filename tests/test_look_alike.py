"""A look-alike has the shape of the thing, and part of its colours."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.sources.synthetic.things.hand import hand
from tracker.sources.synthetic.things.look_alike import look_alike
from tracker.sources.synthetic.things.objects import OBJECTS, tracked_object


@pytest.mark.parametrize("object_id", OBJECTS)
def test_it_has_the_same_shape_and_part_of_the_print(object_id: str) -> None:
    thing = tracked_object(object_id)
    other = look_alike(thing, 150.0)
    assert other.mesh is thing.mesh
    assert other.symmetric == thing.symmetric
    assert other.name != thing.name
    changed = (other.texture[..., :3].astype(int) != thing.texture[..., :3]).any(axis=-1)
    printed = thing.texture[..., :3].any(axis=-1)
    assert 0.04 < changed[printed].mean() < 0.9
    assert np.array_equal(other.texture[..., 3], thing.texture[..., 3])


def test_brightness_and_saturation_stay() -> None:
    thing = tracked_object("soup_can")
    other = look_alike(thing, 120.0)
    value, other_value = (t.texture[..., :3].max(axis=-1).astype(int) for t in (thing, other))
    assert np.abs(value - other_value).max() <= 3
    assert np.array_equal(thing.texture, tracked_object("soup_can").texture)  # the original is left alone


def test_a_hand_is_as_large_as_a_hand_and_points_along_its_axis() -> None:
    mesh = hand(0).mesh
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    assert -0.005 < low[0] < 0.005
    assert 0.5 < high[0] < 0.6
    palm = mesh.vertices_m[(mesh.vertices_m[:, 0] > 0.1) & (mesh.vertices_m[:, 0] < 0.12)]
    assert 0.07 < np.ptp(palm[:, 2]) < 0.11
    assert not np.array_equal(hand(0).texture, hand(1).texture)
