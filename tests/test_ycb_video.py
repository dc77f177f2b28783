"""YCB-Video's own layout: a small copy of it is written, read back in metres, and damaged."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from eval.datasets import open_dataset
from eval.datasets.ycb_video import YcbVideoDataset
from tests.recordings import (
    CORNERS_M,
    DIAMETER_M,
    assert_nothing_is_wrong,
    pose,
    score_the_truth,
    write_obj,
    write_picture,
    write_text,
)
from tracker.errors import FrameError, SourceError

HEIGHT, WIDTH = 36, 48
CAMERA = np.array([[60.0, 0, 23.5], [0, 61, 17], [0, 0, 1]])
MUG, BOWL = "025_mug", "024_bowl"  # classes 14 and 13


def write_meta(path: Path, classes: list[int], **changed: Any) -> None:
    """changed: fields to be another value, or None to be left out."""
    matrices = [pose(number / 100).matrix[:3] for number in classes]
    meta = {
        "intrinsic_matrix": CAMERA,
        "factor_depth": np.array([[10_000]], np.uint16),
        "cls_indexes": np.array(classes, np.uint8)[:, None],
        "poses": np.stack(matrices, axis=2) if len(matrices) > 1 else matrices[0],  # as MATLAB saves a single one
        "vertmap": np.zeros((2, 2, 3)),
    }
    savemat(path, {name: value for name, value in (meta | changed).items() if value is not None})


def write_image(folder: Path, image_id: int, classes: list[int], suffix: str = "jpg") -> None:
    """Colour (200, 30, image id), 5000 + image id units of 0.1 mm away; class k is 5 pixels of row k."""
    stem = folder / f"{image_id:06d}"
    write_picture(
        stem.with_name(f"{stem.name}-color.{suffix}"), np.full((HEIGHT, WIDTH, 3), (200, 30, image_id), np.uint8)
    )
    depth = np.full((HEIGHT, WIDTH), 5000 + image_id, np.uint16)
    depth[0] = 0
    write_picture(stem.with_name(f"{stem.name}-depth.png"), depth)
    labels = np.zeros((HEIGHT, WIDTH), np.uint8)
    for number in classes:
        labels[number, 10:15] = number
    write_picture(stem.with_name(f"{stem.name}-label.png"), labels)
    write_meta(stem.with_name(f"{stem.name}-meta.mat"), classes)


@pytest.fixture
def ycb(tmp_path: Path) -> Path:
    """Sequences 0 (no keyframes), 48 (images 1, 2, 5; keyframes 5 and 1) and 50 (image 3); a mug, and a bowl in two."""
    write_image(tmp_path / "data" / "0000", 1, [14])
    write_image(tmp_path / "data" / "0048", 1, [14, 13])
    write_image(tmp_path / "data" / "0048", 2, [14, 13])
    write_image(tmp_path / "data" / "0048", 5, [14], suffix="png")
    write_image(tmp_path / "data" / "0050", 3, [13])
    write_text(tmp_path / "keyframe.txt", "0048/000005\n0048/000001\n0050/000003\n0059/000001\n")
    write_text(tmp_path / "models" / MUG / "points.xyz", "\n".join(" ".join(map(str, p)) for p in CORNERS_M))
    write_obj(tmp_path / "models" / MUG / "textured.obj", CORNERS_M * 2)
    write_obj(tmp_path / "models" / BOWL / "textured.obj")
    return tmp_path


def test_frames_are_rgb_and_metres_with_the_camera_and_the_masks_of_their_own(ycb: Path) -> None:
    scene = open_dataset(f"ycb-video:{ycb}").scene(48)
    assert len(scene) == 3
    for frame, image_id in zip(scene, (1, 2, 5), strict=True):
        assert np.abs(frame.rgb.astype(int) - [200, 30, image_id]).max() < 6
        assert frame.depth_m[1:] == pytest.approx((5000 + image_id) / 10_000)
        assert (frame.depth_m[0] == 0).all()
        assert frame.intrinsics.matrix.tolist() == CAMERA.tolist()
        assert frame.provenance.raw_depth_unit_m == 0.0001
        assert frame.stamp_ns == round(image_id * 1e9 / 30)
        assert {name: np.argwhere(mask)[0].tolist() for name, mask in frame.masks.items()} == (
            {MUG: [14, 10], BOWL: [13, 10]} if image_id < 5 else {MUG: [14, 10]}
        )


def test_poses_belong_to_the_class_of_their_place(ycb: Path) -> None:
    scene = YcbVideoDataset(ycb).scene(48)
    assert scene.object_ids == (BOWL, MUG)
    assert [s.index for s in scene.sightings(BOWL)] == [0, 1]
    assert [s.index for s in scene.sightings(MUG)] == [0, 1, 2]
    for name, number in ((BOWL, 13), (MUG, 14)):
        for sighting in scene.sightings(name):
            assert np.allclose(sighting.T_cam_obj.matrix, pose(number / 100).matrix)
            assert (sighting.visible_px, sighting.visible_fraction) == (5, 1.0)


def test_targets_are_all_objects_of_the_keyframes(ycb: Path) -> None:
    dataset = open_dataset(f"ycb-video:{ycb}")
    assert dataset.scene_ids == (48, 50)
    assert [(t.index, t.image_id, t.object_id) for t in dataset.targets(48)] == [(0, 1, BOWL), (0, 1, MUG), (2, 5, MUG)]
    assert [(t.image_id, t.object_id) for t in dataset.targets(50)] == [(3, BOWL)]
    assert "keyframe.txt" in dataset.target_rule
    assert "BOP" in dataset.model_frame


def test_a_hidden_object_of_a_keyframe_is_a_target_too(ycb: Path) -> None:
    write_picture(ycb / "data" / "0050" / "000003-label.png", np.zeros((HEIGHT, WIDTH), np.uint8))
    (target,) = YcbVideoDataset(ycb).targets(50)
    assert (target.visible_px, target.visible_fraction) == (0, 0.0)


def test_without_a_list_of_keyframes_every_frame_counts_where_anything_is_seen(ycb: Path) -> None:
    (ycb / "keyframe.txt").rename(ycb / "kept.txt")
    write_picture(ycb / "data" / "0050" / "000003-label.png", np.zeros((HEIGHT, WIDTH), np.uint8))
    dataset = YcbVideoDataset(ycb)
    assert dataset.scene_ids == (0, 48, 50)
    assert [len(dataset.targets(scene_id)) for scene_id in dataset.scene_ids] == [1, 5, 0]
    (ycb / "image_sets").mkdir()
    (ycb / "kept.txt").rename(ycb / "image_sets" / "keyframe.txt")
    assert YcbVideoDataset(ycb).scene_ids == (48, 50)


def test_numbers_are_those_of_the_classes_and_symmetry_is_posecnn_s(ycb: Path) -> None:
    dataset = YcbVideoDataset(ycb)
    assert (dataset.number(MUG), dataset.object_with(13)) == (14, BOWL)
    assert len(dataset.object_ids) == 21
    assert (dataset.model(MUG).symmetric, dataset.model(BOWL).symmetric) == (False, True)
    write_text(ycb / "image_sets" / "classes.txt", "\n".join(f"{n:03d}_thing" for n in range(1, 15)))
    other = YcbVideoDataset(ycb)
    assert other.number("014_thing") == 14
    assert other.scene(48).object_ids == ("013_thing", "014_thing")


def test_a_model_is_its_points_in_metres_and_else_the_vertices_of_its_mesh(ycb: Path) -> None:
    for name in (MUG, BOWL):
        model = YcbVideoDataset(ycb).model(name)
        assert np.allclose(model.points_m, CORNERS_M)
        assert model.diameter_m == pytest.approx(DIAMETER_M)


def test_the_truth_has_no_error(ycb: Path) -> None:
    scores = score_the_truth(YcbVideoDataset(ycb), ycb)
    assert_nothing_is_wrong(scores, instances=4)
    assert scores.protocol["symmetric_objects"] == [BOWL]


def test_no_picture_is_decoded_before_it_is_asked_for(ycb: Path) -> None:
    for file in ycb.rglob("*.png"):
        file.write_bytes(b"")
    dataset = YcbVideoDataset(ycb)
    assert dataset.scene(48).object_ids == (BOWL, MUG)
    with pytest.raises(SourceError, match=r"000001-label\.png: the file is truncated"):
        dataset.targets(48)


@pytest.mark.parametrize(
    ("changed", "complaint"),
    [
        ({"poses": None}, "field poses is missing; expected intrinsic_matrix, factor_depth, cls_indexes, poses"),
        ({"factor_depth": None}, "field factor_depth is missing"),
        ({"factor_depth": 0}, "field factor_depth: expected one positive number"),
        ({"factor_depth": "ten"}, r"the MATLAB file is damaged \(field factor_depth is no array of real numbers"),
        ({"intrinsic_matrix": np.eye(4)}, r"field intrinsic_matrix: expected 3x3, got shape \(4, 4\)"),
        ({"cls_indexes": [14, 22]}, "field cls_indexes: expected class numbers from 1 to 21"),
        ({"cls_indexes": [14, 14]}, "field cls_indexes: .* each once"),
        ({"cls_indexes": [13.5, 14]}, "field cls_indexes"),
        ({"poses": np.zeros((3, 4, 3))}, r"field poses: expected 3x4x2, a matrix a class, got shape \(3, 4, 3\)"),
        ({"poses": np.ones((3, 4, 2))}, "field poses: not a rotation"),
        ({"poses": np.full((3, 4, 2), np.nan)}, "field poses: expected finite numbers"),
    ],
)
def test_a_damaged_annotation_is_named_by_file_and_field(ycb: Path, changed: dict[str, Any], complaint: str) -> None:
    write_meta(ycb / "data" / "0048" / "000001-meta.mat", [14, 13], **changed)
    with pytest.raises(SourceError, match=rf"0048/000001-meta\.mat: {complaint}"):
        YcbVideoDataset(ycb).targets(48)


def test_an_annotation_that_is_no_matlab_file_is_named(ycb: Path) -> None:
    meta = ycb / "data" / "0048" / "000001-meta.mat"
    for content in (b"", b"\x00" * 64, b"poses: none\n" * 20):
        meta.write_bytes(content)
        with pytest.raises(SourceError, match=r"000001-meta\.mat: not a MATLAB 5 file"):
            YcbVideoDataset(ycb).targets(48)
    write_meta(meta, [14, 13])
    meta.write_bytes(meta.read_bytes()[:400])
    with pytest.raises(SourceError, match=r"000001-meta\.mat: (the MATLAB file is damaged|field \w+ is missing)"):
        YcbVideoDataset(ycb).targets(48)


def test_a_camera_of_another_resolution_is_named(ycb: Path) -> None:
    write_meta(ycb / "data" / "0050" / "000003-meta.mat", [13], intrinsic_matrix=CAMERA * [[2], [2], [1]])
    with pytest.raises(FrameError, match=r"000003-meta\.mat: principal point"):
        YcbVideoDataset(ycb).scene(50)[0]


def test_what_is_missing_is_named(ycb: Path) -> None:
    dataset = YcbVideoDataset(ycb)
    with pytest.raises(SourceError, match="has no scene 0; it has 48, 50"):
        dataset.scene(0)
    with pytest.raises(SourceError, match="has no object 'cup'; it has 002_master_chef_can"):
        dataset.number("cup")
    with pytest.raises(SourceError, match=r"points\.xyz or .*011_banana/textured\.obj"):
        dataset.model("011_banana")
    (ycb / "data" / "0048" / "000005-meta.mat").unlink()
    with pytest.raises(SourceError, match="lacks 1 keyframes, the first is image 5"):
        YcbVideoDataset(ycb).targets(48)
    write_text(ycb / "keyframe.txt", "48/1\n")
    with pytest.raises(SourceError, match=r"keyframe\.txt: expected lines like 0048/000001, got '48/1'"):
        YcbVideoDataset(ycb)
    write_text(ycb / "keyframe.txt", "0059/000001\n")
    with pytest.raises(SourceError, match=r"no sequence .* that .*keyframe\.txt has keyframes of"):
        YcbVideoDataset(ycb)
    write_text(ycb / "image_sets" / "classes.txt", "a\na\n")
    with pytest.raises(SourceError, match=r"classes\.txt: expected a name a line, each once"):
        YcbVideoDataset(ycb)


@pytest.mark.parametrize(
    ("file", "content", "complaint"),
    [
        ("points.xyz", "0 0 0\n1 1", "expected three finite numbers a point, got 5 numbers"),
        ("points.xyz", "0 0 here", "expected three numbers a point"),
        ("points.xyz", "0 0 0 1 1 1 2 2 2 3 3 3 4 4 4", "expected the points of a solid"),
        ("points.xyz", "0 0 0 90 0 0 0 90 0 0 0 90", "looks like millimetres"),
        ("textured_simple.obj", "v 0 0\nf 1 2 3\n", "textured_simple"),
    ],
)
def test_a_model_that_cannot_be_right_is_named(ycb: Path, file: str, content: str, complaint: str) -> None:
    write_text(ycb / "models" / BOWL / file, content)
    with pytest.raises(SourceError, match=complaint):
        YcbVideoDataset(ycb).model(BOWL)


@pytest.mark.skipif(
    "CONCEPTRACK_YCB_VIDEO" not in os.environ,
    reason="set CONCEPTRACK_YCB_VIDEO to the folder of YCB-Video to read its annotations",
)
def test_the_released_keyframes_are_2949_with_14025_instances() -> None:
    dataset = YcbVideoDataset(os.environ["CONCEPTRACK_YCB_VIDEO"])
    targets = [(scene_id, t) for scene_id in dataset.scene_ids for t in dataset.targets(scene_id)]
    assert dataset.scene_ids == tuple(range(48, 60))
    assert len({(scene_id, t.image_id) for scene_id, t in targets}) == 2949
    assert len(targets) == 14_025


def test_a_class_is_called_by_no_path(ycb: Path) -> None:
    write_text(ycb / "image_sets" / "classes.txt", f"{MUG}\n../../{BOWL}\n")
    with pytest.raises(SourceError, match=r"classes\.txt: '../../024_bowl' cannot be the name of a folder"):
        YcbVideoDataset(ycb)
