"""The three programs as they are called: what they write, what they refuse, and in which words."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

import eval.__main__
import eval.scenarios.run
import reference.__main__
import tracker.__main__
import tracker.sources
from eval.bop_results import read_results
from eval.calibration.rows import JudgedPose, write_poses
from eval.scenarios.frame_log import FrameLog
from eval.scenarios.run import RunLog, ScenarioRun
from tracker.concept import ConceptModel
from tracker.confidence import Grounds
from tracker.config import TrackerConfig, read_config
from tracker.declared_symmetry import parse_symmetry
from tracker.errors import SourceError
from tracker.frame import Frame
from tracker.sources.synthetic import open_scene
from tracker.verification import Evidence
from tracker.view import bounding_box

BOX = "tea_box"
SCENE = f"turn?size=160x120&frames=6&object={BOX}"
SOURCE = f"synthetic:{SCENE}"
PROGRAMS = {"reference": reference.__main__.main, "tracker": tracker.__main__.main, "eval": eval.__main__.main}


@dataclass(frozen=True)
class Said:
    code: int
    out: str
    err: str


Run = Callable[..., Said]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """A program's own `main` with the arguments of a command line."""

    def call(program: str, *arguments: object) -> Said:
        capsys.readouterr()
        monkeypatch.setattr(sys, "argv", [program, *map(str, arguments)])
        try:
            PROGRAMS[program]()
            code = 0
        except SystemExit as ending:
            code = int(ending.code or 0)
        told = capsys.readouterr()
        return Said(code, str(told.out), str(told.err))

    return call


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made by the command line itself, in a process of its own."""
    path = tmp_path_factory.mktemp("models") / "box.concept"
    told = process("reference", SOURCE, "--object", BOX, "--views", 2, "--out", path)
    assert (told.code, told.out) == (0, ""), told.err
    return path


def process(program: str, *arguments: object) -> Said:
    """`python -m PROGRAM ...`, as a user calls it."""
    line = [sys.executable, "-m", program, *map(str, arguments)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)  # noqa: S603
    return Said(done.returncode, done.stdout, done.stderr)


def assert_refused(said: Said, *words: str) -> None:
    """One sentence on the standard error, exit code 1, and nothing that looks like a crash."""
    assert said.code == 1, said
    assert said.out == ""
    assert "Traceback" not in said.err
    assert said.err.startswith("error: ")
    assert len(said.err.strip().splitlines()) == 1
    for word in words:
        assert word in said.err


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture
def filled(tmp_path: Path) -> Path:
    """A folder with somebody's results."""
    folder = tmp_path / "filled"
    folder.mkdir()
    (folder / "precious.txt").write_text("of last week")
    return folder


# The command lines themselves


@pytest.mark.parametrize(
    ("program", "expected"),
    [
        ("reference", ("--object", "--views", "--backend", "--out", "--overwrite")),
        ("tracker", ("--model", "--out", "--view", "--json", "--prior", "--masks")),
        ("eval", ("track", "score")),
    ],
)
def test_help_lists_the_options_and_ends_well(program: str, expected: tuple[str, ...]) -> None:
    told = process(program, "--help")
    assert told.code == 0
    assert f"python -m {program}" in told.out
    assert all(word in told.out for word in expected)
    assert told.err == ""


def test_an_error_is_a_sentence_and_not_a_traceback(tmp_path: Path) -> None:
    told = process("tracker", SOURCE, "--model", tmp_path / "absent.concept")
    assert_refused(told, "absent.concept", "no such model file")


def test_the_whole_way_from_a_source_to_json_lines(model: Path, tmp_path: Path) -> None:
    told = process("tracker", SOURCE, "--model", model, "--json", "--out", tmp_path / "out")
    assert told.code == 0, told.err
    assert told.err == ""
    assert told.out == (tmp_path / "out" / "poses.jsonl").read_text()
    truth = open_scene(SCENE).sightings(BOX)
    lines = [json.loads(line) for line in told.out.splitlines()]
    assert [line["frame"] for line in lines] == list(range(6))
    for line, sighting in zip(lines, truth, strict=True):
        assert (line["object"], line["state"]) == (BOX, "tracking")
        assert line["T_cam_obj"]["translation_m"] == pytest.approx(sighting.T_cam_obj.translation_m, abs=0.003)
        sign = 1 if sighting.T_cam_obj.quaternion_wxyz @ line["T_cam_obj"]["quaternion_wxyz"] > 0 else -1
        wxyz = [sign * q for q in line["T_cam_obj"]["quaternion_wxyz"]]
        assert wxyz == pytest.approx(sighting.T_cam_obj.quaternion_wxyz, abs=0.03)
        assert len(line["covariance"]) == 6
        assert line["timings_ms"]["total"] > 0
        assert 0.25 < line["confidence"] <= 1


@pytest.mark.parametrize("program", PROGRAMS)
def test_an_option_that_does_not_exist_is_a_mistake_of_the_command_line(program: str, run: Run) -> None:
    said = run(program, "--colour", "red")
    assert said.code == 2
    assert "Traceback" not in said.err


