"""BOP's result file: what is written comes back bit for bit, and what is wrong in a file is named with its line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eval.bop_results import Estimate, read_results, write_results
from tracker.errors import OutputError, SourceError
from tracker.geometry import Pose

HEADER = "scene_id,im_id,obj_id,score,R,t,time"
ROW = "48,1,2,0.9,1 0 0 0 1 0 0 0 1,10.5 -20 843.113,-1"
ESTIMATE = Estimate(48, 1, 2, 0.9, Pose(np.eye(3), np.array([0.0105, -0.02, 0.843113])))

numbers = st.integers(0, 10**6)
twists = st.lists(st.floats(-3, 3), min_size=6, max_size=6)
poses = st.builds(
    lambda twist, t_m: Pose(Pose.exp(twist).rotation, np.array(t_m)),
    twists,
    st.lists(st.floats(-100, 100), min_size=3, max_size=3),
)
estimates = st.builds(Estimate, numbers, numbers, numbers, st.floats(-1e6, 1e6), poses, st.just(-1.0))


def bits(estimate: Estimate) -> tuple[int, int, int, bytes]:
    pose = estimate.T_cam_obj
    values = (estimate.score, estimate.time_s, *pose.rotation.ravel(), *pose.translation_m)
    return estimate.scene_id, estimate.image_id, estimate.object_id, np.array(values, np.float64).tobytes()


def written(tmp_path: Path, *lines: str) -> Path:
    path = tmp_path / "conceptrack_rbt-test.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@given(estimates=st.lists(estimates, max_size=4, unique_by=lambda e: (e.scene_id, e.image_id, e.object_id)))
def test_a_round_trip_is_exact_to_the_bit_and_to_the_byte(estimates: list[Estimate]) -> None:
    with TemporaryDirectory() as folder:
        first, second = Path(folder) / "first.csv", Path(folder) / "second.csv"
        write_results(first, estimates)
        read = read_results(first)
        write_results(second, read)
        assert [bits(e) for e in read] == [bits(e) for e in estimates]
        assert first.read_bytes() == second.read_bytes()


def test_a_file_is_laid_out_as_bop_has_it(tmp_path: Path) -> None:
    write_results(tmp_path / "a.csv", [ESTIMATE])
    assert (tmp_path / "a.csv").read_text().splitlines() == [
        HEADER,
        "48,1,2,0.9,1.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 1.0,10.5 -20 843.113,-1.0",
    ]


def test_a_foreign_file_is_read_in_metres_with_its_columns_in_any_order(tmp_path: Path) -> None:
    header, row = "\ufeffR,t, im_id,scene_id,obj_id,time,score", "1 0 0 0 1 0 0 0 1, 1e2 2  3.5,1,48,2,0.25,1"
    path = written(tmp_path, header, row, "")
    (estimate,) = read_results(path)
    assert (estimate.scene_id, estimate.image_id, estimate.object_id) == (48, 1, 2)
    assert (estimate.score, estimate.time_s) == (1, 0.25)
    assert estimate.T_cam_obj.translation_m.tolist() == [0.1, 0.002, 0.0035]


def test_a_file_of_a_header_alone_has_no_estimates(tmp_path: Path) -> None:
    assert read_results(written(tmp_path, HEADER)) == []


def test_several_estimates_of_one_object_are_all_read(tmp_path: Path) -> None:
    assert len(read_results(written(tmp_path, HEADER, ROW, ROW.replace("0.9", "0.8")))) == 2


def test_a_row_that_is_there_twice_is_named_with_the_first_one(tmp_path: Path) -> None:
    others = ROW.replace("48,1", "48,2"), ROW.replace("10.5", "10.6")
    with pytest.raises(OutputError, match=r"rbt-test\.csv, line 5: the same estimate as in line 2"):
        read_results(written(tmp_path, HEADER, ROW, *others, ROW))


def test_an_image_has_one_time(tmp_path: Path) -> None:
    timed = [ROW.replace("-1", "0.25"), ROW.replace("-1", "0.25").replace("48,1,2", "48,1,3")]
    assert [e.time_s for e in read_results(written(tmp_path, HEADER, *timed, ROW.replace("48,1", "48,2")))] == [
        0.25,
        0.25,
        -1,
    ]
    with pytest.raises(OutputError, match=r"rbt-test\.csv, line 4: time is -1 s, in line 2 0\.25 s"):
        read_results(written(tmp_path, HEADER, *timed, ROW.replace("48,1,2", "48,1,4")))


def test_what_a_check_refuses_is_named_by_its_line(tmp_path: Path) -> None:
    def only_object_2(estimate: Estimate) -> None:
        if estimate.object_id != 2:
            raise SourceError(f"no object {estimate.object_id}")

    path = written(tmp_path, HEADER, ROW, ROW.replace("48,1,2", "48,1,7"))
    with pytest.raises(OutputError, match=r"rbt-test\.csv, line 3: no object 7"):
        read_results(path, only_object_2)


@pytest.mark.parametrize("digits", [3, 4, 6])
def test_rounded_rotations_are_taken_as_they_are(tmp_path: Path, digits: int) -> None:
    rotation = np.round(Pose.exp([0.5, 1.0, -0.7, 0, 0, 0]).rotation, digits)
    text = " ".join(map(str, rotation.ravel()))
    (estimate,) = read_results(written(tmp_path, HEADER, f"1,1,1,1,{text},0 0 900,-1"))
    assert (estimate.T_cam_obj.rotation == rotation).all()


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("48,1,2,0.9,1 0 0 0 1 0 0 0 1,1 2 3", "6 values, the header has 7"),
        ("48,1,2,0.9,1 0 0 0 1 0 0 0 1,1 2 3,-1,7", "8 values"),
        ("48,1,2,0.9,1 0 0 0 1 0 0 0,1 2 3,-1", "R has 8 numbers, expected 9"),
        ("48,1,2,0.9,1 0 0 0,1 2 3,-1", "quaternion"),
        ("48,1,2,0.9,1 0 0 0 1 0 0 0 1,1 2,-1", "t has 2 numbers, expected 3"),
        ("48,1,2,0.9,1 0 0 0 1 0 0 0 nan,1 2 3,-1", "R is .* expected finite"),
        ("48,1,2,0.9,1 0 0 0 1 0 0 0 1,1 2 inf,-1", "t is .* expected finite"),
        ("48,1,2,0.9,1 0 0 0 1 0 0 0 1,1 2 x,-1", "t: .*'x'"),
        ("48,1,2,nan,1 0 0 0 1 0 0 0 1,1 2 3,-1", "score is"),
        ("48,1,2,,1 0 0 0 1 0 0 0 1,1 2 3,-1", "score has 0 numbers"),
        ("48,1,2,1,1 0 0 0 1 0 0 0 1,1 2 3,soon", "time: "),
        ("48,1,2,0.9,1 0 0 0 1 0 0 0 -1,1 2 3,-1", "not a rotation.*det R = -1"),
        ("48,1,2,0.9,2 0 0 0 2 0 0 0 2,1 2 3,-1", "not a rotation"),
        ("48,1,2,0.9,0 0 0 0 0 0 0 0 0,1 2 3,-1", "not a rotation"),
        ("48,1.0,2,0.9,1 0 0 0 1 0 0 0 1,1 2 3,-1", "im_id is '1.0'"),
        ("48,1,mug,0.9,1 0 0 0 1 0 0 0 1,1 2 3,-1", "obj_id is 'mug'"),
        ("-1,1,2,0.9,1 0 0 0 1 0 0 0 1,1 2 3,-1", "scene_id is '-1'"),
        ('48,1,2,0.9,"1 0 0 0 1 0 0 0 1,1 2 3,-1', "unexpected end of data"),
    ],
)
def test_a_damaged_row_is_named_by_its_line(tmp_path: Path, row: str, complaint: str) -> None:
    with pytest.raises(OutputError, match=rf"rbt-test\.csv, line 3: .*{complaint}"):
        read_results(written(tmp_path, HEADER, ROW, row))


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        ([HEADER.replace(",t,", ","), ROW], "no column t;"),
        ([ROW], "no column scene_id, im_id"),
        ([""], "no column scene_id"),
    ],
)
def test_a_missing_column_is_named(tmp_path: Path, lines: list[str], complaint: str) -> None:
    with pytest.raises(OutputError, match=f"line 1: {complaint}"):
        read_results(written(tmp_path, *lines))


def test_what_is_no_text_and_what_is_not_there_are_errors(tmp_path: Path) -> None:
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\r\n\xff\xfe")
    with pytest.raises(OutputError, match=r"picture\.csv, line 1: .*utf-8"):
        read_results(tmp_path / "picture.csv")
    with pytest.raises(OutputError, match=r"nothing\.csv: cannot be read"):
        read_results(tmp_path / "nothing.csv")


def test_translations_that_look_like_metres_are_warned_of(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    read_results(written(tmp_path, HEADER, "1,1,1,1,1 0 0 0 1 0 0 0 1,0.1 0 0.9,-1"))
    assert "is t in metres?" in caplog.text


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        (replace(ESTIMATE, T_cam_obj=Pose(np.diag([1.0, 1, -1]), np.zeros(3))), "not a rotation"),
        (replace(ESTIMATE, T_cam_obj=Pose(np.eye(3), np.array([0, 0, np.nan]))), "14 finite numbers"),
        (replace(ESTIMATE, T_cam_obj=Pose(np.eye(3), np.zeros(2))), "14 finite numbers"),
        (replace(ESTIMATE, score=np.inf), "14 finite numbers"),
        (replace(ESTIMATE, image_id=-1), "start at 0"),
        (replace(ESTIMATE, object_id=9, time_s=0.5), "another row of this image has another time"),
    ],
)
def test_what_the_format_cannot_hold_is_not_written(tmp_path: Path, wrong: Estimate, complaint: str) -> None:
    path = written(tmp_path, HEADER, ROW)
    before = path.read_bytes()
    with pytest.raises(OutputError, match=complaint):
        write_results(path, [ESTIMATE, wrong])
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"no/a\.csv: cannot be written"):
        write_results(tmp_path / "no" / "a.csv", [ESTIMATE])


def test_a_write_that_fails_half_way_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path, "old")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OutputError, match="cannot be written"):
        write_results(path, [ESTIMATE])
    assert path.read_text() == "old\n"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_is_replaced_whole_and_nothing_stays_beside_it(tmp_path: Path) -> None:
    path = written(tmp_path, "old")
    write_results(path, [ESTIMATE])
    assert bits(read_results(path)[0]) == bits(ESTIMATE)
    assert list(tmp_path.iterdir()) == [path]
