"""Which point is which: the least divergence, found in blocks, whatever the block's size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import log_softmax, rel_entr, softmax

from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.geometry import Pose
from tracker.matching import Correspondences, Matcher, MatchingConfig, binary_maps, concept_vectors

CPU = torch.device("cpu")
SEEDS = st.integers(0, 10_000)

Saliency = npt.NDArray[np.float32]


def maps(seed: int, points: int, concepts: int = 7) -> Saliency:
    return np.random.default_rng(seed).random((points, concepts), np.float32)


def model_with(saliency: Saliency) -> ConceptModel:
    points = np.random.default_rng(0).uniform(-0.05, 0.05, (len(saliency), 3))
    unit = points / np.linalg.norm(points, axis=1, keepdims=True)
    ones = np.ones(len(points), np.float32)
    labels = tuple(f"concept {k}" for k in range(saliency.shape[1]))
    colours = np.zeros((len(points), 3), np.float32)
    return ConceptModel(
        "thing",
        points,
        unit,
        colours,
        saliency,
        ones.astype(np.int32),
        ones,
        np.eye(3)[:1],
        0.1,
        labels,
        "none",
        "none",
    )


def cloud_with(saliency: Saliency) -> PointCloud:
    zeros = np.zeros((len(saliency), 3))
    return PointCloud(zeros, zeros, zeros.astype(np.float32), saliency)


def match(query: Saliency, of_model: Saliency, config: MatchingConfig | None = None) -> Correspondences:
    return Matcher(model_with(of_model), config or MatchingConfig(), CPU)(cloud_with(query))


def divergences(query: Saliency, of_model: Saliency, temperature: float) -> npt.NDArray[np.float64]:
    """(N, M) KL(query || model) in nats, as the definition has it."""
    q, m = (softmax(s.astype(np.float64) / temperature, axis=1) for s in (query, of_model))
    return rel_entr(q[:, None, :], m[None, :, :]).sum(axis=2)


@given(SEEDS, st.floats(0.02, 5))
def test_concept_vectors_are_log_probabilities(seed: int, temperature: float) -> None:
    saliency = maps(seed, 20)
    log_probability = concept_vectors(torch.from_numpy(saliency), temperature).numpy()
    assert np.allclose(np.exp(log_probability).sum(axis=1), 1, atol=1e-5)
    assert np.allclose(log_probability, log_softmax(saliency / temperature, axis=1), atol=1e-3)


@given(SEEDS, st.floats(0.05, 2), st.integers(1, 60), st.integers(1, 60))
def test_the_match_has_the_least_divergence_of_all_by_the_definition(
    seed: int, temperature: float, queries: int, points: int
) -> None:
    query, of_model = maps(seed, queries), maps(seed + 1, points)
    found = match(query, of_model, MatchingConfig(temperature=temperature))
    expected = divergences(query, of_model, temperature)
    assert np.array_equal(found.query_index, np.arange(queries))
    assert np.allclose(found.divergence, expected.min(axis=1), atol=2e-5)
    chosen = expected[found.query_index, found.model_index]
    assert np.allclose(chosen, expected.min(axis=1), atol=2e-5)


def test_the_divergence_is_forward_not_reverse() -> None:
    """KL(query || model) wants a model point that has everything that the query has; the reverse does not."""
    query = np.array([[1.0, 1.0, 0.0]], np.float32)
    broad, narrow = [0.9, 0.9, 0.9], [1.0, 0.0, 0.0]
    of_model = np.array([broad, narrow], np.float32)
    forward = divergences(query, of_model, 0.1)[0]
    reverse = divergences(of_model, query, 0.1)[:, 0]
    assert forward.argmin() == 0
    assert reverse.argmin() == 1
    assert match(query, of_model, MatchingConfig(temperature=0.1)).model_index.tolist() == [0]


@given(SEEDS)
def test_a_point_of_the_model_is_found_again_with_no_divergence(seed: int) -> None:
    of_model = maps(seed, 80)
    order = np.random.default_rng(seed).permutation(80)
    found = match(of_model[order], of_model)
    assert np.array_equal(found.model_index, order)
    assert found.divergence.max() < 1e-5
    assert found.divergence.min() >= 0


def test_what_is_added_to_all_concepts_of_a_point_changes_nothing() -> None:
    query, of_model = maps(1, 40), maps(2, 50)
    before, after = match(query, of_model), match(query + np.float32(0.7), of_model)
    assert np.array_equal(before.model_index, after.model_index)
    assert np.allclose(before.divergence, after.divergence, atol=1e-4)


@pytest.mark.parametrize("memory_mb", [1, 1.5, 3])
def test_blocks_give_what_one_block_gives(memory_mb: float) -> None:
    query, of_model = maps(3, 500), maps(4, 3000)
    whole = match(query, of_model, MatchingConfig(memory_mb=1000))
    blocks = match(query, of_model, MatchingConfig(memory_mb=memory_mb))
    assert np.array_equal(whole.model_index, blocks.model_index)
    assert np.allclose(whole.divergence, blocks.divergence, atol=1e-6)


@pytest.mark.parametrize("memory_mb", [1, 2, 8])
def test_no_block_of_the_similarity_matrix_is_over_the_bound(memory_mb: float, monkeypatch: pytest.MonkeyPatch) -> None:
    held_mb: list[float] = []
    multiply = torch.Tensor.__matmul__

    def weighed(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        product = multiply(a, b)
        held_mb.append(product.numel() * product.element_size() / 2**20)
        return product

    matcher = Matcher(model_with(maps(5, 4000)), MatchingConfig(memory_mb=memory_mb), CPU)
    monkeypatch.setattr(torch.Tensor, "__matmul__", weighed)
    matcher(cloud_with(maps(6, 1500)))
    assert max(held_mb) <= memory_mb
    assert len(held_mb) <= 1.1 * sum(held_mb) / memory_mb + 1  # and hardly more blocks than the bound asks for


def test_a_model_too_large_for_the_bound_is_matched_point_by_point() -> None:
    of_model = maps(7, 300_000, 3)
    found = match(of_model[[5, 299_999]], of_model, MatchingConfig(memory_mb=1))
    assert found.divergence.max() < 1e-5


@given(st.integers(50, 200), st.integers(1, 1000))
def test_at_most_so_many_points_are_matched_spread_evenly_over_the_cloud(most: int, points: int) -> None:
    found = match(maps(8, points), maps(9, 5), MatchingConfig(query_points=most))
    assert len(found) == len(found.model_index) == len(found.divergence) == min(most, points)
    steps = np.diff(found.query_index)
    assert (steps >= 1).all()
    assert len(steps) == 0 or np.ptp(steps) <= 1
    assert found.query_index[0] == 0
    assert found.query_index[-1] == points - 1


def test_a_lower_temperature_makes_the_same_difference_count_more() -> None:
    query, of_model = maps(10, 30), maps(11, 40)
    warm, cold = (match(query, of_model, MatchingConfig(temperature=t)).divergence for t in (1.0, 0.1))
    assert (cold > warm).all()


def test_of_a_rendered_view_many_matches_are_right_and_far_more_than_by_chance(
    can_model: ConceptModel, can_cloud: PointCloud, can_truth: Pose
) -> None:
    found = Matcher(can_model, MatchingConfig(), CPU)(can_cloud)
    points_obj = can_truth.inverse() @ can_cloud.points[found.query_index]
    errors_m = np.linalg.norm(points_obj - can_model.points[found.model_index], axis=1)
    chance = np.random.default_rng(0).permutation(found.model_index)
    by_chance_m = np.linalg.norm(points_obj - can_model.points[chance], axis=1)
    assert (errors_m < 0.01).mean() > 0.2
    assert (errors_m < 0.01).mean() > 5 * (by_chance_m < 0.01).mean()


def test_only_what_is_best_in_both_directions_is_mutual() -> None:
    query, of_model = maps(12, 300), maps(13, 200)
    for memory_mb in (1, 64):  # whatever the blocks
        found = match(query, of_model, MatchingConfig(mutual=True, memory_mb=memory_mb))
        expected = divergences(query, of_model, MatchingConfig().temperature)
        both = [q for q in range(300) if expected[:, expected[q].argmin()].argmin() == q]
        assert found.query_index.tolist() == both
        assert 0 < len(both) < 200


def test_a_point_may_have_several_matches_the_best_first() -> None:
    query, of_model = maps(14, 60), maps(15, 90)
    found = match(query, of_model, MatchingConfig(per_point=3))
    expected = divergences(query, of_model, MatchingConfig().temperature).argsort(axis=1)[:, :3]
    assert np.array_equal(found.model_index.reshape(60, 3), expected)
    assert np.array_equal(found.query_index, np.repeat(np.arange(60), 3))


def test_when_there_are_too_many_those_of_the_greatest_margin_are_kept() -> None:
    query, of_model = maps(16, 200), maps(17, 150)
    every = match(query, of_model)
    few = match(query, of_model, MatchingConfig(kept=40))
    assert len(few) == 40
    assert few.margin.min() >= np.sort(every.margin)[-40]
    assert (np.diff(few.query_index) > 0).all()


def test_the_margin_is_less_where_the_object_has_a_look_alike_elsewhere() -> None:
    """Ten points of the model have a twin on the other side, ten are like no other; twins nearby do not count."""
    base = 3 * np.eye(20, 21, dtype=np.float32)
    model = model_with(np.concatenate((base, base[:10], base)))
    place = np.random.default_rng(0).uniform(-0.05, 0.05, (20, 3))
    model = replace(model, points=np.concatenate((place, place[:10] + np.array((1, 0, 0)), place + 1e-3)))
    found = Matcher(model, MatchingConfig(), CPU)(cloud_with(base))
    assert found.margin[:10] == pytest.approx(0, abs=1e-4)
    assert found.margin[10:].min() > 1


def test_matching_ten_thousand_points_to_ten_thousand_holds_little_memory() -> None:
    """The whole similarity matrix would take 400 MB."""
    before = torch.from_numpy(maps(18, 10_000, 40))
    matcher = Matcher(model_with(before.numpy()), MatchingConfig(query_points=10_000), CPU)
    largest: list[int] = []
    multiply = torch.Tensor.__matmul__

    def weighed(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        product = multiply(a, b)
        largest.append(product.numel() * product.element_size())
        return product

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch.Tensor, "__matmul__", weighed)
        found = matcher(cloud_with(before.numpy()))
    assert max(largest) <= 64 * 2**20
    assert np.array_equal(found.model_index, np.arange(10_000))


def test_binary_maps_are_one_where_a_concept_is_stronger_than_on_average() -> None:
    saliency = torch.tensor([[0.9, 0.02, 0.5], [0.1, 0.01, 0.5], [0.3, 0.06, 0.5]])
    assert binary_maps(saliency).tolist() == [[1, 0, 0], [0, 0, 0], [0, 1, 0]]


def test_matching_by_binary_maps_forgets_how_strong_a_concept_is() -> None:
    strong, faint = np.eye(3, dtype=np.float32), 0.4 * np.eye(3, dtype=np.float32)
    soft, binary = MatchingConfig(), MatchingConfig(binary=True)
    found = {config.binary: Matcher(model_with(strong), config, CPU)(cloud_with(faint)) for config in (soft, binary)}
    assert found[True].model_index.tolist() == [0, 1, 2]
    assert found[True].divergence == pytest.approx(0, abs=1e-6)
    assert (found[False].divergence > 0.1).all()


@given(SEEDS, st.integers(3, 60))
def test_of_a_few_points_each_is_matched_as_it_is_among_all(seed: int, most: int) -> None:
    model, cloud = model_with(maps(seed, 40)), cloud_with(maps(seed + 1, 50))
    matcher = Matcher(model, MatchingConfig(), CPU)
    few, every = matcher(cloud, most), matcher(cloud)
    assert len(few) == min(most, 50)
    assert few.query_index[0] == 0
    assert few.query_index[-1] == 49
    assert few.model_index.tolist() == every.model_index[few.query_index].tolist()


def test_no_more_points_are_matched_than_the_configuration_allows() -> None:
    matcher, cloud = Matcher(model_with(maps(0, 40)), MatchingConfig(query_points=50), CPU), cloud_with(maps(1, 90))
    assert len(matcher(cloud, 80)) == len(matcher(cloud)) == 50
