"""Many poses from correspondences: scored as defined, sampled among outliers, seeded where hardly anything is right."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracker.hypotheses import Pairs, fitted, sampled, seeded, squared_distances, support
from tracker.umeyama import Motions, umeyama

RADII_M = np.array([0.1, 0.06, 0.04])


def some_motions(seed: int, count: int) -> Motions:
    rng = np.random.default_rng([seed, 1])
    rotation = torch.from_numpy(Rotation.random(count, rng=rng).as_matrix()).float()
    translation = torch.from_numpy(rng.normal(size=(count, 3)) * 0.05).float()
    return Motions(rotation, translation, torch.ones(count), torch.ones(count) > 0)


def some_pairs(seed: int, count: int, right: float, normals: bool = True) -> tuple[Pairs, Motions]:
    """Points of an ellipsoid seen with a millimetre of noise, of which a share is paired rightly; and the motion."""
    rng = np.random.default_rng([seed, 2])
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points, up = directions * RADII_M, directions / RADII_M
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    truth = some_motions(seed, 1)
    R, t = truth.rotation[0].numpy(), truth.translation[0].numpy()
    seen, seen_up = points @ R.T + t + rng.normal(size=points.shape) * 0.001, up @ R.T
    index = np.where(rng.random(count) < right, np.arange(count), rng.integers(count, size=count))
    arrays = (seen, seen_up * normals, points[index], up[index] * normals)
    return Pairs(*(torch.from_numpy(a).float() for a in arrays)), truth


def angle_deg(found: Motions, truth: Motions) -> np.ndarray:
    trace = torch.einsum("bij,ij->b", found.rotation.double(), truth.rotation[0].double())
    return np.degrees(np.arccos(np.clip((trace.numpy() - 1) / 2, -1, 1)))


@given(st.integers(0, 10_000))
def test_distances_are_those_of_the_moved_points(seed: int) -> None:
    pairs, _ = some_pairs(seed, 40, 0.5)
    motions = some_motions(seed + 1, 7)
    moved = pairs.model_points @ motions.rotation.transpose(1, 2) + motions.translation[:, None]
    expected = ((moved - pairs.points) ** 2).sum(dim=2)
    assert torch.allclose(squared_distances(pairs, motions), expected, atol=1e-6)


@given(st.integers(0, 10_000))
def test_fits_of_the_same_pairs_are_those_of_each_problem_alone(seed: int) -> None:
    pairs, _ = some_pairs(seed, 25, 0.5)
    doubles = Pairs(*(part.double() for part in (pairs.points, pairs.normals, pairs.model_points, pairs.model_normals)))
    weights = torch.from_numpy(np.random.default_rng(seed).uniform(0, 1, (6, 25)))
    together = fitted(doubles, weights)
    stacked = [part.expand(6, -1, -1) for part in (doubles.model_points, doubles.points)]
    each = umeyama(stacked[0], stacked[1], weights)
    assert torch.allclose(together.rotation, each.rotation, atol=1e-6)
    assert torch.allclose(together.translation, each.translation, atol=1e-8)


def test_support_counts_near_pairs_whose_normals_agree() -> None:
    pairs, truth = some_pairs(0, 200, 1.0)
    full = float(support(pairs, truth, 0.01))
    assert 0.9 * 200 < full <= 200
    turned = Pairs(pairs.points, -pairs.normals, pairs.model_points, pairs.model_normals)
    assert float(support(turned, truth, 0.01)) == 0
    bare = Pairs(pairs.points, torch.zeros(200, 3), pairs.model_points, torch.zeros(200, 3))
    assert float(support(bare, truth, 0.01)) == pytest.approx(full)
    assert float(support(pairs, some_motions(5, 1), 0.01)) < 0.2 * full


@pytest.mark.parametrize("normals", [True, False])
def test_sampling_finds_the_motion_among_nine_outliers_of_ten(normals: bool) -> None:
    pairs, truth = some_pairs(1, 800, 0.1, normals)
    found = sampled(pairs, 60_000, 0.01, 0.03, 0.4, 4000, torch.Generator().manual_seed(0))
    best = support(pairs, found, 0.01).argmax()
    assert angle_deg(found[best.unsqueeze(0)], truth)[0] < 5
    assert len(found) < 4000


@pytest.mark.parametrize("seed", range(5))
def test_compatibility_finds_it_where_two_of_a_hundred_are_right(seed: int) -> None:
    pairs, truth = some_pairs(seed, 2000, 0.02, normals=False)
    found = seeded(pairs, 0.004, 0.02, 0.4, 2000, 200, 12, torch.Generator().manual_seed(0))
    best = support(pairs, found, 0.01).argmax()
    assert angle_deg(found[best.unsqueeze(0)], truth)[0] < 5


def test_where_nothing_keeps_its_distance_nothing_is_seeded() -> None:
    points = torch.rand(30, 3, generator=torch.Generator().manual_seed(0))
    pairs = Pairs(points, torch.zeros(30, 3), 100 * points.roll(1, 0), torch.zeros(30, 3))
    assert len(seeded(pairs, 1e-4, 0.0, 0.4, 30, 10, 5, torch.Generator().manual_seed(0))) == 0
