"""Views of one object become one model: where nothing contradicts, each place once, weighted by how well it is seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import KDTree

from reference.fusion import FusedPoints, diameter_of, fuse
from tracker.cloud import CloudConfig, PointCloud, lift
from tracker.errors import OnboardingError
from tracker.frame import Frame, PosedFrame
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.saliency import Query, SaliencyBackend
from tracker.view import ViewConfig, view_object

AHEAD = Pose(np.eye(3), np.array([0.0123, -0.0071, 0.3952]))  # nothing falls on the border of a voxel
TURNS = [Pose.exp([0, angle_rad, 0, 0, 0, 0]) for angle_rad in (0.0, 0.8, -0.7)]
CAMERA = Intrinsics(100.0, 100.0, 15.5, 11.5, 32, 24)


@pytest.fixture(scope="module")
def balls(globe: Callable[..., PosedFrame]) -> list[PosedFrame]:
    return [globe(AHEAD @ turn, index=k) for k, turn in enumerate(TURNS)]


@pytest.fixture(scope="module")
def clouds(balls: list[PosedFrame], attributes: SaliencyBackend) -> list[PointCloud]:
    views = [view_object(ball.frame, ball.mask, 0.1, ViewConfig()) for ball in balls]
    seen = [view for view in views if view is not None]
    saliency = attributes([Query(view, attributes.labels_for(None)) for view in seen])
    return [lift(view, maps, CloudConfig()) for view, maps in zip(seen, saliency, strict=True)]


def blind(T_cam_obj: Pose) -> PosedFrame:
    """A frame without depth, which says nothing about the points of others."""
    frame = Frame(np.zeros((24, 32, 3), np.uint8), np.zeros((24, 32), np.float32), CAMERA, 0)
    return PosedFrame(frame, "thing", T_cam_obj, np.ones((24, 32), bool))


def cloud_of(points: Sequence[Sequence[float]], normals: Sequence[Sequence[float]], value: float) -> PointCloud:
    """Points in camera coordinates, their colour the gray of 100 x value, their two concepts value and 1 - value."""
    count = len(points)
    concepts = np.tile(np.array([value, 1 - value], np.float32), (count, 1))
    return PointCloud(np.array(points), np.array(normals), np.full((count, 3), np.float32(100 * value)), concepts)


def sorted_arrays(fused: FusedPoints) -> list[Floats]:
    order = np.lexsort(fused.points.round(7).T)
    return [getattr(fused, name)[order] for name in FusedPoints.__slots__]


@given(points=st.lists(st.tuples(*[st.floats(-1, 1)] * 3), min_size=8, max_size=40, unique=True).map(np.array))
def test_the_diameter_is_the_greatest_distance_between_two_points(points: Floats) -> None:
    try:
        diameter_m = diameter_of(points)
    except OnboardingError:
        assert np.linalg.svd(points - points.mean(axis=0))[1][2] < 1e-6
        return
    assert diameter_m == pytest.approx(np.linalg.norm(points[:, None] - points[None], axis=2).max(), rel=1e-6)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.eye(3), np.random.default_rng(0).random((50, 3)) * [1, 1, 0]])
def test_points_that_span_no_volume_have_no_diameter(points: Floats) -> None:
    with pytest.raises(OnboardingError, match=f"{len(points)} points of the reference frames span no volume"):
        diameter_of(points)


def test_a_fused_ball_is_the_ball_each_voxel_once(balls: list[PosedFrame], clouds: list[PointCloud]) -> None:
    fused = fuse(clouds, balls, 0.1, 0.002)
    outwards = fused.points / 0.05
    assert np.linalg.norm(outwards, axis=1) == pytest.approx(1, abs=0.02)
    assert (fused.normals * outwards).sum(axis=1).min() > np.cos(np.radians(12))
    assert np.linalg.norm(fused.normals, axis=1) == pytest.approx(1, abs=1e-9)
    cells, octants = np.floor((AHEAD @ fused.points) / 0.002), fused.normals @ AHEAD.rotation.T > 0
    assert len(np.unique(np.concatenate((cells, octants), axis=1), axis=0)) == len(fused.points)
    lengths = [len(cloud) for cloud in clouds]
    assert max(lengths) < len(fused.points) < sum(lengths)


def test_what_is_fused_is_made_of_what_was_seen(balls: list[PosedFrame], clouds: list[PointCloud]) -> None:
    fused = fuse(clouds, balls, 0.1, 0.002)
    points = np.concatenate([b.T_cam_obj.inverse() @ c.points for b, c in zip(balls, clouds, strict=True)])
    assert KDTree(points).query(fused.points)[0].max() < 0.002
    assert np.quantile(KDTree(fused.points).query(points)[0], 0.98) < 0.002
    for name, slack in (("colours", 0.5), ("saliency", 1e-4)):  # of colours the light is taken off, though here is none
        seen = np.concatenate([getattr(cloud, name) for cloud in clouds])
        assert (getattr(fused, name) >= seen.min(axis=0) - slack).all()
        assert (getattr(fused, name) <= seen.max(axis=0) + slack).all()
    nearest = KDTree(points).query(fused.points)[1]
    apart = np.abs(fused.colours - np.concatenate([cloud.colours for cloud in clouds])[nearest])
    assert np.median(apart) < 1.0
    assert fused.colours.dtype == fused.saliency.dtype == np.float32


def test_how_many_views_saw_a_point_is_counted(balls: list[PosedFrame], clouds: list[PointCloud]) -> None:
    fused = fuse(clouds, balls, 0.1, 0.002)
    towards = np.stack([ball.T_cam_obj.inverse().translation_m / 0.4 for ball in balls])
    # a camera sees of a ball what lies more than radius / distance towards it
    cosines = fused.points / np.linalg.norm(fused.points, axis=1, keepdims=True) @ towards.T
    surely, perhaps = (cosines > 0.05 / 0.4 + 0.15).sum(axis=1), (cosines > 0.05 / 0.4 - 0.05).sum(axis=1)
    assert set(np.unique(fused.view_count)) == {1, 2, 3}
    assert (fused.view_count >= np.maximum(surely, 1)).mean() > 0.99
    assert (fused.view_count <= np.maximum(perhaps, 1)).mean() > 0.99
    assert fused.agreement.min() >= 0
    assert fused.agreement.max() <= 1
    assert fused.agreement[fused.view_count > 1].mean() > 0.98


def test_one_view_agrees_with_itself(balls: list[PosedFrame], clouds: list[PointCloud]) -> None:
    fused = fuse(clouds[:1], balls[:1], 0.1, 0.002)
    assert (fused.view_count == 1).all()
    assert fused.agreement == pytest.approx(1, abs=1e-5)


def test_the_model_moves_with_the_object_s_axes(balls: list[PosedFrame], clouds: list[PointCloud]) -> None:
    G = Pose.exp([0.5, -1.2, 2.0, 0.3, -0.1, 0.2])
    here = fuse(clouds, balls, 0.1, 0.002)
    there = fuse(clouds, [replace(ball, T_cam_obj=ball.T_cam_obj @ G.inverse()) for ball in balls], 0.1, 0.002)
    assert np.allclose(there.points, G @ here.points, atol=1e-9)
    assert np.allclose(there.normals, here.normals @ G.rotation.T, atol=1e-9)
    for name in ("colours", "saliency", "view_count", "agreement"):
        assert np.allclose(getattr(there, name), getattr(here, name), atol=1e-4)


def test_the_order_of_the_further_views_does_not_matter(balls: list[PosedFrame], clouds: list[PointCloud]) -> None:
    one = fuse(clouds, balls, 0.1, 0.002)
    other = fuse([clouds[0], clouds[2], clouds[1]], [balls[0], balls[2], balls[1]], 0.1, 0.002)
    for a, b in zip(sorted_arrays(one), sorted_arrays(other), strict=True):
        assert np.allclose(a, b, atol=1e-4)


def test_a_view_weighs_by_how_near_and_how_straight_it_looks() -> None:
    one_metre, two_metres = (blind(Pose(np.eye(3), np.array([0.0, 0, z_m]))) for z_m in (1.0, 2.0))
    straight, slanting = [[1e-9, 0.0, -1.0]], [[np.sqrt(0.75), 0.0, -0.5]]
    near_and_far = [cloud_of([[0.0, 0, 1]], straight, 1.0), cloud_of([[0.0, 0, 2]], straight, 0.0)]
    fused = fuse(near_and_far, [one_metre, two_metres], 0.1, 0.01)
    assert np.allclose(fused.saliency, [[0.8, 0.2]])  # a quarter of the pixels at twice the distance
    straight_and_slanting = [cloud_of([[0.0, 0, 1]], straight, 1.0), cloud_of([[0.0, 0, 1]], slanting, 0.0)]
    fused = fuse(straight_and_slanting, [one_metre, one_metre], 0.1, 0.01)
    assert np.allclose(fused.saliency, [[2 / 3, 1 / 3]])  # half the pixels at sixty degrees
    assert np.allclose(fused.normals[0] / np.linalg.norm(fused.normals[0]), fused.normals[0])


def test_views_that_contradict_each_other_agree_less() -> None:
    at = Pose(np.eye(3), np.array([0.0, 0, 1]))
    facing = [[0.0, 0, -1]]

    def agreement(first: float, second: float) -> float:
        clouds = [cloud_of([[0.0, 0, 1]], facing, first), cloud_of([[0.0, 0, 1]], facing, second)]
        return float(fuse(clouds, [blind(at), blind(at)], 0.1, 0.01).agreement[0])

    assert agreement(0.7, 0.7) == pytest.approx(1, abs=1e-6)
    assert agreement(1, 0) == pytest.approx(np.sqrt(0.5), abs=1e-6)
    assert agreement(1, 0.5) < agreement(0.9, 0.7) < 1


def test_the_two_sides_of_a_thin_wall_stay_two_points() -> None:
    at = Pose(np.eye(3), np.array([0.0, 0, 1]))
    turned = Pose(np.diag([-1.0, 1, -1]), np.array([0.0, 0, 1]))
    facing = [[0.0, 0, -1]]
    fused = fuse(
        [cloud_of([[0.001, 0.001, 1.0]], facing, 1.0), cloud_of([[-0.001, 0.001, 0.999]], facing, 0.0)],
        [blind(at), blind(turned)], 0.1, 0.01,
    )  # fmt: skip
    assert sorted(fused.normals[:, 2].tolist()) == [-1, 1]
    assert sorted(fused.saliency[:, 0].tolist()) == [0, 1]


def test_what_other_views_deny_is_left_out(balls: list[PosedFrame], clouds: list[PointCloud]) -> None:
    first = clouds[0]
    stray = AHEAD.translation_m + np.array([[0.09, 0, 0], [0, 0, -0.10]])  # beside the ball and before it
    grown = replace(
        first,
        points=np.concatenate((first.points, stray)),
        normals=np.concatenate((first.normals, [[0, 0, -1.0]] * 2)),
        colours=np.concatenate((first.colours, np.zeros((2, 3), np.float32))),
        saliency=np.concatenate((first.saliency, first.saliency[:2])),
    )
    alone = fuse([grown], balls[:1], 0.1, 0.002)
    together = fuse([grown, *clouds[1:]], balls, 0.1, 0.002)
    assert np.linalg.norm(alone.points, axis=1).max() > 0.08
    assert np.linalg.norm(together.points, axis=1).max() < 0.052
