"""NOCS REAL275: a small copy of it is written, read back in metres, and damaged."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import eval.scene_models
from eval.datasets import category_of, open_dataset
from eval.datasets.nocs import NocsDataset
from eval.predict import track_scene
from eval.protocol import Protocol
from reference.vocabulary import read_vocabulary
from tests.recordings import (
    CORNERS_M,
    DIAMETER_M,
    SIZE_M,
    assert_nothing_is_wrong,
    pose,
    score_the_truth,
    write_matrix,
    write_obj,
    write_picture,
    write_text,
)
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, OnboardingError, SourceError
from tracker.frame import PosedFrame
from tracker.saliency import SaliencyBackend
from tracker.sources import PosedSource

HEIGHT, WIDTH = 480, 640  # the camera is REAL275's
MUG, CAN = "mug_daniel_norm", "can_arizona_tea_norm"
META = f"1 0 book_norm\n2 6 {MUG}\n3 4 {CAN}\n"


def write_image(folder: Path, image_id: int, *, packed: bool = False) -> None:
    """Colour (200, 30, image id), 700 + image id millimetres away; instance k is 5 pixels of row 10 k."""
    write_picture(folder / f"{image_id:04d}_color.png", np.full((HEIGHT, WIDTH, 3), (200, 30, image_id), np.uint8))
    depth = np.full((HEIGHT, WIDTH), 700 + image_id, np.uint16)
    depth[0] = 0
    if packed:
        depth = np.dstack((depth % 256, depth // 256, np.full_like(depth, 77))).astype(np.uint8)
    write_picture(folder / f"{image_id:04d}_depth.png", depth)
    labels = np.full((HEIGHT, WIDTH), 255, np.uint8)
    for instance in (1, 2, 3):
        labels[10 * instance, 10:15] = instance
    write_picture(
        folder / f"{image_id:04d}_mask.png", np.dstack((labels, np.zeros_like(labels), np.zeros_like(labels)))
    )
    write_text(folder / f"{image_id:04d}_meta.txt", META)


def pose_file(root: Path, scene_id: int, name: str, image_id: int) -> Path:
    return root / "gts" / "real_test_text" / f"scene_{scene_id}" / f"model_{name}" / f"{image_id:04d}.txt"


@pytest.fixture
def nocs(tmp_path: Path) -> Path:
    """Scene 1 (images 0 and 7, whose depth is packed) and scene 10 (image 3): a book (background), a mug, a can."""
    for scene_id, image_id in ((1, 0), (1, 7), (10, 3)):
        write_image(tmp_path / "real_test" / f"scene_{scene_id}", image_id, packed=image_id == 7)
        for name in (MUG, CAN):
            write_matrix(pose_file(tmp_path, scene_id, name, image_id), pose(len(name) / 100 + image_id / 1000).matrix)
    for name in (MUG, CAN):
        write_obj(tmp_path / "obj_models" / "real_test" / f"{name}.obj")
        write_text(tmp_path / "obj_models" / "real_test" / f"{name}.txt", " ".join(map(str, SIZE_M)))
    return tmp_path


def test_frames_are_rgb_and_metres_whether_depth_is_packed_or_not(nocs: Path) -> None:
    scene = open_dataset(f"nocs:{nocs}").scene(1)
    assert len(scene) == 2
    for frame, image_id in zip(scene, (0, 7), strict=True):
        assert (frame.rgb == [200, 30, image_id]).all()
        assert np.allclose(frame.depth_m[1:], (700 + image_id) / 1000)
        assert (frame.depth_m[0] == 0).all()
        assert frame.intrinsics.matrix[:2].tolist() == [[591.0125, 0, 322.525], [0, 590.16775, 244.11084]]
        assert frame.stamp_ns == round(image_id * 1e9 / 30)
        assert {name: np.argwhere(mask).tolist() for name, mask in frame.masks.items()} == {
            name: [[10 * instance, column] for column in range(10, 15)] for name, instance in ((MUG, 2), (CAN, 3))
        }


def test_a_mask_of_one_channel_is_read_alike(nocs: Path) -> None:
    labels = np.full((HEIGHT, WIDTH), 255, np.uint8)
    labels[100:110, 50:60] = 3
    write_picture(nocs / "real_test" / "scene_10" / "0003_mask.png", labels)
    masks = NocsDataset(nocs).scene(10)[0].masks
    assert (int(masks[CAN].sum()), int(masks[MUG].sum())) == (100, 0)


def test_targets_are_the_instances_with_a_pixel_and_a_pose_and_no_bystander(
    nocs: Path, caplog: pytest.LogCaptureFixture
) -> None:
    dataset = open_dataset(f"nocs:{nocs}")
    assert dataset.scene_ids == (1, 10)
    assert list(dataset.image_ids(1)) == [0, 7]
    targets = dataset.targets(1)
    assert [(t.index, t.image_id, t.object_id) for t in targets] == [(0, 0, CAN), (0, 0, MUG), (1, 7, CAN), (1, 7, MUG)]
    assert {(t.visible_px, t.visible_fraction) for t in targets} == {(5, 1.0)}
    assert not caplog.records
    pose_file(nocs, 10, MUG, 3).unlink()
    assert [t.object_id for t in NocsDataset(nocs).targets(10)] == [CAN]
    assert "1 instances have no file of their pose" in caplog.text


def test_poses_are_camera_from_object_and_the_size_of_nocs_s_own_matrices_is_left_out(nocs: Path) -> None:
    true = pose(0.03)
    for scale in (1.0, 0.27, 3.0):
        matrix = true.matrix
        matrix[:3, :3] *= scale
        write_matrix(pose_file(nocs, 10, CAN, 3), matrix)
        (sighting,) = NocsDataset(nocs).scene(10).sightings(CAN)
        assert np.allclose(sighting.T_cam_obj.matrix, true.matrix)


def test_objects_are_numbered_by_name_and_those_of_an_axis_are_symmetric(nocs: Path) -> None:
    dataset = NocsDataset(nocs)
    assert dataset.object_ids == (CAN, MUG)
    assert (dataset.number(MUG), dataset.object_with(1)) == (2, CAN)
    assert (dataset.model(MUG).symmetric, dataset.model(CAN).symmetric) == (False, True)
    assert np.allclose(dataset.model(CAN).points_m, CORNERS_M)
    assert dataset.model(CAN).diameter_m == pytest.approx(DIAMETER_M)


def test_an_instance_has_the_concepts_of_the_category_that_its_meta_file_says(nocs: Path) -> None:
    real275 = read_vocabulary("real275")
    dataset = open_dataset(f"nocs:{nocs}")
    with pytest.raises(ConfigError, match=f"none for object '{MUG}'; there are 1 = bottle, "):
        real275.for_object(MUG)
    found = {name: real275.for_object(name, category_of(dataset, name)).category for name in dataset.object_ids}
    assert found == {CAN: "can", MUG: "mug"}
    for scene_id, image_id in ((1, 0), (1, 7), (10, 3)):  # whatever it is called: this one has become a bowl
        write_text(nocs / "real_test" / f"scene_{scene_id}" / f"{image_id:04d}_meta.txt", META.replace("2 6", "2 2"))
    assert category_of(NocsDataset(nocs), MUG) == "bowl"
    with pytest.raises(SourceError, match="has no object 'cup'"):
        NocsDataset(nocs).category("cup")


def test_models_are_made_with_them(nocs: Path, attributes: SaliencyBackend, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, tuple[str, ...] | None] = {}

    def noted(frames: Sequence[PosedFrame], *settings: object) -> None:
        (asked[frames[0].object_id],) = settings[-1:]  # pyright: ignore[reportArgumentType]
        raise OnboardingError("five pixels make no model")

    monkeypatch.setattr(eval.scene_models, "onboard", noted)
    monkeypatch.setattr(eval.scene_models, "read_reference_frames", _reference_frames)
    vocabularies = read_vocabulary("real275")
    track_scene(NocsDataset(nocs), 1, Protocol(attributes, TrackerConfig(), views=1, vocabularies=vocabularies))
    assert asked == {CAN: vocabularies.for_object("can").labels, MUG: vocabularies.for_object("mug").labels}


def _reference_frames(source: PosedSource, object_id: str, views: int) -> list[PosedFrame]:
    """The first, however little of the object can be seen."""
    frame = source[0]
    sighting = source.sightings(object_id)[0]
    return [PosedFrame(frame, object_id, sighting.T_cam_obj, frame.masks[object_id])][:views]


@pytest.mark.parametrize("place", ["real_test", "Real/test"])
def test_the_truth_has_no_error(nocs: Path, place: str) -> None:
    (nocs / "Real").mkdir()
    (nocs / "real_test").rename(nocs / place)
    assert_nothing_is_wrong(score_the_truth(NocsDataset(nocs), nocs), instances=6)
    if place == "real_test":
        assert_nothing_is_wrong(score_the_truth(NocsDataset(nocs / place), nocs), instances=6)


def test_without_poses_as_text_the_form_that_is_expected_is_told(nocs: Path) -> None:
    (nocs / "gts" / "real_test_text").rename(nocs / "gts" / "elsewhere")
    write_text(nocs / "gts" / "real_test" / "results_real_test_scene_1_0000.pkl", "")
    with pytest.raises(SourceError, match=r"gts/real_test_text/scene_N/model_NAME/FFFF\.txt, each a 4x4.*pickles"):
        NocsDataset(nocs).targets(1)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("1 0 0 0", "expected 16 numbers, got 4"),
        ("gt " * 16, r"expected 16 numbers \(could not convert"),
        ("0 " * 15 + "1", "not a scaled rotation: its determinant is 0"),
        ("1 0 0 0 0 2 0 0 0 0 1 0 0 0 0 1", "not a rotation"),
        ("-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "not a scaled rotation: its determinant is -1"),
        ("nan " * 16, "a pose is a finite"),
    ],
)
def test_a_damaged_pose_is_named_by_its_file(nocs: Path, content: str, complaint: str) -> None:
    pose_file(nocs, 10, MUG, 3).write_text(content)
    with pytest.raises(SourceError, match=rf"scene_10/model_{MUG}/0003\.txt: {complaint}"):
        NocsDataset(nocs).targets(10)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"2 6\n", "expected lines INSTANCE CLASS NAME, got '2 6'"),
        (b"two 6 mug\n", "expected lines INSTANCE CLASS NAME"),
        (b"255 6 mug\n", "instances are below 255, classes below 7, got .*'255'"),
        (b"2 7 mug\n", "instances are below 255, classes below 7, got .*'7'"),
        (b"\xff\xfe\x00", "not text"),
    ],
)
def test_a_damaged_list_of_instances_is_named_by_its_file(nocs: Path, content: bytes, complaint: str) -> None:
    (nocs / "real_test" / "scene_10" / "0003_meta.txt").write_bytes(content)
    with pytest.raises(SourceError, match=rf"0003_meta\.txt: {complaint}"):
        NocsDataset(nocs).targets(10)


@pytest.mark.parametrize("what", ["color", "depth", "mask"])
def test_a_half_written_picture_is_named_when_its_frame_is_read_and_not_before(nocs: Path, what: str) -> None:
    file = nocs / "real_test" / "scene_1" / f"0007_{what}.png"
    file.write_bytes(file.read_bytes()[:-20])
    scene = NocsDataset(nocs).scene(1)
    assert scene[0].index == 0
    with pytest.raises(SourceError, match=rf"0007_{what}\.png: the file is truncated"):
        scene[1]


def test_what_is_missing_is_named(nocs: Path) -> None:
    dataset = NocsDataset(nocs)
    with pytest.raises(SourceError, match="has no scene 2; it has 1, 10"):
        dataset.scene(2)
    with pytest.raises(SourceError, match=f"has no object 'cup'; it has {CAN}, {MUG}"):
        dataset.model("cup")
    write_text(nocs / "obj_models" / "real_test" / f"{CAN}.txt", "1 0.7 0.3")
    with pytest.raises(SourceError, match=rf"{CAN}\.obj: its vertices span .* both are in metres"):
        dataset.model(CAN)
    (nocs / "obj_models" / "real_test" / f"{MUG}.obj").unlink()
    with pytest.raises(SourceError, match=rf"expected in .*obj_models/real_test/{MUG}\.obj"):
        dataset.model(MUG)
    with pytest.raises(SourceError, match="no scene"):
        NocsDataset(nocs / "gts")


def test_an_object_is_called_by_no_path(nocs: Path) -> None:
    write_text(nocs / "real_test" / "scene_1" / "0000_meta.txt", "2 6 ../../../mug\n")
    with pytest.raises(SourceError, match=r"0000_meta\.txt: '../../../mug' cannot be the name of a folder"):
        NocsDataset(nocs).targets(1)
