"""MSSD, MSPD and the symmetric rotation error: by hand, by trying everything, by law, and against the BOP toolkit."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.metrics import add, rotation_error_deg
from eval.symmetric_errors import mspd, mssd, symmetric_rotation_error_deg
from eval.symmetries import ASYMMETRIC, Motions, ObjectSymmetries
from tracker.geometry import Floats, Intrinsics, Pose

CAMERA = Intrinsics(600.0, 620.0, 320.0, 240.0, 640, 480)
WIDE = Intrinsics(1200.0, 1240.0, 640.0, 480.0, 1280, 960)
CORNERS_M = np.array(list(product((-0.03, 0.03), (-0.02, 0.02), (-0.01, 0.01))))
HALF_TURNS = ObjectSymmetries.listed([np.diag(s) for s in ((1, -1, -1, 1), (-1, 1, -1, 1), (-1, -1, 1, 1))])
CAN = ObjectSymmetries.listed([np.diag([1, -1, -1, 1])], [[0, 0, 1]], [[0, 0, 0]])
KINDS = {"none": ASYMMETRIC, "half turns": HALF_TURNS, "can": CAN}
CLOUD_M = np.random.default_rng(3).uniform(-1, 1, (40, 3)) * [0.04, 0.05, 0.08]
STEPS = 2 * np.pi * np.arange(315) / 315
RINGS_M = np.concatenate(
    [
        np.stack((radius_m * np.cos(STEPS), radius_m * np.sin(STEPS), np.full(315, height_m)), axis=1)
        for radius_m, height_m in ((0.03, 0.06), (0.03, -0.06), (0.05, 0.01), (0.05, -0.01))
    ]
)

small = st.lists(st.floats(-0.3, 0.3), min_size=6, max_size=6)
turns = st.lists(st.floats(-2, 2), min_size=3, max_size=3)
places = st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(0.6, 1.5))
truths = st.builds(lambda turn, place_m: Pose(Pose.exp([*turn, 0, 0, 0]).rotation, np.array(place_m)), turns, places)
kinds = st.sampled_from(list(KINDS.values()))


def at(x_mm: float, turn_deg: float = 0.0) -> Pose:
    """A metre before the camera, x_mm to the right, turned about z."""
    return Pose(Pose.exp([0, 0, np.radians(turn_deg), 0, 0, 0]).rotation, np.array([x_mm / 1000, 0, 1]))


def alike(motions: Motions, s: int, pose: Pose) -> Pose:
    """The pose that looks like another one by the motion with this number, or by what is left of it."""
    s %= len(motions)
    return pose @ Pose(motions.turns[s], motions.shifts_m[s])


def tried(points_m: Floats, motions: Motions, estimate: Pose, truth: Pose, camera: Intrinsics | None) -> float:
    """What the definition says, for all motions and all points."""

    def seen(points: Floats) -> Floats:
        return points if camera is None else camera.project(points)

    estimated = seen(estimate @ points_m)
    poses = [alike(motions, s, truth) for s in range(len(motions))]
    return min(float(np.linalg.norm(estimated - seen(pose @ points_m), axis=1).max()) for pose in poses)


def test_mssd_by_hand() -> None:
    half_turned = [at(5, 180)]
    assert mssd(CORNERS_M, HALF_TURNS.motions(), half_turned, [at(0)])[0] == pytest.approx(0.005)
    # without symmetry the corner (-30, 20) is at (35, -20)
    assert mssd(CORNERS_M, ASYMMETRIC.motions(), half_turned, [at(0)])[0] == pytest.approx(np.hypot(0.065, 0.04))


def test_mspd_by_hand_is_in_pixels_of_an_image_640_wide() -> None:
    point_m = np.zeros((1, 3))
    for camera in (CAMERA, WIDE):
        assert mspd(point_m, ASYMMETRIC.motions(), [at(10)], [at(0)], [camera])[0] == pytest.approx(6)
    poses = [at(10), at(0)]
    both = mspd(point_m, ASYMMETRIC.motions(), poses, [at(0), at(0)], [CAMERA, WIDE])
    assert both.tolist() == pytest.approx([6, 0])
    half_turned = mspd(CORNERS_M, HALF_TURNS.motions(), [at(5, 180)], [at(0)], [CAMERA])[0]
    assert half_turned == pytest.approx(0.005 / 0.99 * 600)  # the nearest corners move most


def test_a_point_in_the_plane_of_the_camera_has_no_projection() -> None:
    behind = Pose(np.eye(3), np.zeros(3))
    assert mspd(np.zeros((1, 3)), ASYMMETRIC.motions(), [behind], [at(0)], [CAMERA])[0] == np.inf
    assert mspd(np.zeros((1, 3)), CAN.motions(), [behind], [behind], [CAMERA])[0] == np.inf


def test_no_instances_have_no_errors() -> None:
    for symmetries in KINDS.values():
        assert len(mssd(CLOUD_M, symmetries.motions(), [], [])) == 0
        assert len(mspd(CLOUD_M, symmetries.motions(), [], [], [])) == 0
        assert len(symmetric_rotation_error_deg(symmetries, [], [])) == 0


@settings(max_examples=25)
@given(symmetries=kinds, truth=truths, off=small, s=st.integers(0, 629))
def test_leaving_out_what_cannot_be_the_least_changes_nothing(
    symmetries: ObjectSymmetries, truth: Pose, off: list[float], s: int
) -> None:
    motions = symmetries.motions()
    estimate = alike(motions, s, truth).nudged(np.array(off))
    expected = tried(CLOUD_M, motions, estimate, truth, None)
    assert mssd(CLOUD_M, motions, [estimate], [truth])[0] == pytest.approx(expected, abs=1e-12)
    expected = tried(CLOUD_M, motions, estimate, truth, CAMERA)
    assert mspd(CLOUD_M, motions, [estimate], [truth], [CAMERA])[0] == pytest.approx(expected, abs=1e-8)


@settings(max_examples=25)
@given(shape=st.sampled_from([(HALF_TURNS, CORNERS_M), (CAN, RINGS_M)]), truth=truths, off=small, s=st.integers(0, 629))
def test_errors_do_not_tell_poses_that_look_alike(
    shape: tuple[ObjectSymmetries, Floats], truth: Pose, off: list[float], s: int
) -> None:
    symmetries, points_m = shape  # the points are where they were after each of the motions
    motions, estimate = symmetries.motions(), truth.nudged(np.array(off))
    pair = [estimate, alike(motions, s, estimate)]
    surface = mssd(points_m, motions, pair, [truth] * 2)
    assert surface[1] == pytest.approx(surface[0], abs=1e-9)
    projection = mspd(points_m, motions, pair, [truth] * 2, [CAMERA] * 2)
    assert projection[1] == pytest.approx(projection[0], abs=1e-6)
    angle = symmetric_rotation_error_deg(symmetries, pair, [truth] * 2)
    assert angle[1] == pytest.approx(angle[0], abs=1e-5)


@given(truth=truths, off=small)
def test_mssd_is_at_least_add_and_symmetries_only_lower_it(truth: Pose, off: list[float]) -> None:
    estimates, truth_too = [truth.nudged(np.array(off))], [truth]
    plain = mssd(CLOUD_M, ASYMMETRIC.motions(), estimates, truth_too)[0]
    assert plain >= add(CLOUD_M, estimates, truth_too)[0] - 1e-12
    assert mssd(CLOUD_M, HALF_TURNS.motions(), estimates, truth_too)[0] <= plain + 1e-12


@given(truth=truths, symmetries=kinds)
def test_the_true_pose_has_no_error(truth: Pose, symmetries: ObjectSymmetries) -> None:
    assert mssd(CLOUD_M, symmetries.motions(), [truth], [truth])[0] == 0
    assert mspd(CLOUD_M, symmetries.motions(), [truth], [truth], [CAMERA])[0] == 0
    assert symmetric_rotation_error_deg(symmetries, [truth], [truth])[0] == pytest.approx(0, abs=1e-5)


@settings(max_examples=20)
@given(truth=truths, turn=turns, symmetries=kinds)
def test_the_best_turn_about_an_axis_is_found_without_steps(
    truth: Pose, turn: list[float], symmetries: ObjectSymmetries
) -> None:
    estimate = truth.nudged(np.array([*turn, 0, 0, 0]))
    motions = symmetries.motions(720)
    steps = [rotation_error_deg([estimate], [alike(motions, s, truth)])[0] for s in range(len(motions))]
    found = symmetric_rotation_error_deg(symmetries, [estimate], [truth])[0]
    assert min(steps) - 0.5 < found <= min(steps) + 1e-5


@pytest.mark.shared_data
def test_agrees_with_the_bop_toolkit(shared_data: Path) -> None:
    golden = json.loads((shared_data / "golden_pose_errors.json").read_text())
    camera = Intrinsics.from_matrix(golden["K"], *golden["image_size"])
    for shape in golden["objects"].values():
        motions = ObjectSymmetries.from_models_info(shape["models_info"]).motions()
        assert len(motions) == shape["symmetry_count"]
        points_m, cases = np.array(shape["vertices_mm"]) / 1000, shape["cases"]
        estimated, truth = (_golden_poses(cases, which) for which in ("est", "gt"))
        surface_mm = 1000 * mssd(points_m, motions, estimated, truth)
        assert surface_mm.tolist() == pytest.approx([case["mssd"] for case in cases], abs=1e-6)
        projection_px = mspd(points_m, motions, estimated, truth, [camera] * len(cases))
        assert projection_px.tolist() == pytest.approx([case["mspd"] for case in cases], abs=1e-6)


def _golden_poses(cases: Sequence[dict[str, list[float]]], which: str) -> list[Pose]:
    return [Pose(np.reshape(c[f"R_{which}"], (3, 3)), np.array(c[f"t_{which}_mm"]) / 1000) for c in cases]
