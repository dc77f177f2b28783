"""Fitting the confidence: on data whose chances are known, and on a scene small enough for a test."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eval.calibration.collect import collect, mistaken, pose_is_right
from eval.calibration.cross_validation import held_out_chances, judge
from eval.calibration.logistic import chances, fit
from eval.calibration.report import pasted
from eval.calibration.rows import JudgedPose, TrainingSet, read_poses, training_set, write_poses
from eval.calibration.runs import CalibrationRun, calibration_runs
from eval.datasets.synthetic import TURNS_ABOUT_Z
from eval.symmetries import ASYMMETRIC
from tracker.confidence import Grounds
from tracker.errors import ConfigError
from tracker.geometry import Pose
from tracker.sources import Sighting
from tracker.sources.synthetic.things.objects import OBJECTS
from tracker.verification import Evidence

TRUE = np.array([1.5, -0.8, 0.4])  # the last is of the constant
EVIDENCE = Evidence(0.6, 0.8, 0.7, 0.05, 0.0, 0.1, 0.0, 0.9, 0.5)
POSE = JudgedPose("away", "away 1", "mug", 3, True, Grounds(EVIDENCE, 0.05, 0.02))


def simulated(count: int = 20_000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Measures, whether right with the chances that TRUE gives, and equal weights."""
    rng = np.random.default_rng(5)
    measures = np.column_stack((rng.normal(1, 1, count), rng.normal(-2, 2, count), np.ones(count)))
    return measures, rng.random(count) < chances(measures, TRUE), np.ones(count)


def test_known_weights_are_recovered() -> None:
    assert fit(*simulated(), penalty=0.0) == pytest.approx(TRUE, abs=0.1)


def test_the_mean_chance_is_the_share_that_is_right_as_the_constant_is_free() -> None:
    measures, right, weights = simulated(500)
    weights = np.where(right, 3.0, 1.0)
    found = chances(measures, fit(measures, right, weights, penalty=1.0))
    assert np.average(found, weights=weights) == pytest.approx(np.average(right, weights=weights), abs=1e-5)


def test_units_of_a_measure_change_no_chance() -> None:
    measures, right, weights = simulated(2000)
    units = np.array([1000.0, 0.01, 1.0])
    weights_of_both = fit(measures, right, weights), fit(measures * units, right, weights)
    assert weights_of_both[1] * units == pytest.approx(weights_of_both[0], rel=1e-3)


def test_a_row_of_weight_two_is_two_rows() -> None:
    measures, right, weights = simulated(300)
    weights[:100] = 2
    again = np.r_[0:300, 0:100]
    assert fit(measures[again], right[again], np.ones(400)) == pytest.approx(fit(measures, right, weights), rel=1e-4)


def test_measures_that_part_all_rows_and_measures_that_say_nothing_have_finite_weights() -> None:
    measures = np.column_stack((np.linspace(-1, 1, 50), np.zeros(50), np.ones(50)))
    found = fit(measures, measures[:, 0] > 0, np.ones(50))
    assert np.isfinite(found).all()
    assert 0 < found[0] < 100
    assert found[1] == 0


def test_what_is_all_right_or_all_wrong_is_refused() -> None:
    measures, right, weights = simulated(10)
    for same, words in ((np.ones_like(right), "all"), (np.zeros_like(right), "none")):
        with pytest.raises(ConfigError, match=f"of 10 poses {words} are right"):
            fit(measures, same, weights)


def test_an_object_in_a_run_has_the_weight_of_any_other() -> None:
    other = replace(POSE, object_id="bowl", right=False)
    found = training_set([POSE, replace(POSE, index=4), other])
    assert found.weights.tolist() == [0.5, 0.5, 1.0]
    assert found.right.tolist() == [True, True, False]
    assert (found.measures == POSE.grounds.measures()).all()
    with pytest.raises(ConfigError, match="no pose"):
        training_set([])


def test_a_kind_of_scene_is_judged_by_fits_to_the_others() -> None:
    measures, right, weights = simulated(3000)
    scenes = np.repeat(["a", "b", "c"], 1000)
    right[scenes == "c"] ^= True  # where all is the other way round, which only c's own rows can tell
    rows = TrainingSet(measures, right, weights, scenes, np.repeat("mug", 3000))
    found = held_out_chances(rows, rows.scenes)
    judged = judge("c", found[scenes == "c"], right[scenes == "c"])
    assert (judged.poses, judged.wrong) == (1000, int((~right[scenes == "c"]).sum()))
    assert judged.auroc is not None
    assert judged.auroc < 0.3
    assert judged.reliability.calibration_error > 0.3
    with pytest.raises(ConfigError, match="two scenes or objects"):
        held_out_chances(rows, rows.object_ids)