def test_eval_wants_to_know_what_to_do(run: Run) -> None:
    assert run("eval").code == 2


# python -m reference


def test_reference_writes_a_model_and_says_what_it_is_worth(model: Path, tmp_path: Path) -> None:
    made = ConceptModel.load(model)
    assert (made.object_id, made.backend) == (BOX, "attributes")
    again = process("reference", SOURCE, "--object", BOX, "--views", 2, "--out", tmp_path / "new" / "box.concept")
    assert (again.code, again.out) == (0, "")
    for word in (BOX, "attributes", f"{len(made)}", f"{made.diameter_m * 1000:.0f} mm"):
        assert word in again.err
    assert (tmp_path / "new" / "box.concept").read_bytes() == model.read_bytes()


@pytest.mark.parametrize(
    ("declared", "told"), [("z:inf", "any turn about"), ("x:180,y:180", "4 turns"), ("none", "none")]
)
def test_reference_takes_a_declared_symmetry_and_shows_it(declared: str, told: str, run: Run, tmp_path: Path) -> None:
    path = tmp_path / "a.concept"
    said = run("reference", SOURCE, "--object", BOX, "--views", 2, "--out", path, "--symmetry", declared)
    assert said.code == 0
    assert told in next(line for line in said.err.splitlines() if "symmetry" in line)
    assert ConceptModel.load(path).symmetry.packed() == parse_symmetry(declared).packed()


def test_reference_needs_no_poses_and_says_what_it_did_without(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "a.concept"
    said = run("reference", SOURCE, "--object", BOX, "--views", 2, "--out", path, "--unposed")
    assert said.code == 0, said.err
    assert "left out" in said.err
    assert "centre of what the first reference frame shows" in " ".join(said.err.split())
    made = ConceptModel.load(path)
    assert made.notes["left_out"] == []
    assert len(made.references) == 2
    assert (made.references[0].T_cam_obj.rotation == np.eye(3)).all()


def test_reference_overwrites_only_when_it_is_told_to(model: Path, run: Run, tmp_path: Path) -> None:
    path = tmp_path / "box.concept"
    path.write_text("precious")
    line = ("reference", SOURCE, "--object", BOX, "--views", 2, "--out", path)
    assert_refused(run(*line), "box.concept exists already", "--overwrite")
    assert path.read_text() == "precious"
    assert process(*line, "--overwrite").code == 0
    assert path.read_bytes() == model.read_bytes()


@pytest.mark.parametrize(
    ("source", "options", "words"),
    [
        (SOURCE, ("--object", "spoon"), ("'spoon'", BOX)),
        (SOURCE, ("--object", BOX, "--backend", "tea"), ("'tea'", "attributes")),
        (SOURCE, ("--object", BOX, "--views", "0"), ("--views", "0")),
        (SOURCE, ("--object", BOX, "--symmetry", "round"), ("'round'", "AXIS:ANGLE", "x:180,y:180")),
        (SOURCE, ("--object", BOX, "--symmetry", "z:inf", "--unposed"), ("z:inf", "auto or none")),
        (SOURCE, ("--object", BOX, "--least-confidence", "98", "--unposed"), ("--least-confidence", "98")),
        (SOURCE, ("--object", "spoon", "--unposed"), ("'spoon'", BOX)),
        ("synthetic:kitchen", ("--object", BOX), ("'kitchen'", "tabletop", "leave")),
        ("webcam:0", ("--object", BOX), ("webcam:0", "bop", "folder", "synthetic")),
        ("synthetic:turn?size=64x64&object=mug&frames=2", ("--object", "mug"), ("none of 2 frames", "pixels")),
    ],
)
def test_reference_refuses_what_it_does_not_know_and_leaves_no_file(
    source: str, options: tuple[str, ...], words: tuple[str, ...], run: Run, tmp_path: Path
) -> None:
    assert_refused(run("reference", source, *options, "--out", tmp_path / "a.concept"), *words)
    assert list(tmp_path.iterdir()) == []


# python -m tracker


def test_tracker_writes_lines_settings_and_a_video(model: Path, run: Run, tmp_path: Path) -> None:
    said = run("tracker", SOURCE, "--model", model, "--out", tmp_path / "out", "--view", "overlay", "--prior", "off")
    assert (said.code, said.out) == (0, ""), said.err
    assert BOX in said.err
    assert set(content(tmp_path / "out")) == {"poses.jsonl", "config.yaml", "run.json", "overlay.mp4"}
    assert len((tmp_path / "out" / "poses.jsonl").read_text().splitlines()) == 6
    assert read_config(tmp_path / "out" / "config.yaml") == TrackerConfig(prior=False)
    video = cv2.VideoCapture(str(tmp_path / "out" / "overlay.mp4"))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 6
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_tracker_writes_the_formats_of_the_field_with_the_same_smoothed_poses(
    model: Path, run: Run, tmp_path: Path
) -> None:
    line = ("tracker", SOURCE, "--model", model, "--smooth", "offline", "--out", tmp_path / "out")
    said = run(*line, "--write", "ob-in-cam", "tum")
    assert (said.code, said.out) == (0, ""), said.err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "poses.jsonl",
        "config.yaml",
        "run.json",
        "ob_in_cam",
        "tum",
    }
    lines = [json.loads(each) for each in (tmp_path / "out" / "poses.jsonl").read_text().splitlines()]
    matrices = [np.loadtxt(path) for path in sorted((tmp_path / "out" / "ob_in_cam").iterdir())]
    rows = np.loadtxt(tmp_path / "out" / "tum" / f"{BOX}.txt")
    for each, matrix, row in zip(lines, matrices, rows, strict=True):
        assert matrix[:3, 3].tolist() == each["T_cam_obj"]["translation_m"] == row[1:4].tolist()
        assert row[[7, 4, 5, 6]].tolist() == each["T_cam_obj"]["quaternion_wxyz"]
        assert row[0] == pytest.approx(each["stamp_ns"] / 1e9)
    refused = run("tracker", SOURCE, "--model", model, "--write", "bop", "--out", tmp_path / "bop")
    assert_refused(refused, "BOP's rows have numbers", BOX)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert_refused(run("tracker", SOURCE, "--model", model, "--write", "tum"), "--write tum", "--out")


