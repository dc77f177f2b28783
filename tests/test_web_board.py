"""What is kept of the frames: enough for a chart and the lines of poses, and no more."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.test_overlay import T_CAM_OBJ, plain, result
from tracker.output import as_json_line
from tracker.web import board
from tracker.web.board import CHARTED_S, Board, as_row, as_sample, packet

SECOND_NS = 1_000_000_000


def filled(*stamps_s: float) -> Board:
    full = Board()
    for index, stamp_s in enumerate(stamps_s):
        stamp_ns = round(stamp_s * SECOND_NS)
        frame = replace(plain(index=10 + index), stamp_ns=stamp_ns)
        full.put(frame, [replace(result(T_CAM_OBJ), stamp_ns=stamp_ns)], {})
    return full


def test_the_newest_frame_is_shown_and_frames_are_counted_from_one() -> None:
    full = filled(0, 1, 2)
    assert full.newest is not None
    assert (full.newest.number, full.newest.frame.index) == (3, 12)
    assert Board().newest is None


def test_a_chart_gets_what_it_has_not_had_of_the_last_minute() -> None:
    full = filled(0, 1, CHARTED_S, CHARTED_S + 2)
    assert [past.index for past in full.since(0)] == [12, 13]  # 2 s are the oldest of that minute
    assert [past.index for past in full.since(3)] == [13]
    assert full.since(4) == []
    assert Board().since(0) == []


def test_lines_are_those_of_the_result_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(board, "MOST_FRAMES", 2)
    lines = list(filled(0, 1, 2).lines())
    assert [json.loads(line)["frame"] for line in lines] == [11, 12]
    assert lines[1] == as_json_line(replace(result(T_CAM_OBJ), stamp_ns=2 * SECOND_NS), 12) + "\n"


def test_no_pictures_are_kept_of_what_is_past() -> None:
    (past,) = filled(0).since(0)
    assert past.results[0].surface is None
    assert past.results[0].step is None


def test_the_listener_is_called_after_every_frame() -> None:
    full, heard = Board(), list[int]()
    full.listener = lambda: heard.append(full.newest.number if full.newest else 0)
    for index in range(3):
        full.put(plain(index=index), [], {})
    assert heard == [1, 2, 3]


def test_the_rate_is_of_the_frames_that_were_put(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = iter(np.arange(40) * 0.05)
    monkeypatch.setattr(board.time, "monotonic", lambda: float(next(now_s)))
    assert Board().rate_hz() == 0
    assert filled(0).rate_hz() == 0
    assert filled(*range(10)).rate_hz() == pytest.approx(20)


def test_a_row_is_in_millimetres_and_degrees() -> None:
    deviations = np.array([0.01, 0.02, 0.02, 0.001, 0.002, 0.002])
    row = as_row(replace(result(T_CAM_OBJ), covariance=np.diag(deviations**2)))
    assert row["position_mm"] == pytest.approx(T_CAM_OBJ.translation_m * 1e3, abs=0.01)
    assert row["quaternion_wxyz"] == pytest.approx(T_CAM_OBJ.quaternion_wxyz, abs=1e-4)
    assert row["sigma_mm"] == pytest.approx(3.0)
    assert row["sigma_deg"] == pytest.approx(np.degrees(0.03), abs=0.01)
    unknown = as_row(replace(result(T_CAM_OBJ), covariance=np.diag([np.inf] * 6)))
    assert (unknown["sigma_mm"], unknown["sigma_deg"]) == (None, None)  # JSON has no word for it


def test_a_lost_object_has_a_reason_and_no_numbers() -> None:
    row = as_row(result(None, "out of view"))
    assert (row["state"], row["reason"], row["position_mm"], row["sigma_mm"]) == ("lost", "out of view", None, None)
    (past,) = filled(1.5).since(0)
    assert as_sample(past) == [1.5, [["tracking", 0.87]]]


def test_a_packet_is_taken_apart_by_its_first_four_bytes() -> None:
    told = packet({"object": "Tasse"}, b"\xff\xd8picture")
    length = int.from_bytes(told[:4], "little")
    assert json.loads(told[4 : 4 + length]) == {"object": "Tasse"}
    assert told[4 + length :] == b"\xff\xd8picture"
