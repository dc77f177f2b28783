"""Closed-form motions: the laws that the least-squares motion obeys, and three ways to it that agree."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracker.geometry import Floats, Pose
from tracker.umeyama import Motions, no_motions, triangles, umeyama

SEEDS = st.integers(0, 10_000)


@st.composite
def poses(draw: st.DrawFn) -> Pose:
    """Anywhere and any way up, within two metres."""
    numbers = np.random.default_rng(draw(SEEDS)).normal(size=7)
    return Pose.from_quaternion(numbers[:4], 0.7 * np.clip(numbers[4:], -2, 2))


def point_set(seed: int, count: int) -> Floats:
    return np.random.default_rng([seed, 1]).normal(size=(count, 3))


def fitted(source: Floats, target: Floats, weights: Floats | None = None) -> Pose:
    """One problem, solved as a batch of one."""
    ones = np.ones(len(source)) if weights is None else weights
    found = umeyama(*[torch.from_numpy(a)[None] for a in (source, target, ones)], with_scale=False)
    return Pose(found.rotation[0].numpy(), found.translation[0].numpy())


def apart(a: Pose, b: Pose) -> float:
    return a.angle_to_rad(b) + a.distance_to_m(b)


@given(SEEDS, poses(), st.integers(3, 40))
def test_umeyama_recovers_a_known_motion_exactly(seed: int, motion: Pose, count: int) -> None:
    source = point_set(seed, count)
    assert apart(fitted(source, motion @ source), motion) < 1e-6


@given(SEEDS, poses(), poses())
def test_umeyama_is_equivariant_under_rigid_motions_of_either_side(seed: int, a: Pose, b: Pose) -> None:
    source, target = point_set(seed, 10), point_set(seed + 1, 10)
    weights = np.random.default_rng(seed).uniform(0.1, 1, 10)
    moved = fitted(a @ source, b @ target, weights)
    assert apart(moved, b @ fitted(source, target, weights) @ a.inverse()) < 1e-6


@given(SEEDS, st.integers(3, 20))
def test_umeyama_agrees_with_scipy(seed: int, count: int) -> None:
    source, target = point_set(seed, count), point_set(seed + 1, count)
    weights = np.random.default_rng(seed).uniform(0.1, 3, count)
    found = fitted(source, target, weights)
    centre_s, centre_t = (np.average(p, axis=0, weights=weights) for p in (source, target))
    expected = Rotation.align_vectors(target - centre_t, source - centre_s, weights=weights)[0]
    assert np.allclose(found.rotation, expected.as_matrix(), atol=1e-6)
    assert np.allclose(found.translation_m, centre_t - expected.apply(centre_s), atol=1e-6)


@given(SEEDS)
def test_umeyama_answers_a_rotation_even_where_a_mirror_image_fits_better(seed: int) -> None:
    source = point_set(seed, 8)
    found = fitted(source, source * (1, 1, -1))
    assert np.allclose(found.rotation @ found.rotation.T, np.eye(3))
    assert np.linalg.det(found.rotation) == pytest.approx(1)


@given(SEEDS)
def test_umeyama_ignores_points_of_no_weight_and_the_scale_of_weights(seed: int) -> None:
    source, target = point_set(seed, 9), point_set(seed + 1, 9)
    weights = np.r_[np.random.default_rng(seed).uniform(0.1, 1, 6), np.zeros(3)]
    found = fitted(source, target, weights)
    assert apart(found, fitted(source[:6], target[:6], 17 * weights[:6])) < 1e-6


def test_umeyama_solves_every_problem_of_a_batch_on_its_own() -> None:
    source, target = (torch.from_numpy(point_set(s, 60).reshape(5, 12, 3)) for s in (0, 1))
    found = umeyama(source, target, torch.ones(5, 12))
    for k in range(5):
        alone = fitted(source[k].numpy(), target[k].numpy())
        assert np.allclose(found.rotation[k], alone.rotation)
        assert np.allclose(found.translation[k], alone.translation_m)


@given(SEEDS, poses(), st.floats(0.1, 10))
def test_scale_is_found_when_it_is_asked_for(seed: int, motion: Pose, scale: float) -> None:
    source = point_set(seed, 12)
    target = scale * source @ motion.rotation.T + motion.translation_m
    arrays = [torch.from_numpy(a)[None] for a in (source, target, np.ones(12))]
    found = umeyama(*arrays, with_scale=True)
    assert float(found.scale) == pytest.approx(scale, rel=1e-6)
    assert np.allclose(found.rotation[0], motion.rotation, atol=1e-6)
    assert np.allclose(found.translation[0], motion.translation_m, atol=1e-6)
    assert float(umeyama(*arrays, with_scale=False).scale) == 1


@given(SEEDS)
def test_three_points_need_no_singular_value_decomposition(seed: int) -> None:
    """Triangles that differ by noise: their best motion is the one that Umeyama's formula finds."""
    rng = np.random.default_rng(seed)
    source = torch.from_numpy(rng.normal(size=(30, 3, 3)))
    turns = torch.from_numpy(Rotation.random(30, rng=rng).as_matrix())
    target = source @ turns.transpose(1, 2) + torch.from_numpy(
        rng.normal(size=(30, 1, 3)) + rng.normal(size=(30, 3, 3)) / 50
    )
    quick, exact = triangles(source, target), umeyama(source, target, torch.ones(30, 3))
    edges = source[:, 1:] - source[:, :1]
    fat = torch.linalg.cross(edges[:, 0], edges[:, 1]).norm(dim=1) > 0.5
    assert torch.allclose(quick.rotation[fat], exact.rotation[fat], atol=1e-9)
    assert torch.allclose(quick.translation[fat], exact.translation[fat], atol=1e-9)
    assert torch.allclose(torch.det(quick.rotation[fat]), torch.ones(1, dtype=torch.float64))


def determined(points: Floats) -> bool:
    arrays = [torch.from_numpy(a)[None] for a in (points, points, np.ones(len(points)))]
    return bool(umeyama(*arrays, with_scale=False).determined)


def test_points_on_a_line_or_in_one_place_do_not_determine_a_motion() -> None:
    line = np.outer(np.linspace(-1, 1, 9), (0.6, 0, 0.8))
    assert not determined(line)
    assert not determined(np.zeros((9, 3)))
    assert determined(line + np.eye(9, 3) / 20)
    assert determined(point_set(0, 3))


def test_motions_are_chosen_and_joined() -> None:
    ones = torch.ones(4, 5)
    source, target = [torch.from_numpy(point_set(s, 20).reshape(4, 5, 3)) for s in (0, 1)]
    found = umeyama(source, target, ones)
    both = no_motions(found.translation).joined(found).joined(found[torch.tensor([2])])
    assert isinstance(both, Motions)
    assert len(both) == 5
    assert torch.equal(both.rotation[4], found.rotation[2])
