"""A scene in BOP's layout: every image by its own camera and scale, in metres, and damage named by file and image."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tracker.errors import FrameError, SourceError
from tracker.geometry import Pose
from tracker.sources.bop import BopScene, find_scene, scene_ids


def edit(path: Path, change: Callable[[Any], object]) -> None:
    """Read a JSON file, let it be changed in place, write it back."""
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def test_images_come_in_the_order_of_their_numbers_at_a_nominal_rate(bop_dataset: Path) -> None:
    scene = BopScene(bop_dataset, 3)
    assert scene.image_ids == [2, 5, 10]
    assert [frame.stamp_ns for frame in scene] == [66_666_667, 166_666_667, 333_333_333]
    assert [frame.provenance.source for frame in scene] == [f"bop:{bop_dataset}:3 image {i}" for i in (2, 5, 10)]
    assert {frame.provenance.clock for frame in scene} == {"nominal"}


def test_pictures_are_rgb_and_metres_by_the_scale_of_their_own_image(bop_dataset: Path) -> None:
    scene = BopScene(bop_dataset, 3)
    for frame, image_id in zip(scene, scene.image_ids, strict=True):
        assert frame.rgb[30, 40].tolist() == [image_id, 30, 40]
        assert frame.depth_m[30, 40] == pytest.approx((500 + image_id) / 1000)
        assert not frame.depth_m[:, :5].any()
    assert [frame.provenance.raw_depth_unit_m for frame in scene] == pytest.approx([0.001, 0.001, 0.0001])


def test_every_image_has_a_camera_of_its_own(bop_dataset: Path) -> None:
    cameras = [frame.intrinsics for frame in BopScene(bop_dataset, 3)]
    assert [camera.cx for camera in cameras] == [23.2, 23.5, 24]
    assert {(camera.fx, camera.fy, camera.cy, camera.width, camera.height) for camera in cameras} == {
        (60, 61, 17, 48, 36)
    }


def test_a_camera_is_told_without_the_frame(bop_dataset: Path) -> None:
    scene = BopScene(bop_dataset, 3)
    cameras = [frame.intrinsics for frame in scene]
    for picture in (bop_dataset / "test" / "000003" / "depth").iterdir():
        picture.unlink()
    assert [scene.camera(index) for index in range(3)] == cameras
    edit(bop_dataset / "test" / "000003" / "scene_camera.json", lambda cameras: cameras["5"].pop("cam_K"))
    with pytest.raises(SourceError, match=r"scene_camera\.json: image 5: KeyError"):
        BopScene(bop_dataset, 3).camera(1)


def test_poses_are_in_metres_and_rotations_row_by_row(bop_dataset: Path) -> None:
    first = BopScene(bop_dataset, 3).sightings("4")[0].T_cam_obj
    assert np.allclose(first @ np.array([[1.0, 0, 0]]), [[0.010, 1.002, 0.500]])


def test_masks_belong_to_objects_by_position_in_the_list_not_by_number(bop_dataset: Path) -> None:
    first, second, third = BopScene(bop_dataset, 3)
    assert [set(frame.masks) for frame in (first, second, third)] == [{"4", "7"}, {"4", "7"}, {"4"}]
    for frame in (first, second, third):
        assert np.flatnonzero(frame.masks["4"].any(axis=0)).tolist() == [15, 16, 17, 18, 19]
    assert np.flatnonzero(second.masks["7"].any(axis=0)).tolist() == list(range(20, 30))


def test_masks_are_of_the_visible_part_of_the_whole_or_none(bop_dataset: Path) -> None:
    whole = BopScene(bop_dataset, 3, masks="full")[0].masks["4"]
    assert np.flatnonzero(whole.any(axis=0)).tolist() == list(range(10, 20))
    assert dict(BopScene(bop_dataset, 3, masks="none")[0].masks) == {}


def test_a_sighting_is_of_the_first_entry_and_knows_what_is_visible(bop_dataset: Path) -> None:
    scene = BopScene(bop_dataset, 3)
    assert scene.object_ids == ("4", "7")
    four, seven = scene.sightings("4"), scene.sightings("7")
    assert [(s.index, s.visible_px, s.visible_fraction) for s in four] == [(i, 180, 0.5) for i in range(3)]
    assert [(s.index, s.visible_px, s.visible_fraction) for s in seven] == [(i, 360, 1.0) for i in range(2)]
    assert [s.T_cam_obj.translation_m[0] for s in seven] == [0.02, 0.02]


def test_an_image_in_which_the_object_is_hidden_is_a_sighting_of_nothing(bop_dataset: Path) -> None:
    def hide(info: Any) -> None:
        info["2"][0] = {"px_count_visib": 0, "visib_fract": 0.0}

    edit(bop_dataset / "test" / "000003" / "scene_gt_info.json", hide)
    hidden = BopScene(bop_dataset, 3).sightings("4")[0]
    assert (hidden.visible_px, hidden.visible_fraction) == (0, 0)


def test_without_the_counts_the_masks_are_counted(bop_dataset: Path) -> None:
    (bop_dataset / "test" / "000003" / "scene_gt_info.json").unlink()
    assert [s.visible_px for s in BopScene(bop_dataset, 3).sightings("4")] == [180] * 3


def test_without_poses_there_are_frames_and_no_objects(bop_dataset: Path) -> None:
    (bop_dataset / "test" / "000003" / "scene_gt.json").unlink()
    scene = BopScene(bop_dataset, 3)
    assert scene.object_ids == ()
    assert dict(scene[0].masks) == {}


def test_jpeg_pictures_are_found_too(bop_dataset: Path) -> None:
    png = bop_dataset / "test" / "000003" / "rgb" / "000002.png"
    cv2.imwrite(str(png.with_suffix(".jpg")), np.full((36, 48, 3), (10, 20, 200), np.uint8))
    png.unlink()
    assert np.abs(BopScene(bop_dataset, 3)[0].rgb.astype(int) - [200, 20, 10]).max() < 6


def test_a_scene_is_found_from_the_dataset_from_its_split_and_in_another_split(bop_dataset: Path) -> None:
    test = bop_dataset / "test" / "000003"
    assert find_scene(bop_dataset, 3) == find_scene(bop_dataset / "test", 3) == test
    other = bop_dataset / "train_pbr" / "000003"
    other.mkdir(parents=True)
    assert find_scene(bop_dataset, 3) == test
    test.rename(test.with_name("000008"))
    assert find_scene(bop_dataset, 3) == other
    assert scene_ids(bop_dataset) == [8]


def test_a_scene_or_a_folder_that_is_not_there_is_named_with_what_there_is(bop_dataset: Path) -> None:
    with pytest.raises(SourceError, match="has no scene 4; it has 3"):
        BopScene(bop_dataset, 4)
    with pytest.raises(SourceError, match="nowhere is not a folder"):
        BopScene(bop_dataset / "nowhere", 3)


@pytest.mark.parametrize(
    ("file", "content", "complaint"),
    [
        ("scene_camera.json", None, r"scene_camera\.json: cannot be read \(No such file"),
        ("scene_camera.json", '{"2": {"cam_K": [60, 0', r"scene_camera\.json: not JSON .* column"),
        ("scene_camera.json", "[1, 2]", r"scene_camera\.json: not the JSON"),
        ("scene_camera.json", '{"first": {}}', r"scene_camera\.json: not the JSON"),
        ("scene_camera.json", "{}", r"scene_camera\.json lists no image"),
        ("scene_gt.json", '{"2": [{"obj_id": 4}', r"scene_gt\.json: not JSON"),
        ("scene_gt.json", '{"2": [{"cam_t_m2c": [0, 0, 1]}]}', r"scene_gt\.json: image 2 .* obj_id"),
        ("scene_gt.json", '{"2": 4}', r"scene_gt\.json: image 2 .* obj_id"),
        ("scene_gt_info.json", "gone", r"scene_gt_info\.json: not JSON"),
    ],
)
def test_a_damaged_list_is_named_when_the_scene_is_opened(
    bop_dataset: Path, file: str, content: str | None, complaint: str
) -> None:
    path = bop_dataset / "test" / "000003" / file
    if content is None:
        path.unlink()
    else:
        path.write_text(content)
    with pytest.raises(SourceError, match=complaint):
        BopScene(bop_dataset, 3)


@pytest.mark.parametrize(
    ("changes", "error", "complaint"),
    [
        ({"depth_scale": 0}, SourceError, r"scene_camera\.json: image 2: the depth scale must be positive, got 0"),
        ({"depth_scale": -1}, SourceError, "the depth scale must be positive"),
        ({"depth_scale": None}, SourceError, r"scene_camera\.json: image 2: TypeError"),
        ({"cam_K": [60, 0, 23]}, SourceError, r"scene_camera\.json: image 2: ValueError"),
        ({"cam_K": [120, 0, 46, 0, 120, 34, 0, 0, 1]}, FrameError, r"scene_camera\.json: image 2: .*resolution"),
        ({"depth_scale": 1000}, FrameError, "image 2: the median depth is 502: this looks like millimetres"),
    ],
)
def test_a_camera_that_cannot_be_right_is_named_with_its_image(
    bop_dataset: Path, changes: dict[str, Any], error: type[Exception], complaint: str
) -> None:
    edit(bop_dataset / "test" / "000003" / "scene_camera.json", lambda cameras: cameras["2"].update(changes))
    scene = BopScene(bop_dataset, 3)
    with pytest.raises(error, match=complaint):
        scene[0]
    assert scene[1].index == 1


@pytest.mark.parametrize("file", ["rgb/000005.png", "depth/000005.png", "mask_visib/000005_000001.png"])
def test_a_missing_a_half_written_and_a_smaller_picture_are_named_and_the_others_still_read(
    bop_dataset: Path, file: str
) -> None:
    path = bop_dataset / "test" / "000003" / file
    scene, whole = BopScene(bop_dataset, 3), path.read_bytes()
    path.write_bytes(whole[:-20])
    with pytest.raises(SourceError, match=f"{file}: the file is truncated"):
        scene[1]
    path.unlink()
    with pytest.raises(SourceError, match=f"{file}: cannot be read"):
        scene[1]
    smaller = np.ones((18, 24, 3) if "rgb" in file else (18, 24), np.uint8)
    cv2.imwrite(str(path), smaller)
    with pytest.raises(FrameError):
        scene[1]
    path.write_bytes(whole)
    assert [frame.index for frame in scene] == [0, 1, 2]


@pytest.mark.parametrize(
    ("file", "key", "value", "complaint"),
    [
        ("scene_gt.json", "cam_R_m2c", [1, 0, 0, 0, 1, 0], r"scene_gt\.json: image 5, object 4: ValueError"),
        ("scene_gt.json", "cam_R_m2c", [1, 0, 0, 0, 1, 0, 0, 0, -1], r"scene_gt\.json: image 5, object 4: .*det R"),
        ("scene_gt.json", "cam_t_m2c", None, r"scene_gt\.json: image 5, object 4"),
        ("scene_gt_info.json", "visib_fract", None, r"scene_gt_info\.json: image 5, object 4"),
    ],
)
def test_a_damaged_pose_or_count_is_named_by_file_image_and_object(
    bop_dataset: Path, file: str, key: str, value: object, complaint: str
) -> None:
    edit(bop_dataset / "test" / "000003" / file, lambda entries: entries["5"][1].update({key: value}))
    scene = BopScene(bop_dataset, 3)
    with pytest.raises(SourceError, match=complaint):
        scene.sightings("4")
    assert len(scene.sightings("7")) == 2


def test_counts_that_lack_an_image_are_named(bop_dataset: Path) -> None:
    edit(bop_dataset / "test" / "000003" / "scene_gt_info.json", lambda info: info.pop("10"))
    with pytest.raises(SourceError, match=r"scene_gt_info\.json: image 10, object 4: KeyError\(10\)"):
        BopScene(bop_dataset, 3).sightings("4")


@pytest.mark.shared_data
def test_the_recording_has_frames_poses_and_masks_that_agree(shared_data: Path) -> None:
    scene = BopScene(shared_data / "rbt", 1)
    assert len(scene) == 99
    assert scene.object_ids == ("1", "2")
    for index in (0, 50, 98):
        frame = scene[index]
        assert frame.rgb.shape == (480, 640, 3)
        for object_id in scene.object_ids:
            sighting = scene.sightings(object_id)[index]
            assert sighting.visible_px == pytest.approx(frame.masks[object_id].sum(), rel=0.02)
            assert isinstance(sighting.T_cam_obj, Pose)
            depth_m = frame.depth_m[frame.masks[object_id] & (frame.depth_m > 0)]
            assert abs(np.median(depth_m) - sighting.T_cam_obj.translation_m[2]) < 0.1
