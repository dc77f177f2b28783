"""YCBInEOAT and FoundationPose's folders: small ones are written, read back as a dataset, and damaged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.datasets import open_dataset
from eval.datasets.ycbineoat import YcbInEoatDataset
from tests.recordings import (
    CORNERS_M,
    DIAMETER_M,
    assert_nothing_is_wrong,
    pose,
    score_the_truth,
    write_matrix,
    write_obj,
    write_picture,
    write_text,
)
from tracker.errors import SourceError

BLEACH, MUSTARD, OWN = "021_bleach_cleanser", "006_mustard_bottle", "kinect_driller_seq"


def write_sequence(folder: Path, stems: list[str], masks: str, masked: int, posed: int) -> None:
    """The k-th picture is of colour (200, 30, k), 700 + k millimetres away, and its pose is k centimetres to the right;
    the first `masked` have a mask of 50 pixels. Poses are counted, as in YCBInEOAT."""
    write_text(folder / "cam_K.txt", "60 0 23.5\n0 61 17\n0 0 1\n")
    for k, stem in enumerate(stems):
        write_picture(folder / "rgb" / f"{stem}.png", np.full((36, 48, 3), (200, 30, k), np.uint8))
        write_picture(folder / "depth" / f"{stem}.png", np.full((36, 48), 700 + k, np.uint16))
        if k < masked:
            mask = np.zeros((36, 48), np.uint8)
            mask[10:15, 20:30] = 255
            write_picture(folder / masks / f"{stem}.png", mask)
        if k < posed:
            write_matrix(folder / "annotated_poses" / f"{k:07d}.txt", pose(k / 100).matrix)


@pytest.fixture
def eoat(tmp_path: Path) -> Path:
    """Sequences of a mustard bottle (with a mesh of its own), of a bleach bottle, and of no object of YCB's."""
    stems = ["1581120424100262102", "1581120424133595435", "1581120424166928768"]
    write_sequence(tmp_path / "mustard0", stems, "masks", masked=1, posed=3)
    write_sequence(tmp_path / "bleach_hard_00_03_chaitanya", stems, "gt_mask", masked=3, posed=3)
    write_sequence(tmp_path / OWN, ["000000", "000001"], "masks", masked=2, posed=2)
    write_text(tmp_path / "models" / BLEACH / "points.xyz", "\n".join(" ".join(map(str, p)) for p in CORNERS_M))
    write_obj(tmp_path / "mustard0" / "mesh" / "textured_simple.obj", 2 * CORNERS_M)
    write_obj(tmp_path / OWN / "mesh" / "textured_mesh.obj", 3 * CORNERS_M)
    return tmp_path


def test_scenes_are_numbered_by_the_names_of_the_sequences_which_are_shown(eoat: Path) -> None:
    dataset = open_dataset(f"ycbineoat:{eoat}")
    assert dataset.scene_ids == (1, 2, 3)
    assert [dataset.scene(scene_id).object_ids for scene_id in dataset.scene_ids] == [(BLEACH,), (OWN,), (MUSTARD,)]
    assert f"1 bleach_hard_00_03_chaitanya, 2 {OWN}, 3 mustard0" in dataset.target_rule
    assert "mustard0" in dataset.scene(3).name
    assert list(dataset.image_ids(3)) == [0, 1, 2]


def test_frames_are_those_of_the_folder_with_the_object_called_by_its_name(eoat: Path) -> None:
    frames = list(YcbInEoatDataset(eoat).scene(1))
    for k, frame in enumerate(frames):
        assert (frame.rgb == [200, 30, k]).all()
        assert frame.depth_m == pytest.approx((700 + k) / 1000)
        assert frame.stamp_ns == 1581120424100262102 + k * 33_333_333
        assert {name: int(mask.sum()) for name, mask in frame.masks.items()} == {BLEACH: 50}


def test_every_posed_frame_is_a_target_and_poses_that_are_counted_go_by_order(eoat: Path) -> None:
    targets = YcbInEoatDataset(eoat).targets(3)
    assert [(t.index, t.image_id, t.object_id, t.visible_px) for t in targets] == [
        (0, 0, MUSTARD, 50),
        (1, 1, MUSTARD, 0),  # only the first picture has a mask, as in FoundationPose's demo
        (2, 2, MUSTARD, 0),
    ]
    for k, target in enumerate(targets):
        assert np.allclose(target.T_cam_obj.matrix, pose(k / 100).matrix)


