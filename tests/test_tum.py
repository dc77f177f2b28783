"""Recordings in TUM's layout: what belongs together, in metres, with a camera that somebody told, never a guess."""

from __future__ import annotations

import logging
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracker.errors import SourceError
from tracker.sources import Recording, open_source
from tracker.sources.tum import TumFolder

START_S = 1_305_031_102
K = "?K=60,61,23.5,17"


def stamp(k: int, late_us: int = 0) -> str:
    return f"{START_S}.{(k * 33_333 + late_us):06d}"


def write(path: Path, colours: list[str], depths: list[str], size: tuple[int, int] = (36, 48)) -> Path:
    """The k-th colour picture is (k, 20, 30), the k-th depth picture 1 m and k cm."""
    for name, stamps, picture in (
        ("rgb", colours, lambda k: np.full((*size, 3), (30, 20, k), np.uint8)),
        ("depth", depths, lambda k: np.full(size, 5000 + 50 * k, np.uint16)),
    ):
        (path / name).mkdir(parents=True, exist_ok=True)
        for k, each in enumerate(stamps):
            cv2.imwrite(str(path / name / f"{each}.png"), picture(k))
        lines = [f"{each} {name}/{each}.png" for each in stamps]
        (path / f"{name}.txt").write_text("# colour or depth\n# file: 'x.bag'\n" + "\n".join(lines) + "\n")
    return path


def pairs(source: TumFolder) -> list[tuple[int, int]]:
    """Which colour and which depth picture each frame is of."""
    return [(int(f.rgb[0, 0, 0]), round((float(f.depth_m[0, 0]) - 1) * 100)) for f in source]


def test_pictures_of_two_lists_belong_together_by_their_stamps(tmp_path: Path) -> None:
    colours = [stamp(k) for k in (0, 1, 2, 4)]
    depths = [stamp(k, late_us=5_000) for k in (1, 2, 3, 4)]
    source = open_source(f"tum:{write(tmp_path, colours, depths)}{K}")
    assert isinstance(source, TumFolder)
    assert isinstance(source, Recording)
    assert pairs(source) == [(1, 0), (2, 1), (3, 3)]
    frame = source[1]
    assert (len(source), frame.index) == (3, 1)
    assert frame.stamp_ns == START_S * 10**9 + 66_666_000
    assert frame.intrinsics.matrix.tolist() == [[60, 0, 23.5], [0, 61, 17], [0, 0, 1]]
    told = frame.provenance
    assert (told.clock, told.colour_depth_skew_ns, told.raw_depth_unit_m) == ("recording", -5_000_000, 1 / 5000)
    assert told.name == stamp(2)


def test_a_slop_and_a_depth_factor_may_be_given(tmp_path: Path) -> None:
    path = write(tmp_path, [stamp(0)], [stamp(0, late_us=30_000)])
    with pytest.raises(SourceError, match=r"1 and 1 pictures\): no pictures belong together \(within 0.02 s\)"):
        TumFolder(f"{path}{K}")
    (frame,) = TumFolder(f"{path}{K}&slop=0.04&depth_factor=1000")
    assert frame.depth_m == pytest.approx(5)


@pytest.mark.parametrize("name", ["associations.txt", "associated.txt"])
@pytest.mark.parametrize("depth_first", [False, True])
def test_associations_count_where_they_are_there_in_either_order(tmp_path: Path, name: str, depth_first: bool) -> None:
    path = write(tmp_path, [stamp(k) for k in range(3)], [stamp(k) for k in range(3)])
    words = [(f"{stamp(a)} rgb/{stamp(a)}.png", f"{stamp(b)} depth/{stamp(b)}.png") for a, b in ((2, 1), (0, 0))]
    lines = [f"{depth} {colour}" if depth_first else f"{colour} {depth}" for colour, depth in words]
    (path / name).write_text("\n".join(lines) + "\n")
    for of_lists in ("rgb.txt", "depth.txt"):
        (path / of_lists).unlink()
    source = TumFolder(f"{path}{K}")
    assert pairs(source) == [(0, 0), (2, 1)]
    assert source[1].provenance.colour_depth_skew_ns == 33_333_000


def test_pictures_that_are_numbered_have_a_nominal_time(tmp_path: Path) -> None:
    path = write(tmp_path, ["0", "1", "2"], ["0", "1", "2"])
    (path / "associations.txt").write_text("\n".join(f"{k} depth/{k}.png {k} rgb/{k}.png" for k in range(3)))
    frames = list(TumFolder(f"{path}{K}"))
    assert [frame.stamp_ns for frame in frames] == [0, 33_333_333, 66_666_667]
    assert {frame.provenance.clock for frame in frames} == {"nominal"}


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("camera.txt", "# fx fy cx cy\n60 61 23.5 17\n"),
        ("calibration.txt", "60 61 23.5 17"),
        ("cam_K.txt", "60 0 23.5\n0 61 17\n0 0 1\n"),
    ],
)
def test_the_camera_is_that_of_a_file_beside_the_pictures(tmp_path: Path, name: str, text: str) -> None:
    path = write(tmp_path, [stamp(0)], [stamp(0)])
    (path / name).write_text(text)
    assert TumFolder(str(path))[0].intrinsics.matrix.ravel().tolist() == [60, 0, 23.5, 0, 61, 17, 0, 0, 1]
    assert TumFolder(f"{path}?K=70,71,22,18")[0].intrinsics.fx == 70
    (tmp_path / "other.txt").write_text("80 81 22 18")
    assert TumFolder(f"{path}?K={tmp_path}/other.txt")[0].intrinsics.fx == 80


