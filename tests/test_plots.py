"""Charts draw what the numbers say, inside their frame, and legibly on a phone."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from eval.frame_record import FrameRecord
from eval.instances import InstanceError
from eval.page import STYLE
from eval.plots.error_curve import error_curve, error_curves
from eval.plots.error_over_time import error_over_time
from eval.plots.figure import LETTERS, WIDTH
from eval.plots.object_bars import object_bars
from eval.plots.reliability_diagram import reliability_diagram
from eval.plots.stage_timings import stage_timings
from eval.reliability import ConfidenceBin, Reliability
from eval.score import Scores

HOSTILE = '<i onload="x()"> & "y"'


def instance(image_id: int, add_m: float, object_id: str = "mug", scene_id: int = 1) -> InstanceError:
    missing = not np.isfinite(add_m)
    errors = (0.12, add_m, add_m / 2, 1.0, add_m, missing, 1.0, add_m, 5.0, 0.5, False, None)
    return InstanceError(scene_id, image_id, object_id, *errors)


def record(image_id: int, state: str, confidence: float, object_id: str = "mug") -> FrameRecord:
    return FrameRecord(1, image_id, object_id, state, confidence, "")


def numbers(drawing: str, attribute: str) -> list[float]:
    return [float(number) for number in re.findall(rf' {attribute}="([^"]+)"', drawing)]


ROWS = (instance(0, 0.001), instance(1, 0.006), instance(2, 0.015), instance(3, np.inf), instance(7, 0.3, scene_id=4))
STATES = (record(0, "initialising", 0.0), record(1, "tracking", 0.9), record(2, "tracking", 0.8), record(5, "lost", 0))


def test_the_curve_is_the_share_of_instances_under_each_error() -> None:
    errors_m = np.array([row.add_m for row in ROWS])
    (points,) = re.findall(r'<polyline points="([^"]+)"', error_curve({"ADD": errors_m}, 0.02, {"ADD": 61.25}))
    places = np.array([[float(number) for number in pair.split(",")] for pair in points.split()])
    limits_mm = (places[:, 0] - places[0, 0]) / np.ptp(places[:, 0]) * 20
    shares = (places[0, 1] - places[:, 1]) / (190 - 26)  # from the lower edge to the upper one
    away = np.abs(limits_mm[:, None] - errors_m * 1000).min(axis=1) > 0.02  # beside the steps themselves
    expected = np.array([(errors_m * 1000 <= limit).mean() for limit in limits_mm])
    assert np.allclose(shares[away], expected[away], atol=0.01)
    assert shares[-1] == pytest.approx(0.6, abs=1e-3)


def test_each_curve_names_its_area_as_the_tables_have_it() -> None:
    pooled = {"add_auc": 71.26, "adds_auc": 81.0, "add_auc_2cm": 31.0, "adds_auc_2cm": 41.0, "add_or_adds_auc": 75.0}
    coarse, fine = error_curves(ROWS, pooled).split("</figure>")[:2]
    assert all(said in coarse for said in ("ADD 71.3", "ADD-S 81.0", "ADD(-S) 75.0"))
    assert all(said in fine for said in ("ADD 31.0", "ADD-S 41.0"))
    undeclared = [replace(row, symmetric=None) for row in ROWS]
    assert "ADD(-S)" not in error_curves(undeclared, pooled)


def test_every_instance_is_a_dot_in_its_scene_and_missing_poses_are_on_the_upper_edge() -> None:
    plots = error_over_time(ROWS, ()).split("</figure>")
    dots = [re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)".*?<title>([^<]+)', plot) for plot in plots]
    assert [len(of_scene) for of_scene in dots] == [4, 1, 0]
    heights = [float(y) for _, y, _ in dots[0]]
    assert heights == sorted(heights, reverse=True)  # larger errors are higher up
    assert heights[3] == float(dots[1][0][1])  # a missing pose and one that is far off
    assert [title for _, _, title in dots[0]][2:] == ["mug, image 2: 15.0 mm", "mug, image 3: no pose"]
    columns = [float(x) for x, _, _ in dots[0]]
    assert np.allclose(np.diff(columns), np.diff(columns)[0], atol=0.2)


def test_states_are_bands_from_where_they_begin_to_where_another_does() -> None:
    drawing = error_over_time(ROWS[:4], STATES)
    bands = re.findall(r'<rect x="([\d.]+)" .*?width="([\d.]+)".*?<title>mug: (\w+) from image (\d+)', drawing)
    assert [(state, int(first)) for _, _, state, first in bands] == [("initialising", 0), ("tracking", 1), ("lost", 5)]
    unit = float(bands[0][1])
    assert [float(width) / unit for _, width, _, _ in bands] == pytest.approx([1, 4, 1], abs=0.02)
    assert float(bands[1][0]) == pytest.approx(float(bands[0][0]) + unit, abs=0.11)
    (confidences,) = re.findall(r'<polyline points="([^"]+)"', drawing)
    heights = [float(pair.split(",")[1]) for pair in confidences.split()]
    assert np.argsort(heights).tolist()[:2] == [1, 2]  # the most confident is the highest up
    assert [state for state in ("tracking", "lost", "initialising") if f"is {state}" not in drawing] == []


def test_bars_are_as_long_as_their_values() -> None:
    objects = {"mug": {"add_auc": 50.0, "adds_auc": 100.0}, "a": {"add_auc": 25.0, "adds_auc": math.nan}}
    assert np.array(numbers(object_bars(Scores({}, {}, {}, objects, ())), "width")) == pytest.approx([95, 190, 47.5])
    drawing = stage_timings(40.0, 80.0, {"matching": 20.0, "view": 0.0, "registration": 30.0})
    assert numbers(drawing, "width") == pytest.approx([95, 190, 71.2, 47.5, 0], abs=0.1)  # stages: the slowest first
    assert re.findall(r"<title>(.*?):", drawing)[2:] == ["registration", "matching", "view"]


def test_the_reliability_diagram_has_a_bar_a_bin_that_holds_poses() -> None:
    bins = ConfidenceBin(0, 0.5, 4, 0.25, 0.5), ConfidenceBin(0.5, 1, 12_345, 0.75, 1.0)
    drawing = reliability_diagram(Reliability((*bins, ConfidenceBin(0.9, 1, 0, math.nan, math.nan)), 0.125))
    low, high = numbers(drawing, "height")
    assert high == pytest.approx(2 * low, abs=0.11)
    assert ">4</text>" in drawing
    assert ">12k</text>" in drawing
    assert "calibration error 12.5 % over 12349 poses" in drawing


def all_charts(rows: tuple[InstanceError, ...], records: tuple[FrameRecord, ...]) -> list[str]:
    objects = {HOSTILE: {"add_auc": 120.0, "adds_auc": -1.0}}
    bins = (ConfidenceBin(0, 0.1, 1, 0.0, 0.0), ConfidenceBin(0.9, 1, 1, 1.0, 1.0))
    return [
        error_curves(rows, {}),
        error_over_time(rows, records),
        object_bars(Scores({}, {}, {}, objects, ())),
        reliability_diagram(Reliability(bins, 0.0)),
        stage_timings(0.0, 0.0, {HOSTILE: 0.0}),
    ]


@pytest.mark.parametrize("rows", [ROWS, ROWS[:1], (instance(5, np.inf),), (instance(0, 0.0, HOSTILE),), ()])
@pytest.mark.parametrize("records", [(), STATES])
def test_charts_stay_inside_their_frame_whatever_the_errors(
    rows: tuple[InstanceError, ...], records: tuple[FrameRecord, ...]
) -> None:
    for chart in all_charts(rows, records):
        assert not re.search(r"\b(nan|inf)\b", chart)
        for height, drawing in re.findall(rf'<svg viewBox="0 0 {WIDTH} ([\d.]+)"(.*?)</svg>', chart, re.DOTALL):
            for attribute, limit in (("c?x[12]?", WIDTH), ("c?y[12]?", float(height))):
                assert all(0 <= n <= limit for n in numbers(drawing, attribute))
            for points in re.findall(r'points="([^"]+)"', drawing):
                x, y = np.array([float(n) for n in re.split("[ ,]", points)]).reshape(-1, 2).T
                assert 0 <= x.min() <= x.max() <= WIDTH
                assert 0 <= y.min() <= y.max() <= float(height)


class Names(HTMLParser):
    """The elements of a drawing; fails where one has a handler of events."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.add(tag)
        assert not [name for name, _ in attrs if name.startswith("on")]


def test_names_are_escaped_in_charts() -> None:
    records = tuple(replace(each, object_id=HOSTILE) for each in STATES)
    for chart in all_charts((instance(0, 0.001, HOSTILE),), records):
        assert HOSTILE not in chart
        assert Names(chart).found <= {"figure", "figcaption", "svg", "title", "text", "line", "rect", "g", "circle",
                                      "polyline", "p", "span", "i"}  # fmt: skip


def test_letters_are_no_smaller_than_eleven_pixels_on_a_phone() -> None:
    assert f"svg text {{ fill: var(--ink); font: {LETTERS}px" in STYLE
    assert LETTERS * (360 - 2 * 16) / WIDTH > 11  # between the page's margins
