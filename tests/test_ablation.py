"""Ablations: a grid of cells, none of which is run twice, beside the paper's numbers; and error against occlusion."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import eval.__main__
import eval.units
from eval.ablation_table import dataset_labels
from eval.occlusion import line, occlusion
from eval.predict import track_scene
from eval.preset import read_preset, shipped_presets
from eval.score import score
from eval.track_run import TrackRun, opened_dataset
from eval.tracked import Tracked
from eval.units import track_units, units_of
from tests.tiny_bop import write_bop
from tracker.config import TrackerConfig, parse_config
from tracker.errors import ConfigError

GRID = """
title: Prior and views
columns: [add_auc, missing, ms]
options: {poses: raw}
axes:
- - {name: prior, config: {matching: {temperature: 0.3}}}
  - {name: no prior, config: {prior: false}}
- - {name: one view, options: {views: 1}}
  - {name: two views, options: {views: 2}}
"""
ROW = """
title: Seeds
paper_data: another dataset
columns: [add_auc]
axes:
- - {name: a, config: {seed: 1}, paper: {add_auc: 12.3}}
  - {name: b, options: {backend: dinotxt, weights: /nowhere}}
"""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> str:
    scenes = {k: f"turn?size=160x120&frames=3&object={name}" for k, name in ((2, "tea_box"), (5, "cereal_box"))}
    return write_bop(tmp_path_factory.mktemp("tiny") / "bop", scenes)


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> str:
    scene = "turn?size=160x120&frames=3&object=tea_box&seed=3"
    return write_bop(tmp_path_factory.mktemp("other") / "bop", {2: scene})


@pytest.fixture
def ablate(program: Callable[..., tuple[int, str]]) -> Callable[..., tuple[int, str]]:
    """`python -m eval ablate` in this process: its exit code and what it says."""
    return lambda *options: program(eval.__main__.main, "ablate", *options)


@pytest.fixture
def tracked_scenes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The scenes that are tracked, as they are; what was finished is not among them."""
    told: list[int] = []

    def noted(dataset: object, scene_id: int, *rest: object) -> Tracked:
        told.append(scene_id)
        return track_scene(dataset, scene_id, *rest)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(eval.units, "track_scene", noted)
    return told


def test_finished_cells_are_kept_and_only_what_changed_is_run_again(
    dataset: str, ablate: Callable[..., tuple[int, str]], tracked_scenes: list[int], tmp_path: Path
) -> None:
    preset, out = tmp_path / "grid.yaml", tmp_path / "out"
    preset.write_text(GRID)
    line = (preset, "--dataset", dataset, "--out", out)
    code, said = ablate(*line)
    assert code == 0, said
    assert tracked_scenes == [2, 5] * 4
    first = json.loads((out / "ablation.json").read_text())
    assert [cell["name"] for cell in first["cells"]] == [
        "prior, one view", "prior, two views", "no prior, one view", "no prior, two views"
    ]  # fmt: skip
    protocols = [cell["protocol"] for cell in first["cells"]]
    assert [(p["prior"], p["views"], p["poses"]) for p in protocols] == [
        ("on", 1, "raw"), ("on", 2, "raw"), ("off", 1, "raw"), ("off", 2, "raw")
    ]  # fmt: skip
    assert len({scene for cell in first["cells"] for scene in cell["scenes"]}) == 8

    assert "8 of 8 scenes of the cells were finished before" in ablate(*line)[1]
    assert len(tracked_scenes) == 8
    assert json.loads((out / "ablation.json").read_text())["cells"] == first["cells"]

    preset.write_text(GRID.replace("name: two views, options: {views: 2}", "name: two views, options: {views: 3}"))
    code, said = ablate(*line)
    assert (code, len(tracked_scenes)) == (0, 12)
    assert "4 of 8 scenes" in said

    preset.write_text(GRID)  # as it was: nothing to do
    assert "8 of 8 scenes" in ablate(*line)[1]


