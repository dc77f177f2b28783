"""Rigid motions obey the laws of their group, and the pinhole camera those of projection."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.errors import FrameError
from tracker.geometry import Floats, Intrinsics, Pose

CAMERA = Intrinsics(600.0, 610.0, 321.5, 238.0, 640, 480)
QUARTER = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]  # a quarter turn about z: x becomes y


def vectors(least: float, greatest: float) -> st.SearchStrategy[Floats]:
    return st.lists(st.floats(least, greatest), min_size=3, max_size=3).map(np.array)


directions = vectors(-1, 1).filter(lambda v: bool(np.linalg.norm(v) > 0.1)).map(lambda v: v / np.linalg.norm(v))
near_zero = st.one_of(st.just(0.0), st.floats(-16, -2).map(lambda exponent: 10**exponent))
angles = st.one_of(st.floats(0.01, 3.1), near_zero, near_zero.map(lambda small: math.pi - small))
twists = st.builds(lambda n, angle, v: np.concatenate((n * angle, v)), directions, angles, vectors(-2, 2))
poses = twists.map(Pose.exp)
point_sets = st.lists(vectors(-2, 2), min_size=1, max_size=5).map(np.array)
before_the_camera = point_sets.map(lambda points: points + np.array([0, 0, 2.5]))


def same(a: Pose, b: Pose, tolerance: float = 1e-12) -> bool:
    return np.allclose(a.matrix, b.matrix, rtol=0, atol=tolerance)


@given(a=poses, b=poses, c=poses)
def test_composition_is_associative(a: Pose, b: Pose, c: Pose) -> None:
    assert same((a @ b) @ c, a @ (b @ c))


@given(a=poses)
def test_the_identity_changes_nothing_on_either_side(a: Pose) -> None:
    assert same(a @ Pose.identity(), a)
    assert same(Pose.identity() @ a, a)


@given(a=poses, b=poses)
def test_the_inverse_undoes_on_either_side_and_turns_a_product_around(a: Pose, b: Pose) -> None:
    assert same(a @ a.inverse(), Pose.identity())
    assert same(a.inverse() @ a, Pose.identity())
    assert same((a @ b).inverse(), b.inverse() @ a.inverse())


@given(a=poses, b=poses, points=point_sets)
def test_a_product_maps_points_as_its_factors_do_one_after_the_other(a: Pose, b: Pose, points: Floats) -> None:
    assert np.allclose((a @ b) @ points, a @ (b @ points), rtol=0, atol=1e-12)
    homogeneous = np.concatenate((points, np.ones((len(points), 1))), axis=1)
    assert np.allclose(a @ points, (homogeneous @ a.matrix.T)[:, :3], rtol=0, atol=1e-12)


@given(a=poses, points=point_sets)
def test_a_motion_is_rigid(a: Pose, points: Floats) -> None:
    before, after = points - points[0], a @ points - (a @ points)[0]
    assert np.allclose(before @ before.T, after @ after.T, rtol=0, atol=1e-11)
    assert np.linalg.det(a.rotation) == pytest.approx(1, abs=1e-12)


@given(a=poses)
def test_a_pose_survives_every_way_of_writing_it(a: Pose) -> None:
    assert same(Pose.from_matrix(a.matrix), a)
    assert same(Pose.from_matrix(a.matrix[:3]), a)
    assert same(Pose.from_quaternion(a.quaternion_wxyz, a.translation_m), a)
    assert same(Pose.from_quaternion(-3 * a.quaternion_wxyz, a.translation_m), a)
    assert a.quaternion_wxyz[0] >= 0
    assert np.linalg.norm(a.quaternion_wxyz) == pytest.approx(1, abs=1e-12)


@given(a=poses)
def test_exp_is_the_inverse_of_log(a: Pose) -> None:
    assert same(Pose.exp(a.log()), a)
    assert np.linalg.norm(a.log()[:3]) <= math.pi + 1e-12


@given(twist=twists.filter(lambda t: bool(np.linalg.norm(t[:3]) < math.pi - 1e-13)))
def test_log_is_the_inverse_of_exp_up_to_half_a_turn(twist: Floats) -> None:
    assert np.allclose(Pose.exp(twist).log(), twist, rtol=0, atol=1e-11)


@given(n=directions, v=vectors(-2, 2), small=near_zero)
def test_half_a_turn_has_a_log_that_leads_back_to_it(n: Floats, v: Floats, small: float) -> None:
    for angle_rad in (math.pi - small, math.pi + small):
        a = Pose.exp(np.concatenate((n * angle_rad, v)))
        assert same(Pose.exp(a.log()), a)
        assert np.linalg.norm(a.log()[:3]) == pytest.approx(math.pi - small, abs=1e-7)


@given(twist=twists, small=near_zero)
def test_a_small_motion_is_the_identity_and_its_twist(twist: Floats, small: float) -> None:
    w, v = small * twist[:3], small * twist[3:]
    skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    a = Pose.exp(small * twist)
    bound = 10 * small**2 * float(twist @ twist) + 1e-15
    assert np.abs(a.rotation - np.eye(3) - skew).max() <= bound
    assert np.abs(a.translation_m - v).max() <= bound


@given(twist=twists, s=st.floats(-1, 1), t=st.floats(-1, 1))
def test_motions_along_one_twist_add_up(twist: Floats, s: float, t: float) -> None:
    assert same(Pose.exp(s * twist) @ Pose.exp(t * twist), Pose.exp((s + t) * twist), 1e-11)


@given(a=poses, twist=twists)
def test_a_twist_seen_from_another_frame_is_the_same_motion(a: Pose, twist: Floats) -> None:
    t = a.translation_m
    skew = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
    turned = a.rotation @ twist[:3]
    adjoint = np.concatenate((turned, a.rotation @ twist[3:] + skew @ turned))
    assert same(a @ Pose.exp(twist) @ a.inverse(), Pose.exp(adjoint), 1e-11)


def test_a_twist_has_the_rotation_first_and_its_translation_goes_along_the_turn() -> None:
    screw = Pose.exp([0, 0, math.pi / 2, 1, 0, 0])
    assert np.allclose(screw.rotation, QUARTER)
    assert np.allclose(screw.translation_m, [2 / math.pi, 2 / math.pi, 0])
    assert np.allclose(Pose.exp([0, 0, 0, 1, 2, 3]).translation_m, [1, 2, 3])


def test_a_quaternion_has_its_scalar_first() -> None:
    half = math.sqrt(0.5)
    pose = Pose.from_quaternion([half, 0, 0, half], [1, 2, 3])
    assert np.allclose(pose.rotation, QUARTER)
    assert np.allclose(pose.quaternion_wxyz, [half, 0, 0, half])
    assert np.allclose(pose @ np.array([[1.0, 0, 0]]), [[1, 3, 3]])


@given(a=poses, b=poses, c=poses)
def test_angle_and_distance_between_poses_are_metrics_that_the_observer_does_not_change(
    a: Pose, b: Pose, c: Pose
) -> None:
    assert a.angle_to_rad(a) == pytest.approx(0, abs=1e-7)
    assert a.angle_to_rad(b) == pytest.approx(b.angle_to_rad(a), abs=1e-9)
    assert a.angle_to_rad(c) <= a.angle_to_rad(b) + b.angle_to_rad(c) + 1e-7
    assert (c @ a).angle_to_rad(c @ b) == pytest.approx(a.angle_to_rad(b), abs=1e-7)
    assert (a @ c).angle_to_rad(b @ c) == pytest.approx(a.angle_to_rad(b), abs=1e-7)
    assert a.distance_to_m(b) == pytest.approx(b.distance_to_m(a), abs=1e-12)
    assert (c @ a).distance_to_m(c @ b) == pytest.approx(a.distance_to_m(b), abs=1e-9)


@given(a=poses, n=directions, angle_rad=angles)
def test_the_angle_to_a_turned_pose_is_the_angle_of_the_turn(a: Pose, n: Floats, angle_rad: float) -> None:
    turned = a @ Pose.exp(np.concatenate((n * angle_rad, np.zeros(3))))
    assert a.angle_to_rad(turned) == pytest.approx(angle_rad, abs=1e-7)


@given(a=poses, turn=vectors(-1, 1), shift_m=vectors(-1, 1))
def test_a_nudge_turns_about_the_origin_of_the_object_in_the_camera_s_axes(
    a: Pose, turn: Floats, shift_m: Floats
) -> None:
    nudged = a.nudged(np.concatenate((turn, shift_m)))
    assert np.allclose(nudged.translation_m, a.translation_m + shift_m, rtol=0, atol=1e-12)
    assert np.allclose(nudged.rotation, Pose.exp([*turn, 0, 0, 0]).rotation @ a.rotation, rtol=0, atol=1e-12)


def test_a_matrix_rounded_as_in_a_text_file_becomes_an_exact_rotation() -> None:
    exact = Pose.exp([0.3, -0.7, 0.4, 0.1, 0.2, 0.3])
    read = Pose.from_matrix(exact.matrix.round(4))
    assert np.abs(read.rotation @ read.rotation.T - np.eye(3)).max() < 1e-14
    assert np.abs(read.rotation - exact.rotation).max() < 1e-4
    assert read.translation_m.tolist() == [*exact.translation_m.round(4)]


def test_a_pose_does_not_change_with_the_matrix_that_it_was_read_from() -> None:
    matrix = np.eye(4)
    pose = Pose.from_matrix(matrix)
    matrix[:] = 7
    assert same(pose, Pose.identity())


@pytest.mark.parametrize(
    ("matrix", "complaint"),
    [
        (np.eye(3), r"4x4 or 3x4 matrix, got shape \(3, 3\)"),
        (np.full((4, 4), np.nan), "finite"),
        (np.diag([1.0, 1, -1, 1]), r"det R = -1\.000"),
        (np.diag([1000.0, 1000, 1000, 1]), "not a rotation"),
        (np.diag([1.0, 1, 1.01, 1]), "not a rotation"),
        (np.diag([0.0, 0, 0, 1]), "not a rotation"),
        (Pose.exp([0, 0, 0, 0.1, 0, 0]).matrix.T, "last row .* transposed"),
    ],
)
def test_what_is_no_rigid_motion_is_refused(matrix: Floats, complaint: str) -> None:
    with pytest.raises(FrameError, match=complaint):
        Pose.from_matrix(matrix)


@pytest.mark.parametrize(
    ("wxyz", "translation_m", "complaint"),
    [
        ([0, 0, 0, 0], [0, 0, 0], "not all zero"),
        ([np.nan, 0, 0, 1], [0, 0, 0], "four numbers"),
        ([np.inf, 0, 0, 1], [0, 0, 0], "four numbers"),
        ([0, 0, 1], [0, 0, 0], "four numbers"),
        ([1, 0, 0, 0], [0, np.nan, 0], "three finite numbers"),
        ([1, 0, 0, 0], [0, 0], "three finite numbers"),
    ],
)
def test_what_is_no_quaternion_or_no_translation_is_refused(
    wxyz: list[float], translation_m: list[float], complaint: str
) -> None:
    with pytest.raises(FrameError, match=complaint):
        Pose.from_quaternion(wxyz, translation_m)


@given(points=before_the_camera)
def test_unprojecting_a_projection_gives_the_point(points: Floats) -> None:
    pixels = CAMERA.project(points)
    assert np.allclose(CAMERA.unproject(pixels[:, 0], pixels[:, 1], points[:, 2]), points, rtol=0, atol=1e-12)


@given(points=before_the_camera, scale=st.floats(0.1, 10))
def test_a_projection_does_not_tell_how_far_along_its_ray_a_point_is(points: Floats, scale: float) -> None:
    assert np.allclose(CAMERA.project(scale * points), CAMERA.project(points), rtol=0, atol=1e-9)


@given(points=before_the_camera)
def test_projection_is_the_camera_matrix_and_a_division(points: Floats) -> None:
    pixels = points @ CAMERA.matrix.T
    assert np.allclose(CAMERA.project(points), pixels[:, :2] / pixels[:, 2:], rtol=0, atol=1e-9)


def test_the_optical_axis_meets_the_principal_point_and_a_metre_at_a_metre_is_a_focal_length() -> None:
    points = np.array([[0, 0, 0.7], [1, 0, 1.0], [0, 1, 1.0]])
    assert CAMERA.project(points).tolist() == [[321.5, 238], [921.5, 238], [321.5, 848]]


def test_a_camera_matrix_is_read_and_written_alike() -> None:
    assert Intrinsics.from_matrix(CAMERA.matrix, 640, 480) == CAMERA


@pytest.mark.parametrize(
    ("K", "complaint"),
    [
        ([[600, 0, 320], [0, 600, 240]], "3x3"),
        ([[600, 0, np.nan], [0, 600, 240], [0, 0, 1]], "finite"),
        ([[0, 0, 320], [0, 0, 240], [0, 0, 1]], "focal length"),
        ([[-600, 0, 320], [0, 600, 240], [0, 0, 1]], "focal length"),
        ([[0.9, 0, 0.5], [0, 0.9, 0.5], [0, 0, 1]], r"focal length .* does not suit 640 x 480"),
        ([[300, 0, 159.5], [0, 300, 119.5], [0, 0, 1]], "another resolution"),
        ([[1200, 0, 639.5], [0, 1200, 479.5], [0, 0, 1]], "another resolution"),
        ([[600, 0, 0], [0, 600, 0], [320, 240, 1]], "principal point"),
        ([[600, 0, 320], [0, 600, 20], [0, 0, 1]], "principal point"),
        ([[600, 0, 610], [0, 600, 240], [0, 0, 1]], "principal point"),
    ],
)
def test_a_camera_matrix_that_cannot_belong_to_the_picture_is_refused(K: list[list[float]], complaint: str) -> None:
    with pytest.raises(FrameError, match=complaint):
        Intrinsics.from_matrix(K, 640, 480)


def test_a_camera_of_more_pixels_than_any_has_is_refused() -> None:
    Intrinsics(7000, 7000, 3839.5, 2159.5, 7680, 4320).check()
    with pytest.raises(FrameError, match="at most 33554432 pixels, got 100000 x 100000"):
        Intrinsics(1e5, 1e5, 5e4, 5e4, 100_000, 100_000).check()


def test_a_camera_without_pixels_is_refused() -> None:
    with pytest.raises(FrameError, match="at least one pixel, got 0 x 480"):
        Intrinsics.from_matrix(CAMERA.matrix, 0, 480)


@pytest.mark.parametrize(
    ("width", "height", "f"), [(640, 480, 615), (1280, 720, 910), (1920, 1080, 1060), (60, 80, 70)]
)
def test_cameras_as_they_are_sold_are_accepted(width: int, height: int, f: float) -> None:
    Intrinsics(f, f, 0.48 * width, 0.53 * height, width, height).check()
