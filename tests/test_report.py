"""Scores as a file and as tables; a page that stands alone, and Markdown that says the same."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from eval.frame_record import FrameRecord
from eval.html_report import write_html
from eval.html_tables import html_table
from eval.instances import InstanceError
from eval.markdown_report import write_markdown
from eval.published import PUBLISHED
from eval.reliability import reliability
from eval.report import Report, write_scores
from eval.score import Metrics, Scores
from eval.score_tables import TABLES, tables
from eval.worst_frames import missing_poses, worst_instances
from eval.worst_pictures import WorstFrame, jpeg

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
        if {"td", "th"} & set(self.open):
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
RECORDS = tuple(
    FrameRecord(r.scene_id, r.image_id, r.object_id, "lost" if r.missing else "tracking", 0.0 if r.missing else 0.85,
                "too few <matches> | 3 of 12" if r.missing else "")
    for r in ROWS
)  # fmt: skip
PICTURE = jpeg(np.full((240, 320, 3), 90, np.uint8))
EXTRA = {"latency_ms": {"median": 31.25, "p95": 48.0, "stages": {"matching": 4.5}}, "environment": {"python": "3.11"}}


REPORT = Report(
    "Tracking <synthetic> & more",
    SCORES,
    EXTRA,
    RECORDS,
    anchors=("not the same data",) * len(PUBLISHED),
    why_not_ycbv="synthetic is not YCB-V",
    reliability=reliability(ROWS, {(r.scene_id, r.object_id, r.image_id): r.confidence for r in RECORDS}),
    worst=tuple(WorstFrame(row, 0.85, PICTURE) for row in worst_instances(ROWS)),
    missing=tuple(missing_poses(ROWS, RECORDS)),
)
BARE = Report("mine.csv", SCORES, {"environment": {"python": "3.11"}}, missing=tuple(missing_poses(ROWS, ())))
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)


def read(report: Report, folder: Path) -> Page:
    write_html(folder / "report.html", report)
    return Page((folder / "report.html").read_text(encoding="utf-8"))


@pytest.fixture
def page(tmp_path: Path) -> Page:
    return read(REPORT, tmp_path)


def test_the_page_is_well_formed_and_says_what_it_is(page: Page) -> None:
    assert page.tags[0][0] == "html"
    assert page.text.count("Tracking <synthetic> & more") == 2  # title and heading, escaped
    assert {"table", "svg", "dl", "h1", "h2", "img"} <= {tag for tag, _ in page.tags}


def test_the_page_stands_alone(page: Page, tmp_path: Path) -> None:
    text = re.sub(r'src="data:image/jpeg;base64,[\w+/=]+"', "", (tmp_path / "report.html").read_text(encoding="utf-8"))
    assert not {"link", "iframe", "object", "a"} & {tag for tag, _ in page.tags}
    assert not {"href", "srcset", "data"} & {name for _, attributes in page.tags for name in attributes}
    assert not [name for _, attributes in page.tags for name in attributes if name.startswith("on")]
    assert not re.search(r"https?:|//|@import|url\(|\bsrc=|fetch|XMLHttp", text)
    policies = [a["content"] or "" for tag, a in page.tags if tag == "meta" and "http-equiv" in a]
    assert [policy.partition(";")[0] for policy in policies] == ["default-src 'none'"]


def test_the_tables_of_the_page_hold_the_numbers(page: Page) -> None:
    for k, (_, columns, _) in enumerate(TABLES):
        heading, *rows = page.rows[5 * k : 5 * k + 5]
        assert heading == ["object", *(name for name, _ in columns.values())]
        assert [row[0] for row in rows] == ["mug", "a <b> & 'c'", "mean of objects", "pooled"]
        expected = (*SCORES.per_object.values(), SCORES.mean_of_objects, SCORES.pooled)
        for row, values in zip(rows, expected, strict=True):
            assert row[1:] == [f"{values[name]:.{digits}f}" for name, (_, digits) in columns.items()]


def test_published_numbers_stand_beside_the_run_s_with_what_they_depend_on(page: Page) -> None:
    start = page.rows.index(["method", "ADD", "ADD-S", "data"])
    ours, *others = page.rows[start + 1 : start + 2 + len(PUBLISHED)]
    assert ours == ["this run", f"{SCORES.pooled['add_auc']:.1f}", f"{SCORES.pooled['adds_auc']:.1f}", "-"]
    assert ["ConceptPose", "90.1", "95.4", "not the same data"] in others
    assert ["PoseCNN+ICP", "79.3", "93.0", "not the same data"] in others
    assert "Not the same data: synthetic is not YCB-V." in page.text
    assert all(published.convention in page.text for published in PUBLISHED)


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
    rows = read(Report("empty", Scores({}, some, some, {"mug": some}, ()), {}), tmp_path).rows
    assert [row[1:] for row in rows[1:4]] == [["50.0", "-", "-", "-", "-", "3", "-", "-"]] * 3
    assert {cell for row in (*rows[5:8], *rows[9:]) for cell in row[1:]} == {"-"}


SECTIONS = (
    "How large are the errors?",
    "When do they happen?",
    "Is the confidence",
    "Where does the time go?",
    "Worst f",
)


def test_a_section_without_data_is_one_line_that_says_why(page: Page, tmp_path: Path) -> None:
    assert [section for section in SECTIONS if section not in page.text] == []
    assert not re.search(r"\bNo (reliability|stage|drawing|comparison)", page.text)
    bare = read(BARE, tmp_path)
    assert [section for section in SECTIONS if section in bare.text] == list(SECTIONS[:2])
    lines = (
        "No reliability diagram: no pose",
        "No stage timings: nothing was timed",
        "No drawing of worst frames",
        "No states",
    )
    assert [line for line in lines if bare.text.count(line) != 1] == []
    assert ["1", "mug", "1", "the results have no row of it", "3"] in bare.rows
    nothing = read(Report("none", Scores({}, {}, {}, {}, ()), {}), tmp_path)
    assert not [section for section in SECTIONS if section in nothing.text]
    assert "No list of missing poses: every instance has a pose." in nothing.text


def test_worst_frames_are_pictures_with_their_errors_or_say_why_they_are_not(page: Page, tmp_path: Path) -> None:
    pictures = [attributes for tag, attributes in page.tags if tag == "img"]
    assert [p["alt"] for p in pictures] == [f"mug, scene {s}, image {i}" for s, i in ((4, 7), (1, 2), (1, 1), (1, 0))]
    assert "ADD 300.0 mm, 1.0°, 300.0 mm off, confidence 0.85" in page.text
    assert ["1", "mug", "1", "lost: too few <matches> | 3 of 12", "3"] in page.rows
    unread = replace(REPORT, worst=(WorstFrame(ROWS[0], 0.5, None, "<gone>"),))
    assert "No picture: <gone>" in read(unread, tmp_path).text


def markdown_tables(text: str) -> list[list[list[str]]]:
    """The cells of every table, as they are read on GitHub."""
    blocks = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    cells = [[re.split(r"(?<!\\)\|", line)[1:-1] for line in block.splitlines()] for block in blocks]
    return [[[re.sub(r"\\(.)", r"\1", c.strip().strip("*")) for c in row] for row in block] for block in cells]


def test_the_markdown_says_what_the_json_says(tmp_path: Path) -> None:
    write_markdown(tmp_path / "report.md", REPORT)
    write_scores(tmp_path / "scores.json", SCORES, EXTRA)
    metrics = json.loads((tmp_path / "scores.json").read_text())["metrics"]
    expected = {**metrics["per_object"], "mean of objects": metrics["mean_of_objects"], "pooled": metrics["pooled"]}
    found = markdown_tables((tmp_path / "report.md").read_text(encoding="utf-8"))
    for (_, columns, _), (heading, aligned, *rows) in zip(TABLES, found[: len(TABLES)], strict=True):
        assert heading == ["object", *(name for name, _ in columns.values())]
        assert len(aligned) == len(heading)
        assert [row[0] for row in rows] == list(expected)
        for name, *row in rows:
            assert row == [f"{expected[name][key]:.{digits}f}" for key, (_, digits) in columns.items()]


def test_the_markdown_has_the_page_s_other_tables_and_the_protocol(tmp_path: Path) -> None:
    write_markdown(tmp_path / "report.md", REPORT)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    rows = [row for block in markdown_tables(text) for row in block]
    assert {len({len(row) for row in block}) for block in markdown_tables(text)} == {1}
    assert ["PoseCNN", "53.7", "75.9", "not the same data"] in rows
    assert ["0.8 to 0.9", "4", "85.0", "75.0"] in rows
    assert ["whole, p95", "48.0"] in rows
    assert ["4", "7", "mug", "300.0", "150.0", "1.0", "0.85"] in rows
    assert ["1", "mug", "1", "lost: too few <matches> | 3 of 12", "3"] in rows
    assert "- masks: visib\n" in text
    write_markdown(tmp_path / "bare.md", BARE)
    assert "Worst frames" not in (tmp_path / "bare.md").read_text(encoding="utf-8")


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium, chromium-browser, google-chrome or chrome on this machine")
def test_a_browser_sorts_its_tables_decodes_its_pictures_and_has_nothing_to_complain_of(tmp_path: Path) -> None:
    values = ("9.5", "10.25", "-", "100")
    objects = {f"o{k}": {"add_auc": float("nan" if v == "-" else v)} for k, v in enumerate(values)}
    write_html(tmp_path / "report.html", replace(REPORT, scores=replace(SCORES, per_object=objects)))
    asked = """<script>
