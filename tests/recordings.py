"""What tests of recorded layouts write and check alike: pictures, a solid, and estimates that are the truth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from eval.bop_results import Estimate, write_results
from eval.datasets import Dataset
from eval.score import Scores, score_results_file
from tracker.geometry import Floats, Pose

SIZE_M = np.array([0.06, 0.04, 0.02])
CORNERS_M = SIZE_M / 2 * [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
DIAMETER_M = float(np.linalg.norm(SIZE_M))


def pose(x_m: float, angle_rad: float = 0.3) -> Pose:
    """Half a metre before the camera, turned about all axes."""
    return Pose.exp([angle_rad, -0.4, 0.2, 0, 0, 0]) @ Pose.identity().nudged(np.array([0, 0, 0, x_m, 0.02, 0.5]))


def write_picture(path: Path, picture: npt.NDArray) -> None:
    """Colours are given as RGB."""
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), picture[:, :, ::-1] if picture.ndim == 3 else picture)


def write_text(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def write_matrix(path: Path, matrix: Floats) -> None:
    write_text(path, "\n".join(" ".join(f"{value:.12g}" for value in row) for row in matrix) + "\n")


def write_obj(path: Path, points: Floats = CORNERS_M) -> None:
    """A mesh with these corners, every one of which belongs to a face."""
    faces = [(1 + k, 1 + (k + 1) % len(points), 1 + (k + 2) % len(points)) for k in range(len(points))]
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points] + [f"f {a} {b} {c}" for a, b, c in faces]
    write_text(path, "\n".join(lines) + "\n")


def score_the_truth(dataset: Dataset, folder: Path) -> Scores:
    """The scores of a result file that holds the true pose of every target."""
    estimates = [
        Estimate(scene_id, target.image_id, dataset.number(target.object_id), 1.0, target.T_cam_obj)
        for scene_id in dataset.scene_ids
        for target in dataset.targets(scene_id)
    ]
    write_results(folder / "truth.csv", estimates)
    return score_results_file(dataset, folder / "truth.csv")


def assert_nothing_is_wrong(scores: Scores, instances: int) -> None:
    assert (scores.pooled["instances"], scores.pooled["missing"]) == (instances, 0)
    assert max(row.add_m for row in scores.instances) < 1e-6
    assert max(row.adds_m for row in scores.instances) < 1e-6
    assert scores.pooled["add_auc"] > 99.99
    assert scores.protocol["estimates_of_no_target"] == 0
