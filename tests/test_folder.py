"""A folder of pictures: read in order, in metres, with the stamps that its names hold; damage named by file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracker.errors import FrameError, SourceError
from tracker.sources.folder import Folder

POSE = "0 -1 0 0.1\n1 0 0 0.2\n0 0 1 0.7\n0 0 0 1\n"


def write(path: Path, stems: Sequence[str], posed: Sequence[str] = (), suffix: str = ".png") -> Path:
    """The k-th picture is of colour (k, 20, 30) and 700 + k millimetres away; posed ones have a mask of 50 pixels."""
    for name in ("rgb", "depth", "masks", *(["annotated_poses"] if posed else [])):
        (path / name).mkdir(parents=True, exist_ok=True)
    (path / "cam_K.txt").write_text("6.000000000000000000e+01 0 23.5\n0 61 17\n0 0 1\n")
    for k, stem in enumerate(stems):
        cv2.imwrite(str(path / "rgb" / f"{stem}{suffix}"), np.full((36, 48, 3), (30, 20, k), np.uint8))
        cv2.imwrite(str(path / "depth" / f"{stem}.png"), np.full((36, 48), 700 + k, np.uint16))
    for stem in posed:
        mask = np.zeros((36, 48), np.uint8)
        mask[10:15, 20:30] = 255
        cv2.imwrite(str(path / "masks" / f"{stem}.png"), mask)
        (path / "annotated_poses" / f"{stem}.txt").write_text(POSE)
    return path


def test_frames_are_rgb_and_metres_with_the_camera_of_the_folder(tmp_path: Path) -> None:
    source = Folder(write(tmp_path, ["a", "b", "c"]))
    for k, frame in enumerate(source):
        assert (frame.rgb == [k, 20, 30]).all()
        assert frame.depth_m == pytest.approx((700 + k) / 1000)
        assert frame.intrinsics.matrix.tolist() == [[60, 0, 23.5], [0, 61, 17], [0, 0, 1]]
        assert frame.provenance.source == f"folder:{tmp_path} {'abc'[k]}"
        assert frame.provenance.raw_depth_unit_m == 0.001


@pytest.mark.parametrize("stems", [["a10", "a9", "b"], ["0009", "0010", "0101"], ["9", "10", "101"]])
def test_frames_come_in_the_order_of_their_names_and_numbers_by_value(tmp_path: Path, stems: list[str]) -> None:
    source = Folder(write(tmp_path, stems[::-1]))
    assert [frame.provenance.source.split()[-1] for frame in source] == stems


@pytest.mark.parametrize(
    ("stems", "stamps_ns", "clock"),
    [
        (["1581120424100262102", "1581120424133595435"], [1581120424100262102, 1581120424133595435], "recording"),
        (["1581120424100262", "1581120424133595"], [1581120424100262000, 1581120424133595000], "recording"),
        (["1581120424100262", "1581120424133595435"], [0, 33_333_333], "nominal"),
        (["000000", "000007"], [0, 33_333_333], "nominal"),
        (["first", "second"], [0, 33_333_333], "nominal"),
    ],
)
def test_stamps_are_the_names_where_these_are_times_and_else_a_nominal_count(
    tmp_path: Path, stems: list[str], stamps_ns: list[int], clock: str
) -> None:
    source = Folder(write(tmp_path, stems))
    assert [frame.stamp_ns for frame in source] == stamps_ns
    assert {frame.provenance.clock for frame in source} == {clock}


def test_the_object_is_known_where_both_its_pose_and_its_mask_are(tmp_path: Path) -> None:
    source = Folder(write(tmp_path, ["0", "1", "2", "3"], posed=["1", "2", "3"]))
    (tmp_path / "masks" / "2.png").unlink()
    cv2.imwrite(str(tmp_path / "masks" / "3.png"), np.zeros((36, 48), np.uint8))
    assert source.object_ids == ("object",)
    seen, hidden = source.sightings("object")
    assert (seen.index, seen.visible_px, seen.visible_fraction) == (1, 50, 1.0)
    assert (hidden.index, hidden.visible_px, hidden.visible_fraction) == (3, 0, 0.0)
    assert np.allclose(seen.T_cam_obj @ np.array([[1.0, 0, 0]]), [[0.1, 1.2, 0.7]])
    assert [list(frame.masks) for frame in source] == [[], ["object"], [], ["object"]]


def test_without_poses_there_are_frames_and_no_object(tmp_path: Path) -> None:
    source = Folder(write(tmp_path, ["0"], suffix=".jpg"))
    assert source.object_ids == ()
    assert np.abs(source[0].rgb.astype(int) - [0, 20, 30]).max() < 6


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (None, r"cam_K\.txt: cannot be read \(No such file"),
        ("60 0 23.5 0 61 17", r"cam_K\.txt: expected 9 numbers, got 6"),
        ("60, 0, 23.5, 0, 61, 17, 0, 0, 1", r"cam_K\.txt: expected 9 numbers \(could not convert"),
        ("fx 60", r"cam_K\.txt: expected 9 numbers"),
    ],
)
def test_a_camera_file_that_cannot_be_read_is_named_when_the_folder_is_opened(
    tmp_path: Path, content: str | None, complaint: str
) -> None:
    camera = write(tmp_path, ["0"]) / "cam_K.txt"
    if content is None:
        camera.unlink()
    else:
        camera.write_text(content)
    with pytest.raises(SourceError, match=complaint):
        Folder(tmp_path)


def test_a_camera_of_another_resolution_is_named_by_its_file(tmp_path: Path) -> None:
    (write(tmp_path, ["0"]) / "cam_K.txt").write_text("120 0 47 0 120 35 0 0 1")
    with pytest.raises(FrameError, match=r"cam_K\.txt: principal point .* another resolution"):
        Folder(tmp_path)[0]


def test_a_folder_without_pictures_is_named(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(SourceError, match=f"{path}/rgb has no png or jpg pictures"):
            Folder(path)


@pytest.mark.parametrize("file", ["rgb/1.png", "depth/1.png", "masks/1.png"])
def test_a_half_written_or_a_smaller_picture_is_named_and_the_others_still_read(tmp_path: Path, file: str) -> None:
    source = Folder(write(tmp_path, ["0", "1", "2"], posed=["1"]))
    whole = (tmp_path / file).read_bytes()
    (tmp_path / file).write_bytes(whole[:-20])
    with pytest.raises(SourceError, match=f"{file}: the file is truncated"):
        source[1]
    smaller = np.ones((18, 24, 3) if "rgb" in file else (18, 24), np.uint8)
    cv2.imwrite(str(tmp_path / file), smaller)
    with pytest.raises(FrameError, match=r"another resolution|has shape"):
        source[1]
    (tmp_path / file).write_bytes(whole)
    assert [frame.index for frame in source] == [0, 1, 2]


def test_a_missing_depth_picture_is_named(tmp_path: Path) -> None:
    source = Folder(write(tmp_path, ["0", "1"]))
    (tmp_path / "depth" / "1.png").unlink()
    with pytest.raises(SourceError, match=r"depth/1\.png: cannot be read"):
        source[1]


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("1 0 0 0", r"annotated_poses/0\.txt: expected 16 numbers, got 4"),
        (POSE.replace("0.7", "far"), r"annotated_poses/0\.txt: expected 16 numbers \(could not convert"),
        (POSE.replace("-1", "1"), r"annotated_poses/0\.txt: not a rotation"),
        ("0 1 0 0 -1 0 0 0 0 0 1 0 0.1 0.2 0.7 1", r"annotated_poses/0\.txt: .* transposed"),
        (POSE.replace("0.7", "nan"), r"annotated_poses/0\.txt: a pose is a finite"),
    ],
)
def test_a_damaged_pose_is_named_by_its_file(tmp_path: Path, content: str, complaint: str) -> None:
    (write(tmp_path, ["0"], posed=["0"]) / "annotated_poses" / "0.txt").write_text(content)
    with pytest.raises(SourceError, match=complaint):
        Folder(tmp_path).sightings("object")


def test_poses_and_masks_that_are_counted_belong_to_the_pictures_by_order(tmp_path: Path) -> None:
    write(tmp_path, ["a", "b", "c"], posed=["a", "b", "c"])
    cv2.imwrite(str(tmp_path / "masks" / "b.png"), np.zeros((36, 48), np.uint8))
    for name in ("annotated_poses", "masks"):
        for k, file in enumerate(sorted((tmp_path / name).iterdir())):
            file.rename(file.with_stem(str(9 + k)))  # 9, 10, 11: by value, not by letter
    (tmp_path / "annotated_poses" / "10.txt").write_text(POSE.replace("0.7", "0.8"))
    source = Folder(tmp_path)
    assert [s.T_cam_obj.translation_m[2] for s in source.sightings("object")] == [0.7, 0.8, 0.7]
    assert [s.visible_px for s in source.sightings("object")] == [50, 0, 50]
    (tmp_path / "annotated_poses" / "11.txt").unlink()
    with pytest.raises(
        SourceError, match=r"annotated_poses has 2 files 9\.txt \.\. 10\.txt, expected the names of the 3"
    ):
        Folder(tmp_path)


def test_annotated_masks_come_before_computed_ones_and_the_object_has_the_name_it_is_given(tmp_path: Path) -> None:
    write(tmp_path, ["0", "1"], posed=["0", "1"])
    (tmp_path / "gt_mask").mkdir()
    cv2.imwrite(str(tmp_path / "gt_mask" / "1.png"), np.full((36, 48), 255, np.uint8))
    source = Folder(tmp_path, "mug", "kitchen")
    assert [(s.index, s.visible_px) for s in source.sightings("mug")] == [(1, 36 * 48)]
    assert (source.visible_px(0), source.visible_px(1)) == (None, 36 * 48)
    assert (source.pose(0) is None, source.object_ids, source.name) == (False, ("mug",), "kitchen")
    assert list(source[1].masks) == ["mug"]
