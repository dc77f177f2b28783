"""Estimates and targets -> scores: whole numbers that can be checked by hand."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from eval.bop_results import Estimate, write_results
from eval.datasets import ObjectModel, Target, require
from eval.datasets.bop import BopDataset
from eval.score import Scores, TrackingCounts, score, score_results_file
from tracker.errors import OutputError, SourceError
from tracker.geometry import Pose
from tracker.sources import PosedSource

KEYS = {
    *("add_auc", "adds_auc", "add_auc_exact", "adds_auc_exact"),
    *("add_auc_2cm", "adds_auc_2cm", "add_auc_2cm_exact", "adds_auc_2cm_exact"),
    *("over_1cm", "over_5cm", "add_recall_0.1d", "adds_recall_0.1d", "instances", "missing"),
}
IMAGES = {"cup": (0, 1, 2, 3, 4), "tin": (0, 1)}
NUMBERS = {"cup": 1, "tin": 2}


class Table:
    """Scene 1 with the errors of metrics.md in mind: a cup in five images and a tin in two. Each is a single point, so
    that ADD and ADD-S are the distance of the origins."""

    name = "memory:table"
    target_rule = "all"
    model_frame = "its own"
    scene_ids = (1,)
    object_ids = ("cup", "tin")

    def scene(self, scene_id: int) -> PosedSource:
        raise NotImplementedError

    def image_ids(self, scene_id: int) -> Sequence[int]:
        raise NotImplementedError

    def targets(self, scene_id: int) -> list[Target]:
        require("scene", scene_id, self.scene_ids, self.name)
        return [Target(i, i, name, at(0), 100, 1.0) for name, images in IMAGES.items() for i in images]

    def model(self, object_id: str) -> ObjectModel:
        return ObjectModel(np.zeros((1, 3)), {"cup": 0.1, "tin": 0.2}[object_id], object_id == "tin")

    def number(self, object_id: str) -> int:
        return NUMBERS[object_id]

    def object_with(self, number: int) -> str:
        raise NotImplementedError


def at(x_mm: float) -> Pose:
    return Pose(np.eye(3), np.array([x_mm / 1000, 0, 0]))


def estimate(name: str, image_id: int, error_mm: float, confidence: float = 1.0) -> Estimate:
    return Estimate(1, image_id, NUMBERS[name], confidence, at(error_mm))


CUPS = [estimate("cup", i, mm) for i, mm in enumerate((4, 8, 12, 60, 130))]
TINS = [estimate("tin", i, mm) for i, mm in enumerate((10, 30))]


def rounded(values: dict[str, float], *names: str) -> list[float]:
    return [round(values[name], 2) for name in names]


def test_the_constants_come_out_pooled_by_object_and_as_their_mean() -> None:
    scores = score(Table(), CUPS + TINS)
    names = ("add_auc", "adds_auc_exact")
    assert rounded(scores.pooled, *names) == [76.57, 68.00]
    assert rounded(scores.mean_of_objects, *names) == [85.10, 71.60]
    assert rounded(scores.per_object["cup"], *names) == [75.20, 63.20]
    assert rounded(scores.per_object["tin"], *names) == [95.00, 80.00]


def test_fine_curves_shares_and_recalls() -> None:
    scores = score(Table(), CUPS + TINS)
    cup = scores.per_object["cup"]
    assert rounded(cup, "add_auc_2cm_exact", "add_auc_2cm") == [36.0, 48.0]  # (0.8 + 0.6 + 0.4) / 5, and 12 / 20 / 5
    assert rounded(cup, "over_1cm", "over_5cm") == [60, 40]
    assert rounded(cup, "add_recall_0.1d", "adds_recall_0.1d") == [40, 40]  # under 10 mm of 100
    assert rounded(scores.pooled, "add_recall_0.1d") == [42.86]  # each under a tenth of its own diameter: 3 of 7


def test_the_layout_is_the_one_that_others_rely_on() -> None:
    content = score(Table(), CUPS).as_json()
    metrics = json.loads(json.dumps(content, allow_nan=False))["metrics"]
    assert set(metrics) == {"pooled", "mean_of_objects", "per_object"}
    for values in (metrics["pooled"], metrics["mean_of_objects"], *metrics["per_object"].values()):
        assert set(values) == KEYS


def test_a_missing_pose_is_an_infinite_error_and_counts() -> None:
    scores = score(Table(), CUPS[:3] + TINS)
    cup = scores.per_object["cup"]
    assert (cup["instances"], cup["missing"]) == (5, 2)
    assert rounded(cup, "add_auc_exact", "over_1cm", "over_5cm") == [55.2, 60, 40]
    row = scores.instances[4]
    assert row.missing
    assert (row.add_m, row.adds_m, row.rotation_deg, row.translation_m) == (np.inf,) * 4


def test_no_estimate_at_all_scores_zero() -> None:
    scores = score(Table(), [])
    assert rounded(scores.pooled, "add_auc", "adds_auc_2cm", "over_1cm", "missing") == [0, 0, 100, 7]


def test_rows_name_the_instance_and_its_errors() -> None:
    rows = score(Table(), CUPS + TINS).instance_table()
    assert [(row["object_id"], row["image_id"]) for row in rows] == [(name, i) for name in IMAGES for i in IMAGES[name]]
    assert rows[3]["add_m"] == rows[3]["adds_m"] == rows[3]["translation_m"] == pytest.approx(0.06)
    assert rows[3]["rotation_deg"] == 0
    assert set(rows[0]) >= {"scene_id", "image_id", "object_id", "add_m", "adds_m", "missing"}


def test_reference_frames_are_left_out_on_demand() -> None:
    scores = score(Table(), CUPS + TINS, exclude={(1, "cup", 4), (1, "cup", 3), (2, "tin", 0)})
    assert scores.per_object["cup"]["instances"] == 3
    assert scores.per_object["tin"]["instances"] == 2
    assert scores.protocol["reference_frames"] == "out (2 instances)"
    assert scores.protocol["estimates_of_no_target"] == 0


def test_estimates_of_no_target_are_ignored_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    stray = [estimate("tin", 4, 0), Estimate(9, 0, 1, 1.0, at(0)), Estimate(1, 0, 77, 1.0, at(0))]
    with caplog.at_level(logging.INFO):
        scores = score(Table(), CUPS + TINS + stray)
    assert rounded(scores.pooled, "add_auc") == [76.57]
    assert scores.protocol["estimates_of_no_target"] == 3
    assert "3 estimates are of no target" in caplog.text


@pytest.mark.parametrize("order", [1, -1])
def test_of_several_estimates_the_best_scored_counts(order: int, caplog: pytest.LogCaptureFixture) -> None:
    pair = [estimate("tin", 0, 10, confidence=0.9), estimate("tin", 0, 0, confidence=0.8)]
    scores = score(Table(), [*pair[::order], TINS[1]])
    assert rounded(scores.per_object["tin"], "add_auc") == [95.0]
    assert scores.protocol["surplus_estimates"] == 1
    assert "1 estimates have a better one" in caplog.text


def test_scenes_and_objects_can_be_chosen() -> None:
    scores = score(Table(), CUPS + TINS, scene_ids=[1], object_ids=["tin"])
    assert set(scores.per_object) == {"tin"}
    assert scores.pooled == scores.per_object["tin"]
    with pytest.raises(SourceError, match="no object 'cap'; it has cup, tin"):
        score(Table(), CUPS, object_ids=["cap"])
    with pytest.raises(SourceError, match="no scene 4; it has 1"):
        score(Table(), CUPS, scene_ids=[4])


@pytest.mark.filterwarnings("ignore:there is not one instance:RuntimeWarning")
def test_nothing_to_score_is_not_a_number_and_null_in_json() -> None:
    everything = {(1, name, i) for name, images in IMAGES.items() for i in images}
    scores = score(Table(), CUPS, exclude=everything)
    assert np.isnan(scores.pooled["add_auc"])
    assert set(scores.mean_of_objects) == set(scores.pooled) == KEYS
    content = json.loads(json.dumps(scores.as_json(), allow_nan=False))
    assert content["metrics"]["pooled"]["add_auc"] is None
    assert content["metrics"]["pooled"]["instances"] == 0
    assert content["metrics"]["per_object"] == {}


def test_what_the_tracking_run_counted_stands_beside_the_errors() -> None:
    tracking = {"cup": TrackingCounts(10, 1, 3), "tin": TrackingCounts(30, 9, 1)}
    scores = score(Table(), CUPS + TINS, tracking=tracking)
    assert scores.per_object["cup"]["lost_fraction"] == 0.1
    assert (scores.pooled["lost_fraction"], scores.pooled["false_tracks"]) == (0.25, 4)
    assert scores.mean_of_objects["lost_fraction"] == pytest.approx(0.2)
    assert scores.mean_of_objects["false_tracks"] == 4
    assert scores.mean_of_objects["instances"] == 7


def test_the_protocol_has_what_scoring_decides_and_what_the_run_stated() -> None:
    scores = score(Table(), CUPS, protocol={"masks": "visib", "backend": "attributes", "missing_pose": "left out"})
    protocol = scores.protocol
    assert (protocol["masks"], protocol["backend"]) == ("visib", "attributes")
    assert (protocol["initialisation"], protocol["reinitialisation"], protocol["poses"]) == ("not stated",) * 3
    assert protocol["missing_pose"] == "infinite error"
    assert protocol["symmetric_objects"] == ["tin"]
    assert "VOCap" in str(protocol["integration"])
    assert {"averaging", "frames", "reference_frames", "model_frame", "dataset", "scenes"} <= set(protocol)


def test_a_result_file_scores_like_its_estimates(tmp_path: Path) -> None:
    write_results(tmp_path / "a.csv", CUPS + TINS)
    scores: Scores = score_results_file(Table(), tmp_path / "a.csv")
    assert scores.pooled == score(Table(), CUPS + TINS).pooled
    assert scores.protocol["results"] == str(tmp_path / "a.csv")
    with pytest.raises(OutputError, match=r"b\.csv: cannot be read"):
        score_results_file(Table(), tmp_path / "b.csv")


@pytest.mark.shared_data
def test_perfect_poses_of_the_recording_score_a_hundred(shared_data: Path) -> None:
    dataset = BopDataset(shared_data / "rbt")
    perfect = [Estimate(1, t.image_id, dataset.number(t.object_id), 1.0, t.T_cam_obj) for t in dataset.targets(1)]
    scores = score(dataset, perfect)
    assert scores.pooled["instances"] == len(perfect)
    assert rounded(scores.pooled, "add_auc", "adds_auc_2cm_exact", "add_recall_0.1d", "missing") == [100, 100, 100, 0]
