"""The benchmarks run, small, and say what they are to say; no test looks at a clock."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eval.bench.filter import FilterBench
from eval.bench.followed import Followed, jumps, lag, steadiness
from eval.bench.methods import THRESHOLD_M, open3d_fgr, open3d_ransac, ours, peers
from eval.bench.problems import problem
from eval.bench.registration import RegistrationBench
from eval.bench.saliency import SaliencyBench
from eval.bench.scored_models import OBJECTS, model, poses
from eval.bench.scoring import ScoringBench
from eval.bench.soak import SoakBench
from eval.symmetric_errors import mssd
from tests.tiny_networks import save_siglip
from tracker.declared_symmetry import parse_symmetry
from tracker.errors import ConfigError, OutputError
from tracker.geometry import Pose
from tracker.symmetry import NO_SYMMETRY, about


def test_a_problem_s_right_pairs_meet_at_its_pose() -> None:
    given = problem(0, 2000, 0.7)
    apart = ((given.T_cam_obj @ given.points_obj - given.points_cam) ** 2).sum(axis=1) ** 0.5
    assert (apart < THRESHOLD_M).mean() == pytest.approx(0.3, abs=0.05)
    assert given.errors(given.T_cam_obj) == pytest.approx((0, 0), abs=1e-6)
    assert given.errors(None) == (float("inf"), float("inf"))
    assert given.errors(Pose.identity())[1] > 0.5


@pytest.mark.parametrize("seed", range(3))
def test_every_method_solves_an_easy_problem(seed: int) -> None:
    given = problem(seed, 800, 0.3)
    for method in (ours(0.999), ours(1.0, 5000), open3d_ransac(0.999), open3d_fgr(), *peers().values()):
        degrees, metres = given.errors(method(given, seed))
        assert degrees < 5
        assert metres < 0.01


def test_the_registration_bench_says_everything_that_it_is_asked_for(tmp_path: Path) -> None:
    bench = RegistrationBench(correspondences=300, seeds=2, open3d_seeds=1, json=tmp_path / "deep" / "figures.json")
    bench()
    figures = json.loads((tmp_path / "deep" / "figures.json").read_text())
    assert figures["success"]["0.9"] == 1
    assert set(figures["success"]) == {"0.9", "0.95", "0.98"}
    assert figures["speedup_over_open3d_ransac"] > 0
    assert figures["global_pose"]["degrees"] < 2
    assert figures["global_pose"]["mm"] < 2
    assert figures["refinement"]["degrees"] < 0.5
    assert figures["global_pose_ms"] > 0
    assert figures["refinement_ms"] > 0
    assert set(figures["early_stop"]) == {"0.5", "0.9", "0.95"}
    assert figures["environment"]["torch"]
    with pytest.raises(OutputError, match=r"figures\.json exists"):
        bench()


def test_the_scoring_bench_says_everything_that_it_is_asked_for(tmp_path: Path) -> None:
    ScoringBench(instances=21, vertices=200, json=tmp_path / "figures.json")()
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["seconds_for_10000"] > 0
    assert set(figures["parts"]) == {"add", "adds", "mssd", "mspd", "iou"}
    assert figures["settings"] == {"instances": 21, "objects": 21, "vertices": 200}
    with pytest.raises(OutputError, match=r"figures\.json exists"):
        ScoringBench(json=tmp_path / "figures.json")()


def test_the_filter_bench_says_everything_that_it_is_asked_for(tmp_path: Path) -> None:
    FilterBench(frames=30, size="240x180", json=tmp_path / "figures.json")()
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert {"still", "moving", "bowl", "soup_can", "settings"} <= set(figures)
    assert 0 < figures["still"]["jitter_mm_smoothed"] < figures["still"]["jitter_mm_filtered"] < 2
    assert "lag_mm" in figures["moving"]
    assert figures["bowl"]["jump_degrees_reported"] < 10
    with pytest.raises(OutputError, match=r"figures\.json exists"):
        FilterBench(json=tmp_path / "figures.json")()


def test_lag_bias_jitter_and_jumps_are_what_their_names_say() -> None:
    """An object at 0.3 m/s, told a hundredth of a second late, 2 mm aside in every other frame, and turned once."""
    times_s = np.arange(40) / 30
    truth = [Pose(np.eye(3), np.array([0.3 * t, 0, 1])) for t in times_s]
    raw = [Pose(np.eye(3), p.translation_m - np.array([0.003, 0, 0])) for p in truth]
    turned = about(np.array([0, 0, 1.0]), np.radians(25))
    filtered = [
        Pose(turned if k == 20 else np.eye(3), p.translation_m + np.array([0, 0.002 * (k % 2), 0]))
        for k, p in enumerate(raw)
    ]
    covariances = np.tile(np.eye(6), (40, 1, 1))
    followed = Followed(truth, raw, filtered, raw, covariances, times_s, NO_SYMMETRY, 0)
    assert lag(followed)["lag_mm"] == pytest.approx(3)
    assert lag(followed)["speed_mps_of_lag"] == pytest.approx(0.3)
    steady = steadiness(followed)
    assert steady["bias_mm"] == pytest.approx(1)
    assert (steady["jitter_mm_raw"], steady["jitter_mm_filtered"]) == pytest.approx((0, 2))
    assert jumps(followed) == pytest.approx({"jump_degrees_reported": 25, "jump_degrees_alike": 25})
    free = replace(followed, symmetry=parse_symmetry("z:inf"))
    assert jumps(free) == pytest.approx({"jump_degrees_reported": 25, "jump_degrees_alike": 0}, abs=1e-3)


def test_scored_models_have_the_symmetries_that_they_declare_and_estimates_near_to_them() -> None:
    counts = [len(model(number, 50).symmetries.motions()) for number in range(1, OBJECTS + 1)]
    assert {count: counts.count(count) for count in set(counts)} == {1: 13, 4: 3, 315: 3, 630: 2}
    can = model(2, 300)
    assert len(can.points_m) == 300
    estimated, truth = poses(2, can.symmetries, 50)
    errors_m = mssd(can.points_m, can.symmetries.motions(), estimated, truth)
    assert 0.003 < np.median(errors_m) < 0.03
    assert [p.matrix.tolist() for p in poses(2, can.symmetries, 50)[0]] == [p.matrix.tolist() for p in estimated]


def test_the_saliency_bench_says_everything_that_it_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    weights = str(save_siglip(tmp_path / "weights"))
    SaliencyBench(weights=weights, labels=4, repeat=1, device="cpu", json=tmp_path / "figures.json")()
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert {"ratio_to_forward", "speedup_over_loop", "speedup_over_grad_cam", "parameters_mb"} <= set(figures)
    assert figures["speedup_over_loop"] > 0
    assert figures["speedup_over_grad_cam"] is None
    assert figures["weights"] == weights


def test_the_soak_bench_follows_all_objects_and_says_what_became_of_memory_and_speed(tmp_path: Path) -> None:
    bench = SoakBench(frames=12, objects=2, settled=4, size="320x240", json=tmp_path / "figures.json")
    bench()
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["tracked"] == 1
    assert len(figures["settings"]["objects"]) == 2
    assert figures["slowdown"] > 0
    assert figures["growth"] >= 0
    assert all(megabytes > 0 for megabytes in figures["resident_mb"])
    with pytest.raises(ConfigError, match="--frames"):
        SoakBench(frames=5, settled=4)()
