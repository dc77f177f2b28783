"""Scores as a file, a table, and a page that stands alone."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from eval.instances import InstanceError
from eval.plots import HEIGHT, LARGEST_MM, WIDTH, error_curve, error_over_time
from eval.report import TABLES, environment, tables, write_html, write_scores
from eval.score import Metrics, Scores

VOID = {"meta", "br", "hr", "img", "link", "input"}
NUMBERS = re.compile(r"-?\d+(?:\.\d+)?")


class Page(HTMLParser):
    """What a page holds; fails where its elements are not closed in their order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.rows: list[list[str]] = []
        self.pairs: list[tuple[str, str]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == [], f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")
        elif tag in ("dt", "dd"):
            self.pairs.append((tag, ""))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data
        elif self.open and self.open[-1] in ("dt", "dd"):
            self.pairs[-1] = (self.pairs[-1][0], self.pairs[-1][1] + data)


def instance(image_id: int, add_m: float, object_id: str = "mug", scene_id: int = 1) -> InstanceError:
    missing = not np.isfinite(add_m)
    errors = (0.12, add_m, add_m / 2, 1.0, add_m, missing, 1.0, add_m, 5.0, 0.5, None, None)
    return InstanceError(scene_id, image_id, object_id, *errors)


def metrics(start: float) -> Metrics:
    return {name: start + k / 7 for k, name in enumerate(name for _, columns, _ in TABLES for name in columns)}


ROWS = (instance(0, 0.001), instance(1, 0.006), instance(2, 0.015), instance(3, np.inf), instance(7, 0.3, scene_id=4))
SCORES = Scores(
    protocol={"masks": "visib", "backend": "attributes", "auc_thresholds_m": [0.1, 0.02], "models_refused": {}},
    pooled=metrics(91.1),
    mean_of_objects=metrics(81.1),
    per_object={"mug": metrics(61.1), "a <b> & 'c'": metrics(71.1)},
    instances=ROWS,
)
EXTRA = {"latency_ms": {"median": 31.25, "p95": 48.0, "stages": {"matching": 4.5}}, "environment": {"python": "3.11"}}


@pytest.fixture
def page(tmp_path: Path) -> Page:
    write_html(tmp_path / "report.html", SCORES, EXTRA, "Tracking <synthetic> & more")
    return Page((tmp_path / "report.html").read_text(encoding="utf-8"))


def test_the_page_is_well_formed_and_says_what_it_is(page: Page) -> None:
    assert page.tags[0][0] == "html"
    assert page.text.count("Tracking <synthetic> & more") == 2  # title and heading, escaped
    assert {"table", "svg", "dl", "h1", "h2"} <= {tag for tag, _ in page.tags}


def test_the_page_stands_alone_without_a_script_or_a_link(page: Page, tmp_path: Path) -> None:
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert not {"script", "link", "img", "iframe", "object", "a"} & {tag for tag, _ in page.tags}
    assert not {"src", "href", "srcset", "data"} & {name for _, attributes in page.tags for name in attributes}
    assert not [name for _, attributes in page.tags for name in attributes if name.startswith("on")]
    assert not re.search(r"https?:|//|@import|url\(", text)


def test_the_tables_of_the_page_hold_the_numbers(page: Page) -> None:
    for k, (_, columns, _) in enumerate(TABLES):
        heading, *rows = page.rows[5 * k : 5 * k + 5]
        assert heading == ["object", *(name for name, _ in columns.values())]
        assert [row[0] for row in rows] == ["mug", "a <b> & 'c'", "mean of objects", "pooled"]
        expected = (*SCORES.per_object.values(), SCORES.mean_of_objects, SCORES.pooled)
        for row, values in zip(rows, expected, strict=True):
            assert row[1:] == [f"{values[name]:.{digits}f}" for name, (_, digits) in columns.items()]
    assert len(page.rows) == 5 * len(TABLES)


def test_the_page_holds_the_whole_protocol_and_what_is_beside_it(page: Page) -> None:
    said = dict(
        zip([t for kind, t in page.pairs if kind == "dt"], [t for kind, t in page.pairs if kind == "dd"], strict=True)
    )
    assert said["masks"] == "visib"
    assert said["backend"] == "attributes"
    assert said["auc thresholds m"] == "0.1, 0.02"
    assert said["models refused"] == "-"
    assert (said["median"], said["stages"], said["python"]) == ("31.2", "matching: 4.5", "3.11")


def test_a_metric_that_was_not_measured_is_a_dash(tmp_path: Path) -> None:
    some = {"add_auc": 50.0, "adds_auc": float("nan"), "instances": 3}
    scores = Scores({}, some, some, {"mug": some}, ())
    write_html(tmp_path / "report.html", scores, {}, "empty")
    rows = Page((tmp_path / "report.html").read_text()).rows
    assert [row[1:] for row in rows[1:4]] == [["50.0", "-", "-", "-", "-", "3", "-", "-"]] * 3
    assert {cell for row in (*rows[5:8], *rows[9:]) for cell in row[1:]} == {"-"}


def test_the_curve_is_the_share_of_instances_under_each_error() -> None:
    errors_m = np.array([row.add_m for row in ROWS])
    (points,) = re.findall(r'<polyline points="([^"]+)"', error_curve({"ADD": errors_m}))
    places = np.array([[float(number) for number in pair.split(",")] for pair in points.split()])
    limits_mm = (places[:, 0] - places[0, 0]) / np.ptp(places[:, 0]) * 20
    shares = (places[0, 1] - places[:, 1]) / (places[0, 1] - 28)  # from the lower edge to the upper one, 28 pixels down
    expected = [(errors_m * 1000 <= limit + 1e-6).mean() for limit in limits_mm]
    assert np.allclose(shares, expected, atol=0.01)
    assert shares[-1] == pytest.approx(0.6)


def test_every_instance_is_a_dot_in_its_scene_and_missing_poses_are_on_the_upper_edge() -> None:
    plots = error_over_time(ROWS).split("</svg>")
    dots = [re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)".*?<title>([^<]+)', plot) for plot in plots]
    assert [len(of_scene) for of_scene in dots] == [4, 1, 0]
    heights = [float(y) for _, y, _ in dots[0]]
    assert heights == sorted(heights, reverse=True)  # larger errors are higher up
    assert heights[3] == float(dots[1][0][1])  # a missing pose and one that is far off
    assert dots[0][3][2] == f"object mug, image 3: {LARGEST_MM:.1f} mm"
    columns = [float(x) for x, _, _ in dots[0]]
    assert np.allclose(np.diff(columns), np.diff(columns)[0], atol=0.2)


@pytest.mark.parametrize("rows", [ROWS, ROWS[:1], (instance(5, np.inf),), (instance(0, 0.0),), ()])
def test_plots_stay_inside_their_frame_whatever_the_errors(rows: tuple[InstanceError, ...]) -> None:
    errors_m = np.array([row.add_m for row in rows])
    for drawing in (error_curve({"ADD": errors_m, "ADD-S": errors_m}), error_over_time(rows)):
        assert not re.search(r"\b(nan|inf)\b", drawing)
        for name, limit in (("c?x[12]?", WIDTH), ("c?y[12]?", HEIGHT)):
            assert all(0 <= float(n) <= limit for n in re.findall(rf' {name}="([^"]+)"', drawing))
        for points in re.findall(r'points="([^"]+)"', drawing):
            x, y = np.array([float(n) for n in NUMBERS.findall(points)]).reshape(-1, 2).T
            assert 0 <= x.min() <= x.max() <= WIDTH
            assert 0 <= y.min() <= y.max() <= HEIGHT


def test_names_are_escaped_in_plots() -> None:
    Page(error_over_time([instance(0, 0.001, object_id='<i> & "x"')]))


def test_the_file_of_scores_has_the_layout_that_others_rely_on(tmp_path: Path) -> None:
    write_scores(tmp_path / "scores.json", SCORES, EXTRA)
    content = json.loads((tmp_path / "scores.json").read_text())
    assert set(content) == {"protocol", "metrics", "latency_ms", "environment"}
    assert content["protocol"] == SCORES.protocol
    assert content["metrics"]["pooled"] == SCORES.pooled
    assert content["metrics"]["mean_of_objects"] == SCORES.mean_of_objects
    assert content["metrics"]["per_object"] == SCORES.per_object
    assert content["latency_ms"] == EXTRA["latency_ms"]


def test_what_json_cannot_hold_is_null_or_refused(tmp_path: Path) -> None:
    scores = Scores({}, {"add_auc": float("nan")}, {}, {}, ())
    write_scores(tmp_path / "scores.json", scores, {})
    assert json.loads((tmp_path / "scores.json").read_text())["metrics"]["pooled"] == {"add_auc": None}
    with pytest.raises(ValueError, match="JSON"):
        write_scores(tmp_path / "other.json", scores, {"latency_ms": float("inf")})
    assert not (tmp_path / "other.json").exists()


def test_the_tables_of_the_terminal_have_a_row_an_object_and_the_two_summaries() -> None:
    for drawn, (_, columns, _) in zip(tables(SCORES, "Tracking"), TABLES, strict=True):
        names, *cells_of = (list(column.cells) for column in drawn.columns)
        assert names == ["mug", "a <b> & 'c'", "mean of objects", "pooled"]
        values = (*SCORES.per_object.values(), SCORES.mean_of_objects, SCORES.pooled)
        for cells, (name, (_, digits)) in zip(cells_of, columns.items(), strict=True):
            assert cells == [f"{v[name]:.{digits}f}" for v in values]


@pytest.mark.parametrize("which", range(len(TABLES)))
def test_the_tables_fit_a_terminal_of_eighty_columns(which: int) -> None:
    console = Console(width=80)
    with console.capture() as captured:
        console.print(tables(SCORES, "Tracking")[which])
    (line,) = [line for line in captured.get().splitlines() if line.strip().startswith("pooled")]
    columns = TABLES[which][1]
    assert NUMBERS.findall(line) == [f"{SCORES.pooled[name]:.{digits}f}" for name, (_, digits) in columns.items()]


def test_the_environment_is_told_by_versions() -> None:
    told = environment()
    assert told["python"].startswith("3.")
    assert told["numpy"] == version("numpy")
    assert {"machine", "torch", "scipy", "open3d", "small_gicp", "filterpy"} <= set(told)
