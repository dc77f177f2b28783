"""Text on disk: numbers whatever separates them, rigid motions, and the file's name in every complaint."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.recordings import pose, write_matrix
from tracker.errors import SourceError
from tracker.sources.text_files import (
    is_whole,
    path_within,
    read_lines,
    read_numbers,
    read_points,
    read_pose,
    require_plain_name,
)


def write(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_lines_come_without_blanks_and_without_blank_ones(tmp_path: Path) -> None:
    assert read_lines(write(tmp_path / "a.txt", " one \r\n\n\ttwo words\n  \n")) == ["one", "two words"]


def test_numbers_are_counted_whatever_separates_them(tmp_path: Path) -> None:
    path = write(tmp_path / "a.txt", "1 2.5\n-3e2\t4\n")
    assert read_numbers(path, 4).tolist() == [1, 2.5, -300, 4]
    with pytest.raises(SourceError, match=r"a\.txt: expected 3 numbers, got 4"):
        read_numbers(path, 3)


@pytest.mark.parametrize(("content", "complaint"), [("1 two", "could not convert"), (b"\xff\x00", "not text")])
def test_what_is_no_number_is_named_with_its_file(tmp_path: Path, content: str | bytes, complaint: str) -> None:
    with pytest.raises(SourceError, match=rf"a\.txt: .*{complaint}"):
        read_numbers(write(tmp_path / "a.txt", content), 2)
    with pytest.raises(SourceError, match=r"nowhere\.txt: cannot be read"):
        read_numbers(tmp_path / "nowhere.txt", 2)


def test_points_are_rows_of_three_finite_numbers(tmp_path: Path) -> None:
    assert read_points(write(tmp_path / "a.xyz", "0 1 2\n3 4 5\n")).tolist() == [[0, 1, 2], [3, 4, 5]]
    for content in ("0 1 2 3", "", "0 1 nan"):
        with pytest.raises(SourceError, match=r"a\.xyz: expected three finite numbers a point"):
            read_points(write(tmp_path / "a.xyz", content))


def test_a_scale_is_left_out_only_where_there_may_be_one(tmp_path: Path) -> None:
    matrix = pose(0.1).matrix
    matrix[:3, :3] *= 0.27
    write_matrix(tmp_path / "a.txt", matrix)
    assert np.allclose(read_pose(tmp_path / "a.txt", scaled=True).matrix, pose(0.1).matrix)
    with pytest.raises(SourceError, match=r"a\.txt: not a rotation"):
        read_pose(tmp_path / "a.txt")


@pytest.mark.parametrize("name", ["/etc/passwd", "../a.png", "rgb/../../a.png", "rgb/..", "a\0.png", "a\n.png"])
def test_a_file_that_a_list_names_is_in_the_folder(name: str, tmp_path: Path) -> None:
    assert path_within(tmp_path, "rgb/1.5.png", "rgb.txt") == tmp_path / "rgb" / "1.5.png"
    assert path_within(tmp_path, "a..b.png", "rgb.txt") == tmp_path / "a..b.png"
    with pytest.raises(SourceError, match=r"^rgb\.txt: .* is not in "):
        path_within(tmp_path, name, "rgb.txt")


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "../mug", "a\0b", "x" * 300])
def test_a_thing_that_folders_are_called_after_leads_to_no_other(name: str) -> None:
    require_plain_name("025_mug", "classes.txt")
    require_plain_name("größte Tasse..", "classes.txt")
    with pytest.raises(SourceError, match=r"^classes\.txt: .* cannot be the name of a folder"):
        require_plain_name(name, "classes.txt")


def test_whole_numbers_are_those_that_everybody_writes_so() -> None:
    assert all(map(is_whole, ("0", "000012", "9" * 18)))
    assert not any(map(is_whole, ("", "-1", "1.0", "1_0", "٣", "²", "9" * 19)))
