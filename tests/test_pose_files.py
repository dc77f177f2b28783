"""Poses in others' formats: what is written reads back as the pose that it was, and a lost frame has no line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eval.bop_results import read_results
from tracker.errors import ConfigError
from tracker.frame import Provenance
from tracker.geometry import Pose
from tracker.pose_files import FORMATS, open_pose_files
from tracker.result import TrackResult, TrackState
from tracker.sources.text_files import read_pose

POSE = Pose.exp([0.4, -0.3, 2.5, 0.1, -0.05, 0.7])
STAMP_NS = 1_581_120_424_100_262_102  # more digits than a float holds
TRACKED = TrackResult(
    STAMP_NS, "7", POSE, TrackState.TRACKING, 0.875, np.eye(6), "tracked", None, None, {"total": 20.0}
)
LOST = replace(TRACKED, pose=None, state=TrackState.LOST, confidence=0.0, covariance=None)


def write(name: str, folder: Path, *frames: tuple[Provenance, list[TrackResult]]) -> Path:
    """Frames 3, 4, .. of all objects that are in the first one."""
    (writer,) = open_pose_files([name], folder, [result.object_id for result in frames[0][1]])
    for index, (provenance, results) in enumerate(frames, start=3):
        writer.add(index, provenance, results)
    return folder


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_matrices_are_called_like_the_pictures_or_counted_and_a_lost_frame_has_none(tmp_path: Path) -> None:
    frames = (Provenance(name="a"), [TRACKED]), (Provenance(name="b"), [LOST]), (Provenance(), [TRACKED])
    write("ob-in-cam", tmp_path, *frames)
    assert files(tmp_path) == ["ob_in_cam/000005.txt", "ob_in_cam/a.txt"]
    assert np.allclose(read_pose(tmp_path / "ob_in_cam" / "a.txt").matrix, POSE.matrix, atol=1e-15)


def test_several_objects_have_a_folder_each(tmp_path: Path) -> None:
    other = replace(TRACKED, object_id="mug", pose=POSE.inverse())
    write("ob-in-cam", tmp_path, (Provenance(name="a"), [TRACKED, other]))
    assert files(tmp_path) == ["ob_in_cam/7/a.txt", "ob_in_cam/mug/a.txt"]
    assert np.allclose(read_pose(tmp_path / "ob_in_cam" / "mug" / "a.txt").matrix, POSE.inverse().matrix)


def test_a_trajectory_has_whole_stamps_metres_and_the_scalar_last(tmp_path: Path) -> None:
    mug = replace(TRACKED, object_id="mug")
    later = replace(TRACKED, stamp_ns=STAMP_NS + 33_000_000_001)
    frames = [TRACKED, mug], [LOST, mug], [later, replace(LOST, object_id="mug")]
    write("tum", tmp_path, *((Provenance(), results) for results in frames))
    assert files(tmp_path) == ["tum/7.txt", "tum/mug.txt"]
    comment, *rows = (tmp_path / "tum" / "7.txt").read_text().splitlines()
    assert comment.startswith("#")
    assert [row.split()[0] for row in rows] == ["1581120424.100262102", "1581120457.100262103"]
    numbers = [float(word) for word in rows[0].split()[1:]]
    assert numbers[:3] == POSE.translation_m.tolist()
    read = Pose.from_quaternion([numbers[6], *numbers[3:6]], numbers[:3])
    assert read.angle_to_rad(POSE) < 1e-9
    assert len((tmp_path / "tum" / "mug.txt").read_text().splitlines()) == 3


def test_rows_of_bop_have_the_numbers_of_the_dataset_and_the_time_of_the_whole_image(tmp_path: Path) -> None:
    other = replace(TRACKED, object_id="12", timings_ms={"total": 30.0}, pose=POSE.inverse())
    numbered, counted = Provenance(bop_image=(48, 1036)), Provenance()
    write("bop", tmp_path, (numbered, [TRACKED, other]), (counted, [LOST, other]))
    assert files(tmp_path) == ["results.csv"]
    read = read_results(tmp_path / "results.csv")
    assert [(e.scene_id, e.image_id, e.object_id) for e in read] == [(48, 1036, 7), (48, 1036, 12), (1, 4, 12)]
    assert [e.time_s for e in read] == [0.05] * 3
    assert [e.score for e in read] == [0.875] * 3
    assert (read[0].T_cam_obj.matrix == POSE.matrix).all()


@pytest.mark.parametrize("name", FORMATS)
def test_a_run_without_a_pose_has_files_without_one(name: str, tmp_path: Path) -> None:
    write(name, tmp_path, (Provenance(), [LOST]))
    assert all(len(path.read_text().splitlines()) == 1 for path in tmp_path.rglob("*") if path.is_file())


def test_a_format_is_written_once_though_it_is_named_twice(tmp_path: Path) -> None:
    assert len(open_pose_files(["tum", "bop", "tum"], tmp_path, ["7"])) == 2


@pytest.mark.parametrize(
    ("name", "object_id", "complaint"),
    [
        ("bop", "mug", "BOP's rows have numbers for objects, a model is of 'mug'"),
        ("bop", "-1", "'-1'"),
        ("tum", "a/b", "'a/b' cannot be the name of a file"),
        ("ob-in-cam", "..", "'..' cannot be the name of a file"),
        ("kitti", "7", "no format 'kitti' of poses; there are ob-in-cam, tum, bop"),
    ],
)
def test_what_a_format_cannot_hold_is_refused_before_anything_is_written(
    name: str, object_id: str, complaint: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=complaint):
        open_pose_files([name], tmp_path, [object_id])
    assert files(tmp_path) == []