def test_poses_are_read_as_they_were_written_and_anything_else_is_refused(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    poses = [POSE, replace(POSE, right=False, grounds=Grounds(EVIDENCE, 0.2))]
    path = tmp_path / "poses.json"
    write_poses(path, {"runs": ["away 1"]}, poses)
    assert read_poses(path) == poses
    assert not caplog.records
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"code": "of last week"}))
    assert read_poses(path) == poses
    assert "other source code" in caplog.text
    del content["poses"][1]["grounds"]["evidence"]["colour"]
    for text, words in (
        (json.dumps(content), r"poses\.1\.grounds\.evidence\.colour"),
        ("{}", "poses"),
        ("[1]", "--json"),
        ("no", "--json"),
    ):
        path.write_text(text)
        with pytest.raises(ConfigError, match=words):
            read_poses(path)
    with pytest.raises(ConfigError, match="cannot be read"):
        read_poses(tmp_path / "absent.json")


def test_runs_differ_in_seed_and_none_is_of_a_seed_that_scenarios_are_judged_by() -> None:
    runs = calibration_runs(1000, 4, "320x240")
    assert len({run.seed for run in runs}) == len({run.name for run in runs}) == len(runs)
    assert min(run.seed for run in runs) == 1000
    assert {run.config.masks for run in runs} == {"given", "carried"}
    assert any(not run.config.prior for run in runs)
    assert all(run.config.believe < 0.1 for run in runs)


def test_poses_of_a_run_are_judged_by_the_truth() -> None:
    poses = collect(CalibrationRun("away", 1, "160x120", 2, every=4))
    assert {(pose.scene, pose.object_id) for pose in poses} == {("away", "tea_box")}
    assert {pose.index % 4 for pose in poses} == {0}
    assert any(pose.right for pose in poses)


def test_an_object_is_looked_for_in_the_place_of_another_too_and_where_it_is_not() -> None:
    runs = calibration_runs(1000, 1, "320x240")
    strange = [run for run in runs if run.stranger]
    assert {run.stranger for run in strange} == set(OBJECTS)
    assert all(run.stranger != run.object_id and run.config.sure < 0.1 for run in strange)
    assert [run.config.masks for run in runs if run.masks == "mistaken"] == ["given"] * 4
    masks = {name: np.full((2, 2), k % 2 > 0) for k, name in enumerate(("bowl", "mug", "clamp"))}
    other = mistaken(masks)
    assert list(other) == list(masks)
    assert all((other[a] is masks[b]) for a, b in (("bowl", "mug"), ("mug", "clamp"), ("clamp", "bowl")))


def test_nothing_that_is_found_of_an_object_that_is_not_there_is_right() -> None:
    poses = collect(CalibrationRun("leave", 3, "160x120", 2, every=6, object_id="cereal_box", stranger="tea_box"))
    assert any(pose.right for pose in poses if pose.object_id == "cereal_box")
    assert not any(pose.right for pose in poses if pose.object_id == "tea_box")


def test_right_is_near_and_in_sight() -> None:
    truth = Pose.from_matrix(np.diag([1.0, -1.0, -1.0, 1.0]))
    seen = Sighting(0, truth, 500, 0.5)
    turned = truth @ Pose.exp(np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0]))
    assert pose_is_right(truth, seen, ASYMMETRIC)
    assert not pose_is_right(turned, seen, ASYMMETRIC)
    assert pose_is_right(turned, seen, TURNS_ABOUT_Z)
    assert not pose_is_right(truth, replace(seen, visible_fraction=0.04), ASYMMETRIC)


def test_weights_are_printed_as_they_stand_in_the_code() -> None:
    names: dict[str, object] = {"np": np}
    exec(pasted(("colour", "constant"), np.array([1.234, -5.0])), names)  # noqa: S102 - that it runs is what is tested
    assert names["MEASURES"] == ("colour", "constant")
    assert names["WEIGHTS"] == pytest.approx(np.array([1.23, -5.0]))