def test_tracker_needs_no_folder_and_can_be_quiet(
    model: Path, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("tracker", SOURCE, "--model", model, "--quiet") == Said(0, "", "")
    assert list(tmp_path.iterdir()) == []


def test_tracker_takes_settings_from_a_file_and_keeps_all_of_them(model: Path, run: Run, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("seed: 7\nmatching:\n  temperature: 0.5\n")
    said = run("tracker", SOURCE, "--model", model, "--config", tmp_path / "mine.yaml", "--out", tmp_path / "out")
    assert said.code == 0, said.err
    kept = read_config(tmp_path / "out" / "config.yaml")
    assert (kept.seed, kept.matching.temperature) == (7, 0.5)
    assert kept.model_copy(update={"seed": 42, "matching": TrackerConfig().matching}) == TrackerConfig()


def test_results_are_replaced_only_when_it_is_asked_for(model: Path, run: Run, filled: Path) -> None:
    line = ("tracker", SOURCE, "--model", model, "--out", filled)
    assert_refused(run(*line), "holds results already", "--overwrite")
    assert content(filled) == {"precious.txt": b"of last week"}
    assert run(*line, "--overwrite").code == 0
    assert set(content(filled)) == {"poses.jsonl", "config.yaml", "run.json"}
    assert [path.name for path in filled.parent.iterdir()] == ["filled"]


def test_an_empty_folder_holds_no_results(model: Path, run: Run, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert run("tracker", SOURCE, "--model", model, "--out", tmp_path / "empty").code == 0
    assert set(content(tmp_path / "empty")) == {"poses.jsonl", "config.yaml", "run.json"}


@pytest.mark.parametrize(
    ("source", "options", "words"),
    [
        ("synthetic:kitchen", (), ("'kitchen'", "tabletop")),
        ("webcam:0", (), ("webcam:0", "one of bop, folder, ")),
        ("bop:/nowhere:1", (), ("/nowhere",)),
        (SOURCE, ("--config", "unknown.yaml"), ("'colour'", "prior", "verification", "filter")),
        (SOURCE, ("--config", "deep.yaml"), ("'filter.speed'", "acceleration_mps2", "gate")),
        (SOURCE, ("--config", "wrong.yaml"), ("believe", "less than or equal to 1")),
        (SOURCE, ("--config", "absent.yaml"), ("absent.yaml",)),
        (SOURCE, ("--at", "9,9"), ("masks", "carried")),
        (SOURCE, ("--masks", "carried", "--at", "left"), ("'left'", "X,Y")),
        (SOURCE, ("--masks", "carried", "--at", "cup=9,9"), ("'cup'", BOX)),
        (SOURCE, ("--masks", "carried", "--model", "{model}", "--at", "9,9"), ("of which object", f"{BOX}_2")),
        (SOURCE, ("--model", "unknown.yaml"), ("unknown.yaml", "concept model")),
        (SOURCE, ("--model", "[bold]we[/]ird.concept"), ("[bold]we[/]ird.concept",)),
    ],
)
def test_tracker_refuses_what_it_does_not_know_and_leaves_no_folder(
    source: str,
    options: tuple[str, ...],
    words: tuple[str, ...],
    model: Path,
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    files = {"unknown.yaml": "colour: red", "deep.yaml": "filter: {speed: 3}", "wrong.yaml": "believe: 2"}
    for name, text in files.items():
        Path(name).write_text(text)
    given = [option.format(model=model) for option in options]
    assert_refused(run("tracker", source, "--model", model, *given, "--out", "out"), *words)
    assert set(content(tmp_path)) == set(files)


@pytest.mark.parametrize("program", ["tracker", "eval"])
def test_a_picture_without_a_folder_to_put_it_is_refused(program: str, model: Path, run: Run) -> None:
    what = (SOURCE, "--model", model) if program == "tracker" else ("track", "--dataset", SOURCE)
    assert_refused(run(program, *what, "--view", "overlay"), "--view overlay", "--out")


def test_tracker_records_for_rerun_and_opens_no_window_without_a_display(
    model: Path, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    what = ("tracker", SOURCE, "--model", model, "--quiet")
    assert_refused(run(*what, "--view", "rerun"), "no display", "--rrd")
    assert run(*what, "--rrd", tmp_path / "a.rrd") == Said(0, "", "")
    assert (tmp_path / "a.rrd").stat().st_size > 10_000
    assert_refused(run(*what, "--rrd", tmp_path / "a.rrd"), "a.rrd", "--overwrite")


def test_tracker_takes_a_box_in_place_of_a_mask_and_two_of_a_kind(model: Path, run: Run) -> None:
    """Of the second one, which is not there, there is no pose."""
    box = bounding_box(open_scene(SCENE)[0].masks[BOX])
    assert box is not None
    at = ("--at", f"{BOX}={','.join(map(str, box))}")
    said = run("tracker", SOURCE, "--model", model, "--model", model, "--masks", "carried", *at, "--json")
    assert said.code == 0, said.err
    lines = [json.loads(line) for line in said.out.splitlines()]
    assert {line["object"] for line in lines} == {BOX, f"{BOX}_2"}
    assert {line["state"] for line in lines if line["object"] == BOX} == {"tracking"}
    assert {line["T_cam_obj"] for line in lines if line["object"] == f"{BOX}_2"} == {None}


def test_concepts_may_come_later(model: Path, run: Run) -> None:
    said = run("tracker", SOURCE, "--model", model, "--concepts", "later", "--json")
    assert said.code == 0, said.err
    lines = [json.loads(line) for line in said.out.splitlines()]
    assert len(lines) == 6
    assert lines[0]["reason"] == "its concepts are not known yet"


def test_tracker_wants_a_model(run: Run) -> None:
    said = run("tracker", SOURCE)
    assert said.code in (1, 2)
    assert "model" in said.err
    assert "Traceback" not in said.err


class Interrupted:
    """The recording, in which reading the fourth frame ends badly."""

    name = "interrupted"

    def __init__(self, how: BaseException) -> None:
        self._how, self._scene = how, open_scene(SCENE)

    def __len__(self) -> int:
        return len(self._scene)

    def __iter__(self) -> Iterator[Frame]:
        for index in range(3):
            yield self._scene[index]
        raise self._how


@pytest.fixture
def interrupted(monkeypatch: pytest.MonkeyPatch) -> Callable[[BaseException], None]:
    """Makes every source end that way."""

    def end(how: BaseException) -> None:
        monkeypatch.setattr(tracker.sources, "open_source", lambda _: Interrupted(how))

    return end


def test_a_frame_that_cannot_be_read_does_not_cost_those_before_it(
    model: Path, run: Run, tmp_path: Path, interrupted: Callable[[BaseException], None]
) -> None:
    interrupted(SourceError("rgb/000003.png: damaged"))
    assert_refused(run("tracker", SOURCE, "--model", model, "--out", tmp_path / "out"), "rgb/000003.png: damaged")
    assert len((tmp_path / "out" / "poses.jsonl").read_text().splitlines()) == 3
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_run_that_is_stopped_keeps_what_was_tracked(
    model: Path, run: Run, tmp_path: Path, interrupted: Callable[[BaseException], None]
) -> None:
    interrupted(KeyboardInterrupt())
    said = run("tracker", SOURCE, "--model", model, "--out", tmp_path / "out", "--view", "overlay")
    assert "stopped" in said.err
    assert len((tmp_path / "out" / "poses.jsonl").read_text().splitlines()) == 3
    assert cv2.VideoCapture(str(tmp_path / "out" / "overlay.mp4")).get(cv2.CAP_PROP_FRAME_COUNT) == 3


def test_smoothed_poses_are_of_the_same_frames_and_come_at_the_end(model: Path, run: Run) -> None:
    lines = {}
    for how in ("off", "offline"):
        said = run("tracker", SOURCE, "--model", model, "--smooth", how, "--json", "--locate", "red")
        assert said.code == 0, said.err
        lines[how] = [json.loads(line) for line in said.out.splitlines()]
    assert len(lines["off"]) == len(lines["offline"]) == 6
    moved = 0
    for plain, smoothed in zip(lines["off"], lines["offline"], strict=True):
        for same in ("frame", "state", "confidence", "T_cam_obj_raw"):
            assert plain[same] == smoothed[same]
        moved += plain["T_cam_obj"] != smoothed["T_cam_obj"]
        assert ("regions" in plain) == ("regions" in smoothed)
    assert moved >= 3
    assert lines["off"][-1]["T_cam_obj"] == lines["offline"][-1]["T_cam_obj"]


def test_a_run_that_is_stopped_keeps_what_was_smoothed_too(
    model: Path, run: Run, tmp_path: Path, interrupted: Callable[[BaseException], None]
) -> None:
    interrupted(KeyboardInterrupt())
    assert "stopped" in run("tracker", SOURCE, "--model", model, "--smooth", "offline", "--out", tmp_path / "out").err
    assert len((tmp_path / "out" / "poses.jsonl").read_text().splitlines()) == 3


def test_a_source_of_nobody_knows_how_many_frames_is_tracked_to_its_end(
    model: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tracker.sources, "open_source", lambda _: iter(open_scene(SCENE)))
    said = run("tracker", SOURCE, "--model", model)
    assert said.code == 0, said.err
    assert "tracked" in said.err


def test_frames_that_come_late_are_left_out_and_counted(model: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = open_scene(SCENE)
    late = [scene[index] for index in (0, 1, 1, 3, 2, 4)]
    monkeypatch.setattr(tracker.sources, "open_source", lambda _: late)
    said = run("tracker", SOURCE, "--model", model, "--json")
    assert said.code == 0, said.err
    assert [json.loads(line)["frame"] for line in said.out.splitlines()] == [0, 1, 3, 4]
    assert "2 frames left out" in said.err


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_crash_leaves_no_half_folder_and_costs_no_older_results(
    overwrite: bool, model: Path, run: Run, filled: Path, interrupted: Callable[[BaseException], None]
) -> None:
    interrupted(RuntimeError("a bug"))
    out, options = (filled, ("--overwrite",)) if overwrite else (filled.with_name("new"), ())
    with pytest.raises(RuntimeError, match="a bug"):
        run("tracker", SOURCE, "--model", model, "--out", out, *options)
    assert [path.name for path in filled.parent.iterdir()] == ["filled"]
    assert content(filled) == {"precious.txt": b"of last week"}


# python -m eval


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that `eval track` writes, from a process of its own."""
    folder = tmp_path_factory.mktemp("evaluated") / "out"
    told = process("eval", "track", "--dataset", SOURCE, "--views", 2, "--out", folder, "--view", "overlay")
    assert (told.code, told.out) == (0, ""), told.err
    assert "pooled" in told.err
    return folder


def test_eval_track_writes_poses_scores_a_page_settings_and_a_video(evaluated: Path) -> None:
    files = {"results.csv", "scores.json", "report.html", "report.md", "config.yaml", "overlay.mp4"}
    assert set(content(evaluated)) == files
    assert [path.name for path in evaluated.parent.iterdir()] == ["out"]
    assert read_config(evaluated / "config.yaml") == TrackerConfig()
    assert [e.image_id for e in read_results(evaluated / "results.csv")] == list(range(6))


def test_the_scores_of_eval_track_have_the_layout_that_others_rely_on(evaluated: Path) -> None:
    scores = json.loads((evaluated / "scores.json").read_text())
    assert set(scores) == {"protocol", "metrics", "latency_ms", "environment"}
    assert set(scores["metrics"]) == {"pooled", "mean_of_objects", "per_object"}
    assert set(scores["metrics"]["per_object"]) == {BOX}
    assert {"median", "p95", "stages"} == set(scores["latency_ms"])
    pooled, protocol = scores["metrics"]["pooled"], scores["protocol"]
    assert pooled["adds_auc"] > 95
    assert (pooled["missing"], pooled["lost_fraction"], pooled["false_tracks"]) == (0, 0, 0)
    assert pooled["instances"] == 6 - int(protocol["reference_frames"].split("(")[1].split()[0])
    assert 1 <= 6 - pooled["instances"] <= 2
    assert "not stated" not in protocol.values()
    assert (protocol["dataset"], protocol["views"], protocol["prior"]) == (SOURCE, 2, "on")


def test_eval_score_scores_what_eval_track_wrote(evaluated: Path, run: Run, tmp_path: Path) -> None:
    out = tmp_path / "deep" / "mine.json"
    said = run("eval", "score", "--dataset", SOURCE, "--results", evaluated / "results.csv", "--out", out)
    assert (said.code, said.out) == (0, ""), said.err
    assert set(content(out.parent)) == {"mine.json", "mine.html", "mine.md"}
    scores = json.loads(out.read_text())
    assert scores["metrics"]["pooled"]["instances"] == 6  # no reference frame is told to it
    assert scores["metrics"]["pooled"]["adds_auc"] > 95
    assert scores["protocol"]["masks"] == "not stated"
    assert f"{scores['metrics']['pooled']['adds_auc']:.1f}" in said.err


def test_eval_score_measures_vsd_and_takes_a_list_of_symmetric_objects(
    evaluated: Path, run: Run, tmp_path: Path
) -> None:
    line = ("--results", evaluated / "results.csv", "--vsd", "--symmetric", BOX, "--out", tmp_path / "mine.json")
    said = run("eval", "score", "--dataset", SOURCE, *line)
    assert (said.code, said.out) == (0, ""), said.err
    scores = json.loads((tmp_path / "mine.json").read_text())
    pooled, protocol = scores["metrics"]["pooled"], scores["protocol"]
    assert pooled["ar"] == pytest.approx(sum(pooled[f"ar_{name}"] for name in ("vsd", "mssd", "mspd")) / 3)
    assert pooled["ar"] > 0.8
    assert f"{pooled['ar_vsd']:.3f}" in said.err
    assert pooled["add_or_adds_auc"] == pooled["adds_auc"]
    assert (protocol["symmetric_objects"], protocol["symmetric_objects_are"]) == ([BOX], "the user's list")


@pytest.mark.parametrize("name", ["mine.json", "mine.html", "mine.md"])
def test_eval_score_replaces_scores_and_page_only_when_it_is_asked_to(
    name: str, evaluated: Path, run: Run, tmp_path: Path
) -> None:
    (tmp_path / name).write_text("precious")
    results = evaluated / "results.csv"
    line = ("eval", "score", "--dataset", SOURCE, "--results", results, "--out", tmp_path / "mine.json")
    assert_refused(run(*line), name, "--overwrite")
    assert content(tmp_path) == {name: b"precious"}
    assert run(*line, "--overwrite").code == 0
    assert json.loads((tmp_path / "mine.json").read_text())["metrics"]["pooled"]["instances"] == 6


def test_eval_track_can_score_raw_poses_without_a_prior(run: Run, tmp_path: Path) -> None:
    options = ("--prior", "off", "--poses", "raw", "--views", 1, "--objects", BOX, "--scenes", 1)
    said = run("eval", "track", "--dataset", SOURCE, *options, "--out", tmp_path / "out")
    assert said.code == 0, said.err
    protocol = json.loads((tmp_path / "out" / "scores.json").read_text())["protocol"]
    assert (protocol["prior"], protocol["poses"], protocol["views"]) == ("off", "raw", 1)
    assert not read_config(tmp_path / "out" / "config.yaml").prior


def test_eval_track_says_which_method_it_scored_and_what_that_was_told(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "out"
    said = run("eval", "track", "--dataset", SOURCE, "--method", "icp", "--init", "gt", "--out", out)
    assert said.code == 0, said.err
    assert "method icp" in " ".join(said.err.split())
    protocol = json.loads((out / "scores.json").read_text())["protocol"]
    assert (protocol["method"], protocol["backend"]) == ("icp", "not used by the method")
    assert protocol["initialisation"].startswith("gt: each object's true pose is told once a scene")
    assert protocol["method_settings"]["reach_start"] == 0.8


def test_eval_track_scores_models_of_unposed_frames_in_the_true_object_frame(run: Run, tmp_path: Path) -> None:
    said = run("eval", "track", "--dataset", SOURCE, "--views", 2, "--unposed", "--out", tmp_path / "out")
    assert said.code == 0, said.err
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    assert scores["protocol"]["reference_poses"].startswith("found by the tracker")
    assert scores["metrics"]["pooled"]["add_auc"] > 90
    assert scores["metrics"]["pooled"]["instances"] == 4


def test_eval_track_refuses_a_folder_with_results(run: Run, filled: Path) -> None:
    assert_refused(run("eval", "track", "--dataset", SOURCE, "--out", filled), "holds results already")
    assert content(filled) == {"precious.txt": b"of last week"}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--dataset", "synthetic:kitchen"), ("'kitchen'", "tabletop")),
        (("--dataset", "ycbv:/data"), ("ycbv:/data", "bop, synthetic")),
        (("--dataset", SOURCE, "--scenes", "4"), ("no scene 4", "1")),
        (("--dataset", SOURCE, "--objects", "spoon"), ("no object 'spoon'", BOX)),
        (("--dataset", SOURCE, "--backend", "tea"), ("'tea'", "attributes")),
        (("--dataset", SOURCE, "--views", "0"), ("--views", "0")),
        (("--dataset", SOURCE, "--smooth", "offline", "--poses", "raw"), ("--smooth offline", "--poses filtered")),
        (("--dataset", SOURCE, "--smooth", "offline", "--prior", "off"), ("--smooth offline", "--prior on")),
        (("--dataset", SOURCE, "--method", "icp"), ("method icp", "--init gt")),
        (("--dataset", SOURCE, "--config", "absent.yaml"), ("absent.yaml",)),
    ],
)
def test_eval_track_refuses_what_it_does_not_know_and_leaves_no_folder(
    options: tuple[str, ...], words: tuple[str, ...], run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert_refused(run("eval", "track", *options, "--out", "out"), *words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--dataset", SOURCE, "--results", "absent.csv"), ("absent.csv", "cannot be read")),
        (("--dataset", SOURCE, "--results", "broken.csv"), ("broken.csv, line 1",)),
        (("--dataset", "synthetic:kitchen", "--results", "broken.csv"), ("'kitchen'",)),
    ],
)
def test_eval_score_refuses_what_it_cannot_read_and_leaves_no_file(
    options: tuple[str, ...], words: tuple[str, ...], run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("broken.csv").write_text("scene,image,pose\n")
    assert_refused(run("eval", "score", *options, "--out", "out.json"), *words)
    assert set(content(tmp_path)) == {"broken.csv"}


def test_eval_score_aligns_object_frames_and_says_so(evaluated: Path, run: Run, tmp_path: Path) -> None:
    line = ("eval", "score", "--dataset", SOURCE, "--results", evaluated / "results.csv", "--out")
    assert run(*line, tmp_path / "a.json", "--align", "reference").code == 0
    scores = json.loads((tmp_path / "a.json").read_text())
    assert scores["metrics"]["pooled"]["instances"] == 5
    assert scores["protocol"]["alignment_frames"] == {f"1/{BOX}": 0}
    assert run(*line, tmp_path / "b.json", "--align", "reference", "--score-align-frames").code == 0
    assert json.loads((tmp_path / "b.json").read_text())["metrics"]["pooled"]["instances"] == 6
    assert_refused(run(*line, tmp_path / "c.json", "--align-frame", "best-score"), "--align reference")
    assert not (tmp_path / "c.json").exists()


def test_eval_pairs_draws_answers_and_scores_and_its_list_does_it_again(run: Run, tmp_path: Path) -> None:
    first, again = tmp_path / "first", tmp_path / "again"
    options = ("--kind", "same-scene", "--pairs", 4, "--seed", 7, "--out", first)
    said = run("eval", "pairs", "--dataset", SOURCE, *options)
    assert (said.code, said.out) == (0, ""), said.err
    assert "one reference view" not in said.err  # as every model here has
    files = set(content(first))
    assert {"pairs.csv", "poses.jsonl", "scores.json", "report.html", "config.yaml"} < files
    assert any(name.startswith("results") for name in files)
    scores = json.loads((first / "scores.json").read_text())
    protocol = scores["protocol"]
    assert (protocol["kind"], protocol["seed"], protocol["pairs"], protocol["prior"]) == ("same-scene", 7, 4, "off")
    assert 1 <= protocol["anchors"] <= 4
    assert "not stated" not in protocol.values()
    assert (scores["metrics"]["pooled"]["instances"], scores["metrics"]["pooled"]["missing"]) == (4, 0)

    said = run("eval", "pairs", "--dataset", SOURCE, "--list", first / "pairs.csv", "--out", again)
    assert said.code == 0, said.err
    repeated = json.loads((again / "scores.json").read_text())
    assert repeated["metrics"] == scores["metrics"]
    assert (repeated["protocol"]["kind"], repeated["protocol"]["seed"]) == ("same-scene", None)
    assert (again / "pairs.csv").read_text() == (first / "pairs.csv").read_text()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), ("no cross-scene pair", "same-scene")),
        (("--kind", "same-scene", "--pairs", "0"), ("--pairs", "got 0")),
        (("--list", "absent.csv"), ("absent.csv", "cannot be read")),
        (("--list", "broken.csv"), ("broken.csv, line 1", "SCENE IMAGE")),
        (("--list", "broken.csv", "--seed", "1"), ("--list", "--seed")),
    ],
)
def test_eval_pairs_refuses_what_it_cannot_do_and_leaves_no_folder(
    options: tuple[str, ...], words: tuple[str, ...], run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("broken.csv").write_text("scene,image,pose\n")
    assert_refused(run("eval", "pairs", "--dataset", SOURCE, *options, "--out", "out"), *words)
    assert set(content(tmp_path)) == {"broken.csv"}


def test_eval_scenarios_prints_a_table_and_writes_every_frame(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = FrameLog(0, 1.0, True, False, "tracking", 0.8, "", 0.002, 3.0)
    asked: list[ScenarioRun] = []

    def tracked(each: ScenarioRun) -> RunLog:
        asked.append(each)
        return RunLog(each.scenario, each.seed, "mug", [seen] * 4)

    monkeypatch.setattr(eval.scenarios.run, "run_scenario", tracked)
    out = tmp_path / "runs.json"
    line = ("eval", "scenarios", "away", "hand", "--seeds", 2, "--first-seed", 3, "--size", "64x64", "--json", out)
    said = run(*line)
    assert (said.code, said.out) == (0, ""), said.err
    assert [(each.scenario, each.seed) for each in asked] == [("away", 3), ("away", 4), ("hand", 3), ("hand", 4)]
    assert {(each.size, each.views, each.config.masks) for each in asked} == {("64x64", 4, "carried")}
    for word in ("away", "100%", "AUROC", "calibration", "rendering"):
        assert word in said.err
    content = json.loads(out.read_text())
    assert [len(each["frames"]) for each in content["runs"]] == [4] * 4
    assert content["protocol"]["seeds"] == [3, 4]
    assert_refused(run(*line), "runs.json", "--overwrite")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("kitchen",), ("'kitchen'", "hidden, away, gone, hand, jerk, lights, blind, swapped")),
        (("--seeds", 0), ("--seeds", "0")),
        (("--first-seed", -1), ("--first-seed", "-1")),
        (("--views", 0), ("--views", "0")),
        (("--size", "big"), ("'big'", "WIDTHxHEIGHT")),
        (("--config", "absent.yaml"), ("absent.yaml",)),
    ],
)
def test_eval_scenarios_refuses_what_it_does_not_know(
    options: tuple[object, ...], words: tuple[str, ...], run: Run
) -> None:
    assert_refused(run("eval", "scenarios", *options), *words)


def test_eval_calibrate_fits_to_poses_that_were_kept_and_prints_the_weights(run: Run, tmp_path: Path) -> None:
    path, rng = tmp_path / "poses.json", np.random.default_rng(0)
    poses = []
    for index in range(200):
        contradicted = rng.random()
        evidence = Evidence(0.5, 0.5, 0.5, contradicted, 0.0, 0.0, 0.0, 1.0, 0.5)
        scene = ("away", "hand")[index % 2]
        name = ("mug", "bowl")[index // 2 % 2]
        poses.append(JudgedPose(scene, scene, name, index, bool(rng.random() > contradicted), Grounds(evidence, 0.05)))
    write_poses(path, {}, poses)
    said = run("eval", "calibrate", "--rows", path)
    assert (said.code, said.out) == (0, ""), said.err
    assert "WEIGHTS = np.array([" in said.err
    assert {"away", "hand"} <= set(said.err.split())
    assert_refused(run("eval", "calibrate", "--rows", path, "--json", path), "--rows and --json")
    assert_refused(run("eval", "calibrate", "--seeds", 0), "--seeds")
    assert_refused(run("eval", "calibrate", "--json", path), "poses.json", "--overwrite")


# python -m eval plate


def test_plates_are_made_of_a_saved_run_and_of_a_model(model: Path, run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert run("tracker", SOURCE, "--model", model, "--out", folder, "--quiet").code == 0
    for kind, what in (("views", model), ("concepts", model), ("matches", folder)):
        said = run("eval", "plate", kind, what, "--out", tmp_path / f"{kind}.png", "--width", 640)
        assert (said.code, said.out) == (0, ""), said.err
        picture = cv2.imread(str(tmp_path / f"{kind}.png"))
        assert picture is not None
        assert picture.shape[1] == 640 or kind == "concepts"
    assert_refused(run("eval", "plate", "matches", folder, "--out", tmp_path / "matches.png"), "exists", "--overwrite")


def test_a_plate_of_a_failure_is_the_first_one_in_the_run_or_of_the_frame_that_is_named(
    model: Path, run: Run, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    settings = tmp_path / "strict.yaml"
    settings.write_text("believe: 1.0")
    what = (SOURCE, "--model", model, "--out", folder, "--quiet", "--config", settings)
    assert run("tracker", *what).code == 0
    assert run("eval", "plate", "failure", folder, "--frame", 2, "--quiet") == Said(0, "", "")
    assert [path.name for path in folder.glob("*.png")] == [f"failure_{BOX}_000002.png"]
    assert_refused(run("eval", "plate", "failure", folder, "--quiet"), "lost", "no frame")  # it was never found
    assert_refused(run("eval", "plate", "matches", folder, "--frame", 2, "--quiet"), "tracked", "frame 2")
    assert_refused(run("eval", "plate", "failure", folder, "--object", "cup"), "cup", BOX)
    assert_refused(run("eval", "plate", "failure", tmp_path, "--quiet"), "run.json")


# what they say


def test_with_json_the_standard_output_is_json_and_nothing_else_is_said(run: Run, tmp_path: Path) -> None:
    said = run("reference", SOURCE, "--object", BOX, "--out", tmp_path / "a.concept", "--json")
    assert said.code == 0
    facts = json.loads(said.out)
    assert (facts["object"], facts["model"]) == (BOX, str(tmp_path / "a.concept"))
    assert facts["notes"]["quality"]["points"] > 0
    said = run("eval", "track", "--dataset", SOURCE, "--objects", BOX, "--json")
    assert said.code == 0
    scores = json.loads(said.out)
    assert scores["metrics"]["pooled"]["instances"] > 0
    assert scores["latency_ms"]["median"] > 0
    assert "Percent" not in said.err


@pytest.mark.parametrize(
    "command",
    [
        ("reference", SOURCE, "--object", BOX, "--out", "a.concept"),
        ("eval", "track", "--dataset", SOURCE, "--objects", BOX),
        ("eval", "scenarios", "hand", "--seeds", 1, "--size", "160x120"),
    ],
)
def test_quiet_they_say_nothing_but_what_is_wrong(
    command: tuple[object, ...], run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = run(*command, "--quiet")
    assert (said.code, said.out) == (0, "")
    assert [line for line in said.err.splitlines() if "model of object" not in line and "reference" not in line] == []


def test_a_tracker_that_is_killed_leaves_no_results_and_another_run_gives_them(model: Path, tmp_path: Path) -> None:
    line = ("tracker", SOURCE, "--model", model, "--out", tmp_path / "out", "--quiet")
    running = subprocess.Popen([sys.executable, "-m", *map(str, line)])  # noqa: S603
    while running.poll() is None and not any(path.stat().st_size for path in tmp_path.glob(".out.*/poses.jsonl")):
        time.sleep(0.002)
    running.kill()
    assert running.wait() == -signal.SIGKILL, "it ended before it could be killed"
    assert not (tmp_path / "out").exists()
    said = process(*line)
    assert said.code == 0
    assert f".out.{running.pid}.partial" in "".join(said.err.split())
    lines = (tmp_path / "out" / "poses.jsonl").read_text().splitlines()
    assert [json.loads(line)["frame"] for line in lines] == list(range(len(lines)))
    assert len(lines) == 6
