"""Scenes of a run, spread over processes and kept as they finish: the same results wherever and whenever."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import eval.__main__
import eval.track_run
import eval.units
from eval.bop_results import Estimate, read_results
from eval.kept_units import ESTIMATES, UNIT, KeptUnits
from eval.spread import Spreading, spread
from eval.track_run import TrackRun, fingerprint_of, opened_backend
from eval.tracked import Tracked
from eval.units import Unit, track_units, units_of
from reference.vocabulary import Vocabulary, VocabularySet
from tests.tiny_bop import write_bop
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, MissingExtraError, TrackerError

SCENES = {
    2: "turn?size=160x120&frames=4&object=tea_box",
    5: "turn?size=160x120&frames=4&object=cereal_box",
    7: "turn?size=160x120&frames=4&object=tea_box&seed=3",
}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_bop(tmp_path_factory.mktemp("tiny") / "bop", SCENES)


@pytest.fixture(scope="module")
def units(dataset: str) -> list[Unit]:
    return units_of(TrackRun(dataset), tuple(SCENES))[0]


@pytest.fixture(scope="module")
def alone(units: list[Unit]) -> list[Tracked]:
    """In this process, one after the other."""
    return whole(track_units(units))


def whole(outcomes: Sequence[Tracked | TrackerError]) -> list[Tracked]:
    return [outcome for outcome in outcomes if isinstance(outcome, Tracked)]


def assert_same(found: Sequence[Tracked], expected: Sequence[Tracked]) -> None:
    """In all but the times, to the last bit."""
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert (a.counts, a.reference_frames, a.refused) == (b.counts, b.reference_frames, b.refused)
        assert [timings.keys() for timings in a.timings_ms] == [timings.keys() for timings in b.timings_ms]
        for one, other in zip(a.estimates, b.estimates, strict=True):
            assert (one.scene_id, one.image_id, one.object_id) == (other.scene_id, other.image_id, other.object_id)
            assert one.score == other.score
            assert np.array_equal(one.T_cam_obj.matrix, other.T_cam_obj.matrix)


def test_two_processes_say_what_one_says_in_the_same_order(units: list[Unit], alone: list[Tracked]) -> None:
    assert [{e.scene_id for e in tracked.estimates} for tracked in alone] == [{2}, {5}, {7}]
    told: list[tuple[int, str]] = []

    def shown(finished: Iterable, total: int, what: str) -> Iterable:
        told.append((total, what))
        return finished

    assert_same(whole(track_units(units, spreading=Spreading(2), units_shown=shown)), alone)
    assert told == [(3, "scenes")]


def test_a_dask_cluster_says_what_one_process_says(units: list[Unit], alone: list[Tracked]) -> None:
    distributed = pytest.importorskip("dask.distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address.replace("tcp://", "dask://")
        assert_same(whole(track_units(units, spreading=Spreading(cluster=address))), alone)


def test_what_is_kept_comes_back_as_it_was_and_is_not_tracked_again(
    units: list[Unit], alone: list[Tracked], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = KeptUnits(tmp_path / "units")
    for unit, tracked in zip(units, alone, strict=True):
        kept.keep(unit.decided_by, tracked)
    assert sorted(unit.fingerprint for unit in units) == kept.names()
    monkeypatch.setattr(eval.units, "track_scene", forbidden)
    again = whole(track_units(units, kept))
    assert_same(again, alone)
    for a, b in zip(again, alone, strict=True):
        assert a.timings_ms == b.timings_ms
        assert [e.time_s for e in a.estimates] == [e.time_s for e in b.estimates]


def forbidden(*_: object) -> Tracked:
    raise AssertionError("a finished scene is tracked again")


def cut_the_estimates(folder: Path) -> None:
    path = folder / ESTIMATES
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))


@pytest.mark.parametrize(
    "damage",
    [
        cut_the_estimates,
        lambda folder: (folder / ESTIMATES).unlink(),
        lambda folder: (folder / UNIT).write_text((folder / UNIT).read_text()[:-20]),
        lambda folder: (folder / UNIT).write_text((folder / UNIT).read_text().replace('"views": 2', '"views": 3')),
    ],
)
def test_what_is_damaged_is_not_used(
    damage: Callable[[Path], object], units: list[Unit], alone: list[Tracked], tmp_path: Path
) -> None:
    kept = KeptUnits(tmp_path / "units")
    kept.keep(units[0].decided_by, alone[0])
    damage(tmp_path / "units" / units[0].fingerprint)
    assert kept.read(units[0].fingerprint) is None
    kept.keep(units[0].decided_by, alone[0])
    assert kept.read(units[0].fingerprint) is not None


def test_a_unit_that_fails_stops_the_run_or_stands_in_its_place_and_the_others_are_kept(
    dataset: str, tmp_path: Path
) -> None:
    nonsense = VocabularySet("nonsense", (Vocabulary("thing", ("qwertz",)),))
    good, _ = units_of(TrackRun(dataset), [2])
    bad, _ = units_of(TrackRun(dataset, vocabularies=nonsense), [2])
    kept = KeptUnits(tmp_path / "units")
    tracked, error = track_units([*good, *bad], kept, stop=False)
    assert isinstance(tracked, Tracked)
    assert isinstance(error, ConfigError)
    assert "qwertz" in str(error)
    assert kept.names() == [good[0].fingerprint]
    for spreading in (Spreading(), Spreading(2)):
        with pytest.raises(ConfigError, match="qwertz"):
            track_units(bad, KeptUnits(tmp_path / "none"), spreading)
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    "change",
    [
        {"views": 1}, {"poses": "raw"}, {"initialisation": "gt"}, {"concepts": 5}, {"object_ids": ("1",)},
        {"threads": 2}, {"config": TrackerConfig(seed=7)}, {"backend": "attributes+clip"},
        {"dataset": "bop:elsewhere"}, {"masks": "full"}, {"unposed": True},
        {"vocabularies": VocabularySet("mine", (Vocabulary("thing", ("red",)),))}, {"method": "sift"},
    ],
)  # fmt: skip
def test_everything_that_decides_a_result_is_in_its_name(change: dict) -> None:
    run, backend = TrackRun("bop:here"), opened_backend("attributes", eval.track_run.BackendOptions())
    before = fingerprint_of(run.decided_by(1, backend))
    assert fingerprint_of(replace(run, **change).decided_by(1, backend)) != before
    assert fingerprint_of(run.decided_by(2, backend)) != before
    assert fingerprint_of(TrackRun("bop:here").decided_by(1, backend)) == before
    # the name of a vocabulary decides nothing, its labels do
    assert fingerprint_of(replace(run, vocabulary="a name").decided_by(1, backend)) == before


def test_other_source_code_gives_other_names(monkeypatch: pytest.MonkeyPatch) -> None:
    run, backend = TrackRun("bop:here"), opened_backend("attributes", eval.track_run.BackendOptions())
    before = fingerprint_of(run.decided_by(1, backend))
    eval.track_run.code_fingerprint.cache_clear()
    monkeypatch.setattr(eval.track_run, "DECIDE", eval.track_run.DECIDE[:-1])
    assert fingerprint_of(run.decided_by(1, backend)) != before
    eval.track_run.code_fingerprint.cache_clear()


def test_a_process_with_other_source_code_tracks_nothing(units: list[Unit]) -> None:
    with pytest.raises(ConfigError, match="other source code"):
        track_units([replace(units[0], code="another")])


@pytest.mark.parametrize(
    ("jobs", "cluster", "words"),
    [
        (0, None, "--jobs"),
        (-2, None, "--jobs"),
        (1, "dask", "dask://HOST:PORT"),
        (1, "dask://", "dask://HOST:PORT"),
        (1, "slurm://host:1", "dask://HOST:PORT or ray://HOST:PORT"),
    ],
)
def test_where_work_cannot_be_done_is_refused(jobs: int, cluster: str | None, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Spreading(jobs, cluster)


@pytest.mark.parametrize(
    ("cluster", "package", "extra"),
    [("dask://localhost:1", "dask.distributed", "cluster"), ("ray://auto", "ray", "ray")],
)
def test_a_cluster_whose_package_is_missing_names_the_extra(
    cluster: str, package: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=rf"conceptrack\[{extra}\]"):
        list(spread(abs, [1], Spreading(cluster=cluster)))


# The command line


@pytest.fixture
def track(dataset: str, program: Callable[..., tuple[int, str]]) -> Callable[..., tuple[int, str]]:
    """`python -m eval track` in this process: its exit code and what it says."""
    return lambda *options: program(eval.__main__.main, "track", "--dataset", dataset, *options)


def poses(folder: Path) -> list[tuple]:
    return [pose_of(e) for e in read_results(folder / "results.csv")]


def pose_of(e: Estimate) -> tuple:
    return e.scene_id, e.image_id, e.score, e.T_cam_obj.matrix.tolist()


def test_a_run_that_was_killed_goes_on_to_the_same_scores(
    dataset: str, alone: list[Tracked], track: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    out, kept = tmp_path / "out", KeptUnits(tmp_path / "out.units")
    line = [sys.executable, "-m", "eval", "track", "--dataset", dataset, "--out", str(out)]
    running = subprocess.Popen(line, stderr=subprocess.DEVNULL)  # noqa: S603
    while running.poll() is None and not kept.names():
        time.sleep(0.002)
    running.send_signal(signal.SIGKILL)
    assert running.wait() == -signal.SIGKILL, "it ended before it could be killed"
    finished = kept.names()
    assert 1 <= len(finished) < len(SCENES)
    assert not out.exists()

    code, said = track("--out", out)
    assert code == 1
    assert all(word in said for word in ("out.units", "--resume", "--overwrite"))
    assert kept.names() == finished

    code, said = track("--out", out, "--resume")
    assert code == 0
    assert f"{len(finished)} of 3 scenes are finished already" in said
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    whole_run = tmp_path / "undisturbed"
    assert track("--out", whole_run)[0] == 0
    assert poses(out) == poses(whole_run)
    assert poses(out) == [pose_of(e) for each in alone for e in each.estimates]
    scores = [json.loads((folder / "scores.json").read_text()) for folder in (out, whole_run)]
    for part in ("metrics", "protocol"):
        assert scores[0][part] == scores[1][part]


def test_scenes_of_another_run_are_not_used_and_can_be_forgotten(
    units: list[Unit], alone: list[Tracked], track: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    kept = KeptUnits(tmp_path / "out.units")
    kept.keep(units[0].decided_by, alone[0])
    code, said = track("--out", tmp_path / "out", "--scenes", 2, "--views", 1, "--resume")
    assert code == 0
    assert "0 of 1 scenes are finished already" in said
    assert "1 more were tracked in another way" in said
    kept.keep(units[0].decided_by, alone[0])
    assert track("--out", tmp_path / "out", "--scenes", 2, "--overwrite")[0] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--resume",), "--out DIR"),
        (("--jobs", "0"), "--jobs"),
        (("--threads", "0"), "--threads"),
        (("--concepts", "0"), "--concepts"),
        (("--cluster", "yarn://here"), "dask://HOST:PORT"),
        (("--cluster", "dask://here:1", "--out", "out", "--view", "overlay"), "--cluster"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(
    options: tuple[str, ...], words: str, track: Callable[..., tuple[int, str]], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    code, said = track(*options)
    assert code == 1
    assert words in said
    assert list(tmp_path.iterdir()) == []


def test_each_scene_has_its_video_when_they_are_drawn_side_by_side(
    track: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    options = ("--scenes", 2, 5, "--view", "overlay", "--view", "frames", "--jobs", 2)
    assert track("--out", tmp_path / "out", *options)[0] == 0
    assert {path.name for path in (tmp_path / "out").glob("*.mp4")} == {"overlay_000002.mp4", "overlay_000005.mp4"}
    assert all((tmp_path / "out" / f"frames_{scene:06d}" / "000000.png").is_file() for scene in (2, 5))
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