def test_distortion_that_is_told_is_undone(tmp_path: Path) -> None:
    path = write(tmp_path, [stamp(0)], [stamp(0)])
    picture = np.indices((36, 48)).sum(axis=0).astype(np.uint8)
    cv2.imwrite(str(path / "rgb" / f"{stamp(0)}.png"), np.dstack([picture] * 3))
    plain = TumFolder(f"{path}{K}")[0]
    undone = TumFolder(f"{path}{K}&distortion=-0.3,0.1,0,0,0")[0]
    assert (plain.rgb[:, :, 0] == picture).all()
    assert (undone.rgb != plain.rgb).any()


def test_a_camera_of_the_benchmark_is_known_by_the_folder_s_name_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write(tmp_path / "rgbd_dataset_freiburg3_desk", [stamp(0)], [stamp(0)], (480, 640))
    with caplog.at_level(logging.WARNING):
        frame = TumFolder(str(path))[0]
    assert "camera of freiburg3 by its name; say ?K=fx,fy,cx,cy for another" in caplog.text
    assert (frame.intrinsics.fx, frame.intrinsics.fy) == (535.4, 539.2)
    bent = write(tmp_path / "rgbd_dataset_freiburg1_desk", [stamp(0)], [stamp(0)], (480, 640))
    assert (TumFolder(str(bent))[0].depth_m == 0).any()  # undistorted: the corners are not in the picture
    assert (TumFolder(f"{bent}?K=525,525,319.5,239.5")[0].depth_m > 0).all()


def test_a_camera_that_nobody_told_is_not_guessed(tmp_path: Path) -> None:
    path = write(tmp_path, [stamp(0)], [stamp(0)])
    with pytest.raises(SourceError, match=r"does not tell the camera; say \?K=fx,fy,cx,cy, or write .*/camera\.txt"):
        TumFolder(str(path))


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("rgb.txt", None, r"rgb\.txt: cannot be read"),
        (
            "depth.txt",
            "1.0 depth/a.png more\n",
            r"depth\.txt, row 1: expected 2 words, .* got '1\.0 depth/a",
        ),
        ("rgb.txt", "soon rgb/a.png\n", "a stamp is a number of seconds, got 'soon'"),
        ("rgb.txt", "-1 rgb/a.png\n", "a stamp is not before 0"),
        ("rgb.txt", "nan rgb/a.png\n", "a stamp is a number of seconds, got 'nan'"),
        ("associations.txt", "1.0 rgb/a.png\n", r"associations\.txt, row 1: expected 4 words"),
        ("camera.txt", "60 61 23.5", r"camera\.txt: expected 4 numbers .* got 3"),
        ("camera.txt", "fx 61 23.5 17", r"camera\.txt: expected 4 numbers .*could not convert"),
        ("camera.txt", "60 61 90 17", r"camera\.txt: principal point"),
    ],
)
def test_a_file_that_cannot_be_read_is_named(tmp_path: Path, name: str, text: str | None, complaint: str) -> None:
    path = write(tmp_path, [stamp(0)], [stamp(0)])
    if text is None:
        (path / name).unlink()
    else:
        (path / name).write_text(text)
    with pytest.raises(SourceError, match=complaint):
        list(TumFolder(f"{path}{'' if name == 'camera.txt' else K}"))


@pytest.mark.parametrize(
    ("query", "complaint"),
    [
        ("?K=60,61", "K='60,61': expected 4 numbers fx,fy,cx,cy, or a file"),
        ("?K=", "K='': expected 4 numbers"),
        ("?K=nothing.txt", r"nothing\.txt: cannot be read"),
        (f"{K}&distortion=1,2,3", "expected 4, 5 or 8 numbers k1,k2,p1,p2"),
        (f"{K}&depth_factor=0", "expected a number from 1 to 1e"),
        (f"{K}&rate=3", "no option 'rate'; there is K, distortion, depth_factor, slop"),
    ],
)
def test_options_that_mean_nothing_are_refused(tmp_path: Path, query: str, complaint: str) -> None:
    with pytest.raises(SourceError, match=complaint):
        TumFolder(f"{write(tmp_path, [stamp(0)], [stamp(0)])}{query}")


def test_a_picture_that_is_missing_is_named_and_the_others_still_read(tmp_path: Path) -> None:
    source = TumFolder(f"{write(tmp_path, [stamp(k) for k in range(2)], [stamp(k) for k in range(2)])}{K}")
    (tmp_path / "depth" / f"{stamp(1)}.png").unlink()
    with pytest.raises(SourceError, match=rf"depth/{stamp(1)}\.png: cannot be read"):
        source[1]
    assert source[0].depth_m == pytest.approx(1)


@pytest.mark.parametrize("outside", ["/etc/passwd", "../other/a.png", "/dev/zero"])
@pytest.mark.parametrize("file", ["rgb.txt", "depth.txt", "associations.txt"])
def test_a_list_names_no_file_of_another_folder(tmp_path: Path, file: str, outside: str) -> None:
    path = write(tmp_path, [stamp(0)], [stamp(0)])
    row = f"{stamp(0)} {outside}"
    (path / file).write_text(row if file != "associations.txt" else f"{stamp(0)} rgb/{stamp(0)}.png {row}")
    with pytest.raises(SourceError, match=rf"{file}: '{outside}' is not in "):
        TumFolder(f"{path}{K}")


@pytest.mark.parametrize("seconds", ["1e999999999", "9" * 30, "nan", "1e-999999999x"])
def test_a_stamp_that_no_clock_shows_is_refused_with_its_list(tmp_path: Path, seconds: str) -> None:
    path = write(tmp_path, [stamp(0)], [stamp(0)])
    (path / "rgb.txt").write_text(f"{seconds} rgb/{stamp(0)}.png")
    with pytest.raises(SourceError, match=r"rgb\.txt: a stamp is "):
        TumFolder(f"{path}{K}")
