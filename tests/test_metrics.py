"""Pose errors: against the BOP toolkit's numbers, against published scores, and the laws that they obey."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from eval.auc import auc_exact, auc_vocap
from eval.metrics import add, adds, rotation_error_deg, translation_error_m
from tracker.geometry import Floats, Pose

POINTS_M = np.random.default_rng(5).uniform(-0.05, 0.05, (60, 3))
IDENTITY = Pose.identity()

twists = st.lists(st.floats(-2, 2), min_size=6, max_size=6)
poses = twists.map(Pose.exp)


@given(estimate=poses, truth=poses)
def test_add_and_adds_are_what_their_definitions_say(estimate: Pose, truth: Pose) -> None:
    estimated, true = estimate @ POINTS_M, truth @ POINTS_M
    distances = np.linalg.norm(true[:, None] - estimated[None], axis=2)
    assert add(POINTS_M, [estimate], [truth])[0] == pytest.approx(np.diagonal(distances).mean(), abs=1e-12)
    assert adds(POINTS_M, [estimate], [truth])[0] == pytest.approx(distances.min(axis=1).mean(), abs=1e-12)


def test_adds_goes_from_the_ground_truth_to_the_estimate() -> None:
    points_m = np.array([[0, 0, 0], [0.1, 0, 0], [0.12, 0, 0]])
    shifted = Pose(np.eye(3), np.array([0.1, 0, 0]))
    # True points at 0, 100, 120 mm; estimated ones at 100, 200, 220 mm: 100, 0 and 20 mm. Backwards: 0, 80, 100.
    assert adds(points_m, [shifted], [IDENTITY])[0] == pytest.approx(0.04)


@given(estimate=poses, truth=poses, motion=poses)
def test_errors_do_not_change_under_a_common_motion(estimate: Pose, truth: Pose, motion: Pose) -> None:
    for error in (lambda e, t: add(POINTS_M, e, t), lambda e, t: adds(POINTS_M, e, t), rotation_error_deg):
        assert error([motion @ estimate], [motion @ truth])[0] == pytest.approx(error([estimate], [truth])[0], abs=1e-6)
    moved = translation_error_m([motion @ estimate], [motion @ truth])[0]
    assert moved == pytest.approx(translation_error_m([estimate], [truth])[0], abs=1e-9)


@given(pose=poses)
def test_identical_poses_have_no_error(pose: Pose) -> None:
    assert add(POINTS_M, [pose], [pose])[0] == 0
    assert adds(POINTS_M, [pose], [pose])[0] == pytest.approx(0, abs=1e-12)
    assert rotation_error_deg([pose], [pose])[0] == pytest.approx(0, abs=1e-12)
    assert translation_error_m([pose], [pose])[0] == 0


@given(estimate=poses, truth=poses)
def test_adds_is_at_most_add(estimate: Pose, truth: Pose) -> None:
    assert adds(POINTS_M, [estimate], [truth])[0] <= add(POINTS_M, [estimate], [truth])[0] + 1e-12


@given(axis=st.lists(st.floats(-1, 1), min_size=3, max_size=3), angle_deg=st.floats(0, 180))
def test_the_rotation_error_is_the_angle_also_near_0_and_180(axis: list[float], angle_deg: float) -> None:
    direction = np.add(axis, (0, 0, 2))
    direction /= np.linalg.norm(direction)
    turned = Pose.exp([*(direction * np.radians(angle_deg)), 0, 0, 0])
    assert rotation_error_deg([turned], [IDENTITY])[0] == pytest.approx(angle_deg, abs=1e-10)


def test_many_instances_at_once_are_each_by_itself() -> None:
    rng = np.random.default_rng(0)
    estimates, truths = ([Pose.exp(rng.normal(size=6)) for _ in range(4)] for _ in range(2))
    for error in (lambda e, t: add(POINTS_M, e, t), lambda e, t: adds(POINTS_M, e, t), rotation_error_deg):
        one_by_one = [error([e], [t])[0] for e, t in zip(estimates, truths, strict=True)]
        assert error(estimates, truths).tolist() == pytest.approx(one_by_one)


def test_no_instances_have_no_errors() -> None:
    assert len(add(POINTS_M, [], [])) == len(adds(POINTS_M, [], [])) == 0
    assert len(rotation_error_deg([], [])) == len(translation_error_m([], [])) == 0


def test_a_rotation_of_three_digits_still_has_exact_moved_points() -> None:
    rounded = Pose(np.round(Pose.exp([0.3, -0.8, 0.5, 0, 0, 0]).rotation, 3), np.array([0.0, 0.1, 1.0]))
    assert adds(POINTS_M, [rounded], [rounded])[0] == pytest.approx(0, abs=1e-12)


@pytest.mark.shared_data
def test_agrees_with_the_bop_toolkit(shared_data: Path) -> None:
    golden = json.loads((shared_data / "golden_pose_errors.json").read_text())
    cases = 0
    for shape in golden["objects"].values():
        points_m = np.array(shape["vertices_mm"]) / 1000
        for case in shape["cases"]:
            estimate, truth = _golden_pose(case, "est"), _golden_pose(case, "gt")
            assert add(points_m, [estimate], [truth])[0] * 1000 == pytest.approx(case["add"], abs=1e-6)
            assert adds(points_m, [estimate], [truth])[0] * 1000 == pytest.approx(case["adi"], abs=1e-6)
            assert rotation_error_deg([estimate], [truth])[0] == pytest.approx(case["re_deg"], abs=1e-6)
            assert translation_error_m([estimate], [truth])[0] * 1000 == pytest.approx(case["te_mm"], abs=1e-6)
            cases += 1
    assert cases == 36


@pytest.mark.shared_data
@pytest.mark.parametrize("method", ["posecnn_rss2018", "posecnn_icp_rss2018"])
def test_published_estimates_get_their_published_scores(shared_data: Path, method: str) -> None:
    """ADD over all vertices of the scans; ADD-S from every fifth of them to all, as the expected numbers were made."""
    ycbv = shared_data / "ycbv"
    expected = json.loads((ycbv / "estimates" / "expected_auc.json").read_text())[method]
    classes: dict[str, list[Floats]] = {}
    for file in sorted((ycbv / "estimates" / method).glob("*.txt")):
        name = file.stem.partition("_")[2]
        classes.setdefault(name, []).append(_published_errors(ycbv, name, file))
    by_class = {name: np.hstack(parts) for name, parts in classes.items()}
    pooled = np.hstack(list(by_class.values()))

    assert pooled.shape[1] == expected["instances"]
    assert np.isinf(pooled[0]).sum() == expected["missing"]
    for row, metric in enumerate(("add", "adds")):
        assert auc_exact(pooled[row]) == pytest.approx(expected["pooled"][f"{metric}_exact"], abs=0.05)
        assert auc_vocap(pooled[row]) == pytest.approx(expected["pooled"][f"{metric}_vocap"], abs=0.05)
        exact = {name: auc_exact(errors[row]) for name, errors in by_class.items()}
        assert exact == pytest.approx({name: pair[row] for name, pair in expected["per_class"].items()}, abs=0.05)
        assert np.mean(list(exact.values())) == pytest.approx(expected["mean_of_classes"][f"{metric}_exact"], abs=0.05)


def _golden_pose(case: dict[str, Any], which: str) -> Pose:
    return Pose(np.reshape(case[f"R_{which}"], (3, 3)), np.array(case[f"t_{which}_mm"]) / 1000)


def _published_errors(ycbv: Path, name: str, file: Path) -> Floats:
    """(2, K) ADD and ADD-S in metres of one object in one sequence; infinite where the pose is missing."""
    estimates, truths = np.loadtxt(file), np.loadtxt(ycbv / "poses" / file.name)
    given = estimates[:, :4].any(axis=1)
    pairs = [_poses(rows[given]) for rows in (estimates, truths)]
    points_m = _scan_in_ycbv_frame(ycbv, name)
    errors = np.full((2, len(truths)), np.inf)
    errors[:, given] = add(points_m, *pairs), adds(points_m, *pairs, queries_m=points_m[::5])
    return errors


def _poses(rows: npt.NDArray[np.float64]) -> list[Pose]:
    return [Pose.from_quaternion(row[:4], row[4:]) for row in rows]


def _scan_in_ycbv_frame(ycbv: Path, name: str) -> Floats:
    """Vertices of the scan, the centre of its bounding box where the YCB-Video model frame has it."""
    entry = json.loads((ycbv / "objects.json").read_text())[name]
    mesh = trimesh.load_mesh(ycbv / "meshes" / entry["scan"] / "textured.obj", process=False)
    points_m = np.asarray(mesh.vertices)
    return points_m - (points_m.min(0) + points_m.max(0)) / 2 + entry["centre_ycbv"]