def test_a_run_that_was_stopped_goes_on_with_the_scene_that_it_stopped_at(
    dataset: str,
    other: str,
    ablate: Callable[..., tuple[int, str]],
    tracked_scenes: list[int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    preset = tmp_path / "grid.yaml"
    preset.write_text(GRID)
    noted = eval.units.track_scene

    def broken_after(scenes: int) -> Callable[..., Tracked]:
        def broken(*arguments: object) -> Tracked:
            if len(tracked_scenes) == scenes:
                raise RuntimeError("the power is out")
            return noted(*arguments)  # pyright: ignore[reportArgumentType]

        return broken

    # the power goes out in the second dataset, whose first scenes are kept as those of the first are
    for names, before, whole in (((dataset,), 5, 8), ((other, dataset), 6, 12)):
        tracked_scenes.clear()
        out = tmp_path / f"of {len(names)}"
        line = (preset, *(word for name in names for word in ("--dataset", name)), "--out", out)
        with monkeypatch.context() as patch:
            patch.setattr(eval.units, "track_scene", broken_after(before))
            with pytest.raises(RuntimeError, match="the power is out"):
                ablate(*line)
        assert not (out / "ablation.json").exists()
        code, said = ablate(*line)
        assert (code, len(tracked_scenes)) == (0, whole)
        assert f"{before} of {whole} scenes" in said


def test_the_paper_stands_beside_and_is_marked_and_a_cell_that_cannot_be_run_says_why(
    dataset: str, ablate: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    (tmp_path / "row.yaml").write_text(ROW)
    out = tmp_path / "out"
    code, said = ablate(tmp_path / "row.yaml", "--dataset", dataset, "--out", out)
    assert code == 1
    assert "1 of 2 cells were not run: 'b'" in said
    assert " paper 12.3 " in said
    assert "not the same data (another dataset)" in said
    page = (out / "ablation.md").read_text()
    (row,) = [text for text in page.splitlines() if text.startswith("| a |")]
    assert row.endswith("| 12.3 |")
    assert "/nowhere" in page.split("Not run:")[1]
    found = json.loads((out / "ablation.json").read_text())
    assert [cell["failure"] is None for cell in found["cells"]] == [True, False]
    assert "not the same data" in found["paper_is"]


def test_several_datasets_stand_side_by_side_in_one_table_and_what_is_kept_of_one_is_used(
    dataset: str, other: str, ablate: Callable[..., tuple[int, str]], tracked_scenes: list[int], tmp_path: Path
) -> None:
    preset, out = tmp_path / "grid.yaml", tmp_path / "out"
    preset.write_text(GRID)
    assert ablate(preset, "--dataset", dataset, "--out", out)[0] == 0
    alone = json.loads((out / "ablation.json").read_text())
    tracked_scenes.clear()
    code, said = ablate(preset, "--dataset", dataset, "--dataset", other, "--out", out)
    assert code == 0, said
    assert tracked_scenes == [2] * 4
    assert "8 of 12 scenes of the cells were finished before" in said
    first, second = labels = dataset_labels([dataset, other])
    assert first.startswith("tiny")
    assert second.startswith("other")
    assert said.index(first) < said.index(second)

    told = json.loads((out / "ablation.json").read_text())
    assert "cells" not in told
    assert [(one["dataset"], one["scenes"], one["instances"]) for one in told["datasets"]] == [
        (dataset, [2, 5], alone["instances"]), (other, [2], told["datasets"][1]["instances"])
    ]  # fmt: skip
    assert told["datasets"][0]["cells"] == alone["cells"]

    text = (out / "ablation.md").read_text()
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    assert rows[0] == [f"{label}: {name}" for label in labels for name in ("ADD", "missing", "ms")]
    assert [row[0] for row in rows[2:]] == [cell["name"] for cell in alone["cells"]]
    for place, row in enumerate(rows[2:]):
        pooled = [one["cells"][place]["metrics"]["pooled"] for one in told["datasets"]]
        assert [row[1], row[4]] == [f"{one['add_auc']:.1f}" for one in pooled]
    assert f"- {second}: {other}, scenes 2, " in text

    page = (out / "ablation.html").read_text()
    groups = "".join(f'<th scope="colgroup" colspan="3">{label}</th>' for label in labels)
    assert f'<tr><th scope="colgroup" colspan="1"></th>{groups}</tr>' in page
    assert f"<tr>{''.join(f'<td>{cell}</td>' for cell in rows[2])}</tr>" in page
    assert f"<dt>{second}</dt><dd>{other}, scenes 2, " in page


def test_one_dataset_needs_no_label_and_its_page_says_what_the_markdown_says(
    dataset: str, ablate: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    (tmp_path / "row.yaml").write_text(ROW)
    ablate(tmp_path / "row.yaml", "--dataset", dataset, "--out", tmp_path / "out")
    text, page = ((tmp_path / "out" / f"ablation.{ending}").read_text() for ending in ("md", "html"))
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    assert rows[0] == ["ADD", "(paper)"]
    for row in rows[2:]:
        assert "".join(f"<td>{cell}</td>" for cell in row) in page
    assert "colgroup" not in page.partition("<body>")[2]
    assert "/nowhere" in page.partition("Not run")[2]


def test_the_paper_is_a_group_of_its_own_beside_several_datasets(
    dataset: str, other: str, ablate: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    (tmp_path / "row.yaml").write_text(ROW)
    code, said = ablate(tmp_path / "row.yaml", "--dataset", dataset, "--dataset", other, "--out", tmp_path / "out")
    first, second = dataset_labels([dataset, other])
    assert code == 1
    assert f"2 of 4 cells were not run: 'b' on {first}, 'b' on {second}" in said
    rows = [line for line in (tmp_path / "out" / "ablation.md").read_text().splitlines() if line.startswith("| ")]
    assert rows[0] == f"|  | {first}: ADD | {second}: ADD | paper: ADD |"
    assert rows[-1] == "| b | - | - | - |"
    assert rows[-2].endswith("| 12.3 |")


def test_a_dataset_without_a_scene_that_is_asked_for_is_refused_before_another_one_is_tracked(
    dataset: str, other: str, ablate: Callable[..., tuple[int, str]], tracked_scenes: list[int], tmp_path: Path
) -> None:
    line = ("peers", "--dataset", dataset, "--out", tmp_path / "out", "--dataset")
    code, said = ablate(*line, other, "--scenes", "5")
    assert (code, tracked_scenes) == (1, [])
    assert "has no scene 5; it has 2" in said
    code, said = ablate(*line, f"{dataset}/")
    assert (code, tracked_scenes) == (1, [])
    assert "--dataset: each once" in said


@pytest.mark.parametrize(
    ("names", "labels"),
    [
        (["bop:/data/hard"], [""]),
        (["bop:/data/hard", "bop:/data/standard/"], ["hard", "standard"]),
        (["bop:/a/test", "bop:/b/test", "bop:/c"], ["a/test", "b/test", "c"]),
        (["bop:here", "nocs:here"], ["bop:here", "nocs:here"]),
    ],
)
def test_a_label_is_the_end_of_a_name_that_tells_it_from_the_others(names: list[str], labels: list[str]) -> None:
    assert dataset_labels(names) == labels


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("title: x", ("mine.yaml", "columns", "axes")),
        (GRID + "colour: red", ("mine.yaml", "no key 'colour'")),
        (GRID.replace("views: 2", "view: 2"), ("mine.yaml", "no key 'axes.1.1.options.view'")),
        (GRID.replace("missing, ms", "beauty"), ("mine.yaml", "no column beauty", "add_auc")),
        (GRID.replace("two views", "one view"), ("mine.yaml", "axes.1", "names all differ")),
        (GRID.replace("name: no prior,", "name: no prior, paper: {ms: 1},"), ("mine.yaml", "axes.0", "several axes")),
        ("[", ("mine.yaml", "YAML")),
    ],
)
def test_a_preset_that_is_wrong_is_refused_with_its_file_and_key(
    text: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(ConfigError) as refused:
        read_preset(str(tmp_path / "mine.yaml"))
    assert all(word in str(refused.value) for word in words), refused.value


def test_an_unknown_preset_names_what_there_is_and_they_can_be_listed(
    dataset: str, ablate: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    code, said = ablate("cooking", "--dataset", dataset, "--out", tmp_path / "out")
    assert code == 1
    assert "no preset 'cooking'" in said
    code, listed = ablate("--list")
    assert code == 0
    for name in shipped_presets():
        assert name in said
        assert f"{name}: {' '.join(read_preset(name).title.split())}" in listed


def test_a_folder_with_something_else_is_left_alone(
    dataset: str, ablate: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    (tmp_path / "precious.txt").write_text("of last week")
    code, said = ablate("prior", "--dataset", dataset, "--out", tmp_path)
    assert code == 1
    assert "no ablation" in said
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


@pytest.mark.parametrize("name", shipped_presets())
def test_every_preset_that_comes_along_has_settings_that_there_are(name: str) -> None:
    from eval.ablation import run_of
    from eval.preset import preset_path

    preset = read_preset(name)
    cells = preset.cells()
    folder = preset_path(name).parent
    runs = [run_of(cell, TrackRun("bop:here"), folder) for cell in cells]
    assert len({repr(run) for run in runs}) == len(cells)
    for cell in cells:
        parse_config(cell.config, name)
    if name != "prompts":
        defaults = (TrackerConfig(), TrackerConfig(prior=False))
        assert any(run.config in defaults for run in runs), "one row is as the tracker is, with or without a prior"


# Error against occlusion


def test_a_line_is_found_again_with_its_correlation_and_missing_poses_are_beside_it() -> None:
    hidden = np.linspace(0, 0.9, 10)
    exact = line(np.append(hidden, 0.5), np.append(2 + 30 * hidden, np.inf))
    assert (exact.pairs, exact.missing) == (10, 1)
    assert exact.slope_mm == pytest.approx(30)
    assert exact.intercept_mm == pytest.approx(2)
    assert (exact.r, exact.r2) == (pytest.approx(1), pytest.approx(1))
    noisy = line(hidden, 5 + np.array([1, -1, -1, 1, 0, 0, 1, -1, -1, 1.0]))
    assert noisy.r2 is not None
    assert noisy.r2 < 0.05


@pytest.mark.parametrize(
    ("hidden", "error_mm"), [([], []), ([0.1, 0.2], [1, 2]), ([0.1] * 4, [1, 2, 3, 4]), ([0.1, 0.2, 0.3], [5, 5, 5])]
)
def test_where_there_is_no_line_none_is_drawn(hidden: list[float], error_mm: list[float]) -> None:
    found = line(np.array(hidden), np.array(error_mm, float))
    assert (found.pairs, found.slope_mm, found.r2) == (len(hidden), None, None)


def test_every_instance_is_in_one_band_and_in_the_line_of_its_object(dataset: str) -> None:
    units, _ = units_of(TrackRun(dataset), [2, 5])
    opened = opened_dataset(dataset)
    tracked = Tracked.joined(one for one in track_units(units) if isinstance(one, Tracked))
    rows = score(opened, tracked.estimates).instances
    found = occlusion(opened, rows)
    assert sum(band.instances for band in found.bands) == len(rows) == 6
    for lines in found.lines.values():
        assert {name: one.pairs + one.missing for name, one in lines.items()} == {"1": 3, "2": 3, "pooled": 6}
