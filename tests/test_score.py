"""Estimates and targets -> scores: whole numbers that can be checked by hand."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from eval.bop_results import Estimate, write_results
from eval.datasets import MaskKind, ObjectModel, Target, open_dataset, require
from eval.datasets.bop import BopDataset
from eval.score import Scores, TrackingCounts, score, score_results_file
from tracker.errors import OutputError, SourceError
from tracker.frame import Frame
from tracker.geometry import Intrinsics, Pose
from tracker.sources import PosedSource, Sighting

KEYS = {
    *("add_auc", "adds_auc", "add_auc_exact", "adds_auc_exact"),
    *("add_auc_2cm", "adds_auc_2cm", "add_auc_2cm_exact", "adds_auc_2cm_exact"),
    *("over_1cm", "over_5cm", "add_recall_0.1d", "adds_recall_0.1d", "instances", "missing"),
    *("add_or_adds_auc", "add_or_adds_auc_exact", "add_or_adds_auc_2cm", "add_or_adds_auc_2cm_exact"),
    *("add_or_adds_recall_0.1d", "recall_5deg_2cm", "recall_10deg_5cm", "iou_mean", "iou_recall_50", "iou_recall_75"),
    *("ar_mssd", "ar_mspd"),
}
CAMERA = Intrinsics(500.0, 500.0, 320.0, 240.0, 640, 480)
IMAGES = {"cup": (0, 1, 2, 3, 4), "tin": (0, 1)}
NUMBERS = {"cup": 1, "tin": 2}


class Pictures:
    """A scene whose pictures are lost."""

    name = "memory:table:1"
    object_ids = ("cup", "tin")

    def __len__(self) -> int:
        return 5

    def __getitem__(self, index: int) -> Frame:
        raise SourceError(f"image {index}: there is no picture")

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def sightings(self, object_id: str) -> Sequence[Sighting]:
        raise NotImplementedError


class Still(Pictures):
    """One that tells its camera all the same."""

    def camera(self, index: int) -> Intrinsics:  # noqa: ARG002
        return CAMERA


class Table:
    """Scene 1 with the errors of metrics.md in mind: a cup in five images and a tin in two. Each is a single point, so
    that ADD and ADD-S are the distance of the origins."""

    name = "memory:table"
    target_rule = "all"
    model_frame = "its own"
    scene_ids = (1,)
    object_ids = ("cup", "tin")

    def scene(self, scene_id: int, masks: MaskKind = "visib") -> PosedSource:  # noqa: ARG002
        return Still()

    def image_ids(self, scene_id: int) -> Sequence[int]:  # noqa: ARG002
        return range(5)

    def targets(self, scene_id: int) -> list[Target]:
        require("scene", scene_id, self.scene_ids, self.name)
        return [Target(i, i, name, at(0), 100, 1.0) for name, images in IMAGES.items() for i in images]

    def model(self, object_id: str) -> ObjectModel:
        return ObjectModel(np.zeros((1, 3)), {"cup": 0.1, "tin": 0.2}[object_id], object_id == "tin")

    def number(self, object_id: str) -> int:
        return NUMBERS[object_id]

    def object_with(self, number: int) -> str:
        return {1: "cup", 2: "tin"}.get(number, f"object {number}")


class Pairs(Table):
    """The same, each object two points 40 mm apart that half a turn about z exchanges."""

    def __init__(self, declared: bool = True) -> None:
        self._declared = declared

    def model(self, object_id: str) -> ObjectModel:
        points_m = np.array([[-0.02, 0, 0], [0.02, 0, 0]])
        return ObjectModel(points_m, 0.1, object_id == "tin" if self._declared else None)


def at(x_mm: float) -> Pose:
    return Pose(np.eye(3), np.array([x_mm / 1000, 0, 1]))


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
    assert (row.mssd_m, row.mspd_px, row.symmetric_rotation_deg, row.iou) == (np.inf, np.inf, np.inf, 0)
    assert cup["ar_mspd"] == pytest.approx((1 + 1 + 0.9) / 5)  # 2, 4 and 6 pixels: half of the millimetres


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
    assert (protocol["symmetric_objects"], protocol["symmetric_objects_are"]) == (["tin"], "the dataset's")
    assert (protocol["mspd"], protocol["vsd"]) == ("measured", "not measured: --vsd asks for it")
    assert "VOCap" in str(protocol["integration"])
    assert {"averaging", "frames", "reference_frames", "model_frame", "dataset", "scenes"} <= set(protocol)


def test_average_recalls_and_recalls_of_poses() -> None:
    scores = score(Table(), [*CUPS, estimate("tin", 0, 12), estimate("tin", 1, 34)])
    cup, tin = scores.per_object["cup"], scores.per_object["tin"]
    # 4, 8, 12, 60, 130 of 100 mm: under 10, 9, 8, 0, 0 thresholds of ten; 12 and 34 of 200 mm: 9 and 7
    assert cup["ar_mssd"] == pytest.approx(2.7 / 5)
    assert tin["ar_mssd"] == pytest.approx(1.6 / 2)
    assert scores.pooled["ar_mssd"] == pytest.approx(4.3 / 7)
    # 2, 4, 6, 30 and 65 pixels of 5, 10 .. 50
    assert cup["ar_mspd"] == pytest.approx((1 + 1 + 0.9 + 0.4) / 5)
    assert rounded(cup, "recall_5deg_2cm", "recall_10deg_5cm") == [60, 60]
    assert rounded(cup, "iou_mean", "iou_recall_50") == [0, 0]  # a point has no volume


def test_add_or_adds_is_adds_of_the_symmetric_objects_whoever_names_them(caplog: pytest.LogCaptureFixture) -> None:
    dataset = Pairs()
    turned = [Estimate(1, i, 1, 1.0, Pose(np.diag([-1.0, -1, 1]), np.array([0.0, 0, 1]))) for i in IMAGES["cup"]]
    turned += [Estimate(1, i, 2, 1.0, e.T_cam_obj) for i, e in enumerate(turned[:2])]
    scores = score(dataset, turned)  # both points change places: ADD is 40 mm and ADD-S nothing
    assert rounded(scores.per_object["cup"], "add_or_adds_auc_exact", "add_or_adds_recall_0.1d") == [60, 0]
    assert rounded(scores.per_object["tin"], "add_or_adds_auc_exact", "add_or_adds_recall_0.1d") == [100, 100]
    assert [row.symmetric for row in scores.instances] == [False] * 5 + [True] * 2
    told = score(dataset, turned, symmetric=["cup", "lid"])
    assert rounded(told.per_object["cup"], "add_or_adds_auc_exact") == [100]
    assert rounded(told.per_object["tin"], "add_or_adds_auc_exact") == [60]
    assert (told.protocol["symmetric_objects"], told.protocol["symmetric_objects_are"]) == (["cup"], "the user's list")
    assert "lid" in caplog.text
    assert rounded(told.pooled, "add_auc_exact") == rounded(scores.pooled, "add_auc_exact")


def test_where_nobody_names_symmetric_objects_there_is_no_add_or_adds() -> None:
    scores = score(Pairs(declared=False), CUPS + TINS)
    assert not [name for name in scores.pooled if name.startswith("add_or_adds")]
    assert scores.protocol["symmetric_objects"] == "not declared"
    assert "add_or_adds_auc" in score(Pairs(declared=False), CUPS, symmetric=[]).pooled


def test_without_a_mesh_there_is_no_vsd_and_it_is_said() -> None:
    scores = score(Table(), CUPS + TINS, with_vsd=True)
    assert not {"ar", "ar_vsd"} & (set(scores.pooled) | set(scores.mean_of_objects) | set(scores.per_object["cup"]))
    assert scores.protocol["vsd"] == "not measured: no mesh, only points, of cup, tin"


def test_without_a_camera_there_is_no_mspd_and_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_camera(self: Still, index: int) -> Intrinsics:  # noqa: ARG001
        raise SourceError(f"image {index}: nothing is known of its camera")

    monkeypatch.setattr(Still, "camera", no_camera)
    scores = score(Table(), CUPS[:3] + TINS)
    assert "ar_mspd" not in scores.pooled
    assert "ar_mssd" in scores.pooled
    assert scores.protocol["mspd"] == "not measured: image 0: nothing is known of its camera"


def test_the_camera_of_a_source_that_does_not_tell_it_is_its_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Table, "scene", lambda *_: Pictures())
    assert score(Table(), CUPS).protocol["mspd"] == "not measured: image 0: there is no picture"


def test_the_truth_of_a_rendered_scene_scores_one_in_every_part(tmp_path: Path) -> None:
    dataset = open_dataset("synthetic:tabletop?frames=2&size=160x120&noise=0")
    perfect = [Estimate(1, t.image_id, dataset.number(t.object_id), 1.0, t.T_cam_obj) for t in dataset.targets(1)]
    write_results(tmp_path / "a.csv", perfect)
    scores = score_results_file(dataset, tmp_path / "a.csv", with_vsd=True)
    for values in (scores.pooled, scores.mean_of_objects, *scores.per_object.values()):
        assert [values[name] for name in ("ar", "ar_vsd", "ar_mssd", "ar_mspd")] == [1, 1, 1, 1]
        assert rounded(values, "recall_5deg_2cm", "iou_mean", "iou_recall_75", "add_or_adds_auc") == [100] * 4
    assert scores.protocol["vsd"] == "BOP19, delta 15 mm, distance images"
    some = score(dataset, perfect[1:], with_vsd=True)
    assert some.pooled["ar_vsd"] == pytest.approx(1 - 1 / len(perfect))
    assert some.instances[0].vsd == (np.inf,) * 10


def test_a_result_file_scores_like_its_estimates(tmp_path: Path) -> None:
    write_results(tmp_path / "a.csv", CUPS + TINS)
    scores: Scores = score_results_file(Table(), tmp_path / "a.csv")
    assert scores.pooled == score(Table(), CUPS + TINS).pooled
    assert scores.protocol["results"] == str(tmp_path / "a.csv")
    with pytest.raises(OutputError, match=r"b\.csv: cannot be read"):
        score_results_file(Table(), tmp_path / "b.csv")


@pytest.mark.parametrize(
    ("ids", "complaint"),
    [
        ("3,0,1", r"memory:table has no scene 3; it has 1"),
        ("1,9,1", r"scene 1 has no image 9; it has 5, 0 to 4"),
        ("1,0,7", r"no object 'object 7'; it has cup, tin"),
    ],
)
def test_what_a_result_file_speaks_of_has_to_be_there(tmp_path: Path, ids: str, complaint: str) -> None:
    write_results(tmp_path / "a.csv", CUPS + TINS)
    with (tmp_path / "a.csv").open("a") as file:
        file.write(f"{ids},1.0,1 0 0 0 1 0 0 0 1,0 0 1000,-1\n")
    with pytest.raises(OutputError, match=rf"a\.csv, line 9: .*{complaint}"):
        score_results_file(Table(), tmp_path / "a.csv")


def test_a_scene_without_targets_is_an_error_and_an_object_without_one_is_not(tmp_path: Path) -> None:
    write_results(tmp_path / "a.csv", [estimate("tin", 4, 10)])
    assert score_results_file(Table(), tmp_path / "a.csv").protocol["estimates_of_no_target"] == 1

    class Empty(Table):
        def targets(self, scene_id: int) -> list[Target]:  # noqa: ARG002
            return []

    with pytest.raises(OutputError, match=r"a\.csv, line 2: memory:table: scene 1 has no target \(all\)"):
        score_results_file(Empty(), tmp_path / "a.csv")


@pytest.mark.shared_data
def test_perfect_poses_of_the_recording_score_a_hundred(shared_data: Path) -> None:
    dataset = BopDataset(shared_data / "rbt")
    perfect = [Estimate(1, t.image_id, dataset.number(t.object_id), 1.0, t.T_cam_obj) for t in dataset.targets(1)]
    scores = score(dataset, perfect)
    assert scores.pooled["instances"] == len(perfect)
    assert rounded(scores.pooled, "add_auc", "adds_auc_2cm_exact", "add_recall_0.1d", "missing") == [100, 100, 100, 0]


def test_an_object_of_which_a_file_says_nothing_at_all_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_results(tmp_path / "a.csv", [estimate("tin", 1, 10)])
    score_results_file(Table(), tmp_path / "a.csv")
    (warning,) = caplog.messages
    assert all(words in warning for words in ("no row of object cup", "--objects tin"))
    caplog.clear()
    score_results_file(Table(), tmp_path / "a.csv", object_ids=["tin"])
    assert caplog.messages == []
