"""Pixels belong to one object."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tracker.claims import claimed_by_others, in_one_place
from tracker.frame import Mask


def mask_of(bits: int) -> Mask:
    return np.array([bits >> k & 1 for k in range(12)], bool).reshape(3, 4)


masks = st.lists(st.one_of(st.none(), st.integers(0, 2**12 - 1).map(mask_of)), min_size=1, max_size=5)


@given(masks)
def test_what_others_claim_is_what_any_other_one_shows(shown: list[Mask | None]) -> None:
    for k, claimed in enumerate(claimed_by_others(shown)):
        others = [mask for j, mask in enumerate(shown) if j != k and mask is not None]
        assert (claimed is None) == (not others)
        if claimed is not None:
            for mask in others:
                assert claimed[mask].all()
            assert claimed.sum() <= sum(mask.sum() for mask in others)


def test_one_object_alone_has_nobody_beside_it() -> None:
    assert claimed_by_others([mask_of(7)]) == [None]
    assert list(in_one_place([mask_of(7)])) == []


def test_two_are_in_one_place_where_they_share_most_of_their_pixels() -> None:
    a, most, half, apart = (mask_of(bits) for bits in (0b1111, 0b0111, 0b0011, 0b11110000))
    assert list(in_one_place([a, apart, None, most])) == [(0, 3)]
    assert list(in_one_place([a, half])) == []
    assert list(in_one_place([a, a, a])) == [(0, 1), (0, 2), (1, 2)]


def test_what_shows_no_pixel_is_in_nobodys_place() -> None:
    assert list(in_one_place([mask_of(0), mask_of(0)])) == []
