"""Poses in object frames of their own: one frame tells where those frames are, all the others are scored."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eval.alignment import align
from eval.bop_results import Estimate, write_results
from eval.datasets import MaskKind, ObjectModel, Target, require
from eval.datasets.synthetic import SyntheticDataset
from eval.score import score, score_results_file
from tracker.geometry import Pose
from tracker.sources import PosedSource
from tracker.sources.synthetic import open_scene

NUMBERS = {"cup": 1, "tin": 2}
CORNERS_M = 0.05 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 2]], float)


class Shelf:
    """Scenes 1 and 2 of six images each, a cup and a tin in all of them, each moving in its own way."""

    name = "memory:shelf"
    target_rule = "all"
    model_frame = "its own"
    scene_ids = (1, 2)
    object_ids = ("cup", "tin")

    def scene(self, scene_id: int, masks: MaskKind = "visib") -> PosedSource:  # noqa: ARG002
        return open_scene("turn?size=96x72&frames=6")  # for its cameras

    def image_ids(self, scene_id: int) -> Sequence[int]:  # noqa: ARG002
        return range(6)

    def targets(self, scene_id: int) -> list[Target]:
        require("scene", scene_id, self.scene_ids, self.name)
        return [Target(i, i, name, truth(scene_id, i, name), 100, 1.0) for i in range(6) for name in self.object_ids]

    def model(self, object_id: str) -> ObjectModel:  # noqa: ARG002
        return ObjectModel(CORNERS_M, 0.12, None)

    def number(self, object_id: str) -> int:
        return NUMBERS[object_id]

    def object_with(self, number: int) -> str:
        return self.object_ids[number - 1]


def random_pose(seed: int, spread_m: float = 0.2) -> Pose:
    rng = np.random.default_rng(seed)
    return Pose.exp(np.concatenate((rng.normal(0, 1.5, 3), rng.normal(0, spread_m, 3))))


def truth(scene_id: int, image_id: int, object_id: str) -> Pose:
    pose = random_pose(100 * scene_id + 10 * image_id + NUMBERS[object_id])
    return replace(pose, translation_m=pose.translation_m + np.array([0, 0, 1]))


def own_frame(scene_id: int, object_id: str) -> Pose:
    """T_obj_own: a tracker without a CAD model starts every object and scene in another frame."""
    return random_pose(7000 + 10 * scene_id + NUMBERS[object_id], 0.1)


def in_own_frames(dataset: Shelf | None = None) -> list[Estimate]:
    return [
        Estimate(s, t.image_id, NUMBERS[t.object_id], 0.5 + t.image_id / 20, t.T_cam_obj @ own_frame(s, t.object_id))
        for s in Shelf.scene_ids
        for t in (dataset or Shelf()).targets(s)
    ]


@pytest.fixture
def results(tmp_path: Path) -> Path:
    write_results(tmp_path / "own.csv", in_own_frames())
    return tmp_path / "own.csv"


def test_the_truth_in_other_object_frames_has_no_error_once_it_is_aligned(results: Path) -> None:
    unaligned = score_results_file(Shelf(), results)
    assert unaligned.pooled["add_auc"] < 20
    assert "alignment" not in unaligned.protocol
    aligned = score_results_file(Shelf(), results, align_on="first")
    assert aligned.pooled["add_auc_2cm_exact"] == pytest.approx(100)
    assert max(row.add_m for row in aligned.instances) < 1e-9
    assert "pred_i @ inv(pred_r) @ gt_r" in str(aligned.protocol["alignment"])
    assert "first" in str(aligned.protocol["alignment"])


def test_the_reference_frames_are_left_out_unless_they_are_asked_for(results: Path) -> None:
    without = score_results_file(Shelf(), results, align_on="first")
    assert without.pooled["instances"] == 20
    assert {row.image_id for row in without.instances} == {1, 2, 3, 4, 5}
    assert without.protocol["reference_frames"] == "out (4 instances)"
    assert without.protocol["alignment_frames"] == {f"{s}/{name}": 0 for s in (1, 2) for name in ("cup", "tin")}
    assert without.protocol["alignment_frames_are"] == "not scored"
    everything = score_results_file(Shelf(), results, align_on="first", keep_alignment_frames=True)
    assert everything.pooled["instances"] == 24
    assert everything.protocol["alignment_frames_are"] == "scored"


def test_the_reference_is_the_first_estimated_frame_or_the_one_of_the_best_score() -> None:
    estimates = [e for e in in_own_frames() if e.image_id > 1 or e.object_id == 2]
    first = align(Shelf(), estimates, "first").reference_frames
    assert first == {(1, "cup", 2), (2, "cup", 2), (1, "tin", 0), (2, "tin", 0)}
    best = align(Shelf(), estimates, "best-score").reference_frames
    assert best == {(s, name, 5) for s in (1, 2) for name in ("cup", "tin")}
    assert align(Shelf(), estimates, scene_ids=[2], object_ids=["tin"]).reference_frames == {(2, "tin", 0)}


def test_an_error_in_the_reference_frame_is_in_all_the_others_and_one_elsewhere_stays_there() -> None:
    off = Pose(np.eye(3), np.array([0.01, 0, 0]))
    for wrong, count in ((0, 5), (3, 1)):
        estimates = [replace(e, T_cam_obj=e.T_cam_obj @ off) if e.image_id == wrong else e for e in in_own_frames()]
        aligned = align(Shelf(), estimates)
        scores = score(Shelf(), aligned.estimates, exclude=aligned.reference_frames)
        of_one = [row.add_m for row in scores.instances if (row.scene_id, row.object_id) == (1, "cup")]
        assert sum(error_m > 1e-6 for error_m in of_one) == count
        assert max(of_one) == pytest.approx(0.01)


def test_of_several_estimates_in_the_reference_frame_the_best_scored_one_counts_and_all_are_moved() -> None:
    worse = [replace(e, score=0.1, T_cam_obj=random_pose(e.image_id)) for e in in_own_frames() if e.image_id == 0]
    aligned = align(Shelf(), worse + in_own_frames())
    assert len(aligned.estimates) == 28
    assert [e.score for e in aligned.estimates[:4]] == [0.1] * 4
    scores = score(Shelf(), aligned.estimates, exclude=aligned.reference_frames)
    assert max(row.add_m for row in scores.instances) < 1e-9


def test_an_object_with_a_single_estimate_is_told_and_its_other_targets_are_missing(
    caplog: pytest.LogCaptureFixture,
) -> None:
    estimates = [e for e in in_own_frames() if (e.scene_id, e.object_id) != (1, 1) or e.image_id == 4]
    with caplog.at_level(logging.WARNING):
        aligned = align(Shelf(), estimates)
    assert "1/cup" in caplog.text
    assert aligned.alone == ("1/cup",)
    assert aligned.stated()["alignment_only"] == ["1/cup"]
    scores = score(Shelf(), aligned.estimates, exclude=aligned.reference_frames)
    assert scores.pooled["missing"] == 5
    assert scores.pooled["instances"] == 20


def test_an_object_that_is_never_estimated_has_no_reference_and_all_its_targets_are_missing() -> None:
    aligned = align(Shelf(), [e for e in in_own_frames() if e.object_id == 2])
    assert {object_id for _, object_id, _ in aligned.reference_frames} == {"tin"}
    scores = score(Shelf(), aligned.estimates, exclude=aligned.reference_frames)
    assert (scores.per_object["cup"]["missing"], scores.per_object["tin"]["missing"]) == (12, 0)


def test_an_estimate_of_no_target_is_no_reference() -> None:
    """Nobody knows the truth there, or what is to be seen."""
    dataset = SyntheticDataset(open_scene("turn?size=96x72&frames=3&object=tea_box"))
    targets = dataset.targets(1)
    extra = Estimate(1, 77, 1, 1.0, random_pose(5))
    estimates = [extra, *(Estimate(1, t.image_id, 1, 0.5, t.T_cam_obj @ random_pose(3)) for t in targets)]
    aligned = align(dataset, estimates, "best-score")
    assert aligned.reference_frames == {(1, "tea_box", targets[0].image_id)}
