"""The measures: what one matrix product gives is what the definitions give."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist
from scipy.special import rel_entr

from tracker.measures import FORWARD_SHARE, MEASURES, encode_model, encode_query

Vectors = npt.NDArray[np.float64]


def vectors(seed: int, count: int) -> Vectors:
    """(count, 6) distributions."""
    return np.random.default_rng(seed).dirichlet(np.full(6, 0.8), count).clip(1e-6)


def product(q: Vectors, m: Vectors, measure: str) -> Vectors:
    log_q, log_m = (torch.from_numpy(np.log(v)) for v in (q, m))
    encoded = encode_query(log_q, measure)  # type: ignore[arg-type]
    return (encoded.own[:, None] - encoded.features @ encode_model(log_m, measure).T).numpy()  # type: ignore[arg-type]


def definition(q: Vectors, m: Vectors, measure: str) -> Vectors:
    forward = rel_entr(q[:, None], m[None]).sum(axis=2)
    reverse = rel_entr(m[None], q[:, None]).sum(axis=2)
    return {
        "forward": forward,
        "reverse": reverse,
        "bidirectional": (forward + reverse) / 2,
        "asymmetric": FORWARD_SHARE * forward + (1 - FORWARD_SHARE) * reverse,
        "cosine": cdist(q, m, "cosine"),
    }[measure]


@pytest.mark.parametrize("measure", MEASURES)
@given(seed=st.integers(0, 10_000))
def test_a_measure_is_what_it_is_defined_to_be(measure: str, seed: int) -> None:
    q, m = vectors(seed, 12), vectors(seed + 1, 15)
    sums = (q / q.sum(axis=1, keepdims=True), m / m.sum(axis=1, keepdims=True))
    assert np.allclose(product(*sums, measure), definition(*sums, measure), atol=1e-9)


@pytest.mark.parametrize("measure", MEASURES)
@given(seed=st.integers(0, 10_000))
def test_nothing_is_unlike_itself_and_what_differs_is(measure: str, seed: int) -> None:
    q = vectors(seed, 10)
    q /= q.sum(axis=1, keepdims=True)
    apart = product(q, q, measure)
    assert np.allclose(np.diag(apart), 0, atol=1e-9)
    assert apart[~np.eye(10, dtype=bool)].min() > 0


@given(seed=st.integers(0, 10_000))
def test_bidirectional_and_cosine_do_not_care_which_is_the_query(seed: int) -> None:
    q, m = vectors(seed, 8), vectors(seed + 1, 9)
    q, m = q / q.sum(axis=1, keepdims=True), m / m.sum(axis=1, keepdims=True)
    for measure in ("bidirectional", "cosine"):
        assert np.allclose(product(q, m, measure), product(m, q, measure).T, atol=1e-9)
    assert not np.allclose(product(q, m, "forward"), product(m, q, "forward").T, atol=1e-3)