def test_objects_of_ycb_have_their_class_numbers_and_others_follow(eoat: Path) -> None:
    dataset = YcbInEoatDataset(eoat)
    assert dataset.object_ids == (MUSTARD, BLEACH, OWN)
    assert [dataset.number(name) for name in dataset.object_ids] == [5, 12, 22]
    assert [dataset.object_with(number) for number in (5, 12, 22)] == [MUSTARD, BLEACH, OWN]


def test_a_model_is_ycb_s_or_the_mesh_of_the_sequence(eoat: Path) -> None:
    dataset = YcbInEoatDataset(eoat)
    for name, times, symmetric in ((BLEACH, 1, False), (MUSTARD, 2, False), (OWN, 3, None)):
        model = dataset.model(name)
        assert np.allclose(model.points_m, times * CORNERS_M)
        assert model.diameter_m == pytest.approx(times * DIAMETER_M)
        assert model.symmetric is symmetric
    write_obj(eoat / "CADmodels" / MUSTARD / "textured.obj")
    assert np.allclose(dataset.model(MUSTARD).points_m, CORNERS_M)


def test_the_truth_has_no_error(eoat: Path) -> None:
    assert_nothing_is_wrong(score_the_truth(YcbInEoatDataset(eoat), eoat), instances=8)


def test_the_folder_of_one_sequence_is_a_dataset_too(eoat: Path) -> None:
    dataset = YcbInEoatDataset(eoat / "mustard0")
    assert (dataset.scene_ids, dataset.object_ids) == ((1,), (MUSTARD,))
    assert_nothing_is_wrong(score_the_truth(dataset, eoat), instances=3)


def test_a_model_that_is_not_there_is_told_with_the_places(eoat: Path) -> None:
    (eoat / "mustard0" / "mesh" / "textured_simple.obj").unlink()
    with pytest.raises(SourceError) as caught:
        score_the_truth(YcbInEoatDataset(eoat), eoat)
    for place in (f"models/{MUSTARD}/points.xyz", f"CADmodels/{MUSTARD}/textured.obj", "mustard0/mesh/*.obj"):
        assert f"{eoat}/{place}" in str(caught.value)


def test_what_is_missing_is_named(eoat: Path) -> None:
    dataset = YcbInEoatDataset(eoat)
    with pytest.raises(SourceError, match="has no scene 4; it has 1, 2, 3"):
        dataset.scene(4)
    with pytest.raises(SourceError, match="has no object '025_mug'; it has 006_mustard_bottle"):
        dataset.model("025_mug")
    with pytest.raises(SourceError, match="has no object number 1; it has 5, 12, 22"):
        dataset.object_with(1)
    with pytest.raises(SourceError, match=r"no sequence \(a folder with cam_K\.txt\)"):
        YcbInEoatDataset(eoat / "models")
    (eoat / OWN / "annotated_poses").rename(eoat / OWN / "kept")
    with pytest.raises(SourceError, match=f"{OWN}: no folder annotated_poses"):
        YcbInEoatDataset(eoat).targets(2)


def test_damage_is_named_by_file_when_the_frame_is_read(eoat: Path) -> None:
    sequence = eoat / "mustard0"
    (sequence / "annotated_poses" / "0000001.txt").write_text("1 0 0 zero")
    with pytest.raises(SourceError, match=r"annotated_poses/0000001\.txt: expected 16 numbers"):
        YcbInEoatDataset(eoat).targets(3)
    depth = sequence / "depth" / "1581120424133595435.png"
    depth.write_bytes(depth.read_bytes()[:-20])
    scene = YcbInEoatDataset(eoat).scene(3)
    assert scene[0].index == 0
    with pytest.raises(SourceError, match=r"1581120424133595435\.png: the file is truncated"):
        scene[1]
    (sequence / "annotated_poses" / "0000002.txt").unlink()
    with pytest.raises(SourceError, match=r"annotated_poses has 2 files 0000000\.txt \.\. 0000001\.txt, expected"):
        YcbInEoatDataset(eoat).scene(3)
