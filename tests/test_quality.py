"""The verdict on a model: how much of the object is known, and what is missing, in sentences."""

from __future__ import annotations

import numpy as np
import pytest

from reference.quality import LEAST_POINTS, judge
from tracker.concept import ConceptModel
from tracker.geometry import Floats


def model(view_directions: Floats, points: int = 1000, shared: float = 0.5, agreement: float = 0.95) -> ConceptModel:
    """Of this many points, this share of which several views saw, agreeing so well."""
    twice = np.arange(points) < round(shared * points)
    return ConceptModel(
        object_id="mug",
        points=np.zeros((points, 3)),
        normals=np.zeros((points, 3)),
        colours=np.zeros((points, 3), np.float32),
        saliency=np.zeros((points, 1), np.float32),
        view_count=np.where(twice, 2, 1).astype(np.int32),
        agreement=np.where(twice, agreement, 1).astype(np.float32),
        view_directions=view_directions,
        diameter_m=0.1,
        labels=("red",),
        backend="attributes",
        fingerprint="attributes-0",
    )


def fan(*angles_deg: float) -> Floats:
    """Directions in a plane."""
    angles = np.radians(angles_deg)
    return np.stack((np.cos(angles), np.sin(angles), np.zeros(len(angles))), axis=1)


def test_a_good_model_has_nothing_missing() -> None:
    quality = judge(model(fan(0, 80)))
    assert quality.problems == ()
    assert quality.usable
    assert (quality.points, quality.shared, quality.agreement) == (1000, 0.5, pytest.approx(0.95))


def test_coverage_is_the_share_of_the_sphere_within_sixty_degrees_of_a_view() -> None:
    cap = (1 - np.cos(np.radians(60))) / 2
    assert judge(model(fan(0))).coverage == pytest.approx(cap, abs=0.02)
    assert judge(model(fan(0, 180))).coverage == pytest.approx(2 * cap, abs=0.03)
    assert judge(model(fan(0, 0.001))).coverage == pytest.approx(cap, abs=0.02)
    axes = np.concatenate((np.eye(3), -np.eye(3)))
    assert judge(model(axes)).coverage == 1


def test_more_views_never_cover_less() -> None:
    directions = np.random.default_rng(0).normal(size=(8, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    coverages = [judge(model(directions[:k])).coverage for k in range(1, 9)]
    assert coverages == sorted(coverages)


@pytest.mark.parametrize(("points", "usable"), [(0, False), (LEAST_POINTS - 1, False), (LEAST_POINTS, True)])
def test_a_model_of_too_few_points_is_not_usable_and_says_how_many_it_has(points: int, usable: bool) -> None:
    quality = judge(model(fan(0, 80), points))
    assert quality.usable == usable
    assert any(f"only {points} surface points, {LEAST_POINTS} are needed" in p for p in quality.problems) != usable
    assert np.isfinite((quality.coverage, quality.shared, quality.agreement)).all()


@pytest.mark.parametrize(
    ("angles_deg", "problem"),
    [
        ((0,), "one reference view"),
        ((0, 10), "the reference views differ by 10 degrees at most"),
        ((0, 5, 12), "the reference views differ by 12 degrees at most"),
    ],
)
def test_views_of_one_side_only_are_a_problem_and_no_hindrance(angles_deg: tuple[float, ...], problem: str) -> None:
    quality = judge(model(fan(*angles_deg)))
    assert len(quality.problems) == 1
    assert quality.problems[0].startswith(problem)
    assert quality.usable


def test_views_that_disagree_are_a_problem() -> None:
    (problem,) = judge(model(fan(0, 40), agreement=0.6)).problems
    assert problem.startswith("the views agree on their shared points to 0.60 only")
    assert judge(model(fan(0, 40), agreement=0.75)).problems == ()


def test_near_views_that_share_next_to_nothing_contradict_each_other() -> None:
    (problem,) = judge(model(fan(0, 120, 150), shared=0.01)).problems
    assert problem.startswith("only 1% of the points are seen twice, though two reference views differ by 30 degrees")
    assert judge(model(fan(0, 120, 150), shared=0.2)).problems == ()


def test_views_from_opposite_sides_need_not_share_anything() -> None:
    quality = judge(model(fan(0, 180), shared=0))
    assert quality.problems == ()
    assert (quality.shared, quality.agreement) == (0, 1)