const table = document.querySelector("table.sortable"), heading = table.tHead.rows[0].cells[1];
const names = () => [...table.rows].slice(1).map((row) => row.cells[0].textContent).join(" ");
const told = [names()];
for (let k = 0; k < 2; k++) { heading.querySelector("button").click(); told.push(heading.ariaSort + " " + names()); }
const grouped = [...document.querySelectorAll("table.sortable")].at(-1);
grouped.tHead.rows[1].cells[1].querySelector("button").click();
told.push([...grouped.tBodies[0].rows].map((row) => row.cells[0].textContent).join(" "));
told.push([...document.images].map((image) => image.naturalWidth).join(" "));
document.title = told.join("; ");
</script>"""
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    below = html_table(("", "a"), [("x", "2"), ("y", "1")], groups=[("", 1), ("hard", 1)])
    text = text.replace("\n<script>", f"{below}\n<script>", 1)
    (tmp_path / "asked.html").write_text(text.replace("</body>", f"{asked}</body>"), encoding="utf-8")
    line = (str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0")
    line += (f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", (tmp_path / "asked.html").as_uri())
    ran = subprocess.run(line, capture_output=True, text=True, timeout=120, check=True)  # noqa: S603
    assert "CONSOLE" not in ran.stderr, ran.stderr
    (title,) = re.findall(r"<title>(.*?)</title>\n<style>", ran.stdout)
    totals = "mean of objects pooled"
    before, ascending, descending, below_groups, widths = title.split("; ")
    assert before == f"o0 o1 o2 o3 {totals}"
    assert ascending == f"ascending o0 o1 o3 o2 {totals}"
    assert descending == f"descending o3 o1 o0 o2 {totals}"
    assert below_groups == "y x"
    assert widths == "320 320 320 320"


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
