"""Datasets to evaluate on: a tiny one in BOP's layout, written here, and a scene of the renderer's kind."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from eval.datasets import Dataset, Target, open_dataset
from eval.datasets.bop import BopDataset
from eval.datasets.synthetic import SyntheticDataset
from tracker.errors import SourceError
from tracker.frame import Frame
from tracker.geometry import Floats, Pose
from tracker.sources import Sighting

CORNERS_MM = np.array([[x, y, z] for x in (-30, 30) for y in (-20, 20) for z in (-10, 10)], np.float64)
DIAMETER_MM = float(np.linalg.norm([60, 40, 20]))
VISIBLE = {(3, 1): 0.9, (3, 2): 0.05, (7, 1): 0.1, (7, 2): 0.0}  # (image, object) -> fraction


def write_json(path: Path, content: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))


def write_model(folder: Path, object_id: int, vertices_mm: Floats = CORNERS_MM) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices_mm)}\n"
    header += "property float x\nproperty float y\nproperty float z\nelement face 1\n"
    header += "property list uchar int vertex_indices\nend_header\n"
    body = vertices_mm.astype("<f4").tobytes() + struct.pack("<Biii", 3, 0, 1, 2)
    (folder / f"obj_{object_id:06d}.ply").write_bytes(header.encode() + body)


def entry(object_id: int, image_id: int) -> dict[str, Any]:
    return {
        "obj_id": object_id,
        "cam_R_m2c": [1, 0, 0, 0, 1, 0, 0, 0, 1],
        "cam_t_m2c": [object_id, image_id, 500],
    }


@pytest.fixture
def bop(tmp_path: Path) -> Path:
    """Scenes 5 and 6 of the split `test`, images 3 and 7, objects 1 and 2; no list of targets."""
    for scene_id in (5, 6):
        scene = tmp_path / "test" / f"{scene_id:06d}"
        images = {image_id: [entry(1, image_id), entry(2, image_id)] for image_id in (3, 7)}
        camera = {"cam_K": [100, 0, 32, 0, 100, 24, 0, 0, 1], "depth_scale": 1.0}
        write_json(scene / "scene_camera.json", dict.fromkeys(images, camera))
        write_json(scene / "scene_gt.json", images)
        info = {i: [{"px_count_visib": 50, "visib_fract": VISIBLE[i, o]} for o in (1, 2)] for i in images}
        write_json(scene / "scene_gt_info.json", info)
    models = {str(object_id): {"diameter": DIAMETER_MM} for object_id in (1, 2)}
    models["2"]["symmetries_discrete"] = [[-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]  # pyright: ignore[reportArgumentType]
    write_json(tmp_path / "models" / "models_info.json", models)
    for object_id in (1, 2):
        write_model(tmp_path / "models", object_id)
    return tmp_path


def keys(targets: list[Target]) -> list[tuple[int, int, str]]:
    return [(target.index, target.image_id, target.object_id) for target in targets]


def test_without_a_list_targets_are_what_is_visible_to_a_tenth(bop: Path) -> None:
    dataset = open_dataset(f"bop:{bop}")
    assert dataset.scene_ids == (5, 6)
    assert dataset.object_ids == ("1", "2")
    assert keys(dataset.targets(5)) == [(0, 3, "1"), (1, 7, "1")]
    assert "10%" in dataset.target_rule
    target = dataset.targets(5)[0]
    assert (target.visible_px, target.visible_fraction) == (50, 0.9)
    assert target.T_cam_obj.translation_m.tolist() == [0.001, 0.003, 0.5]


def test_a_list_of_targets_decides_whatever_can_be_seen(bop: Path) -> None:
    listed = [(5, 7, 2), (5, 7, 1), (6, 3, 2), (99, 1, 1)]
    content = [{"scene_id": scene_id, "im_id": image_id, "obj_id": number} for scene_id, image_id, number in listed]
    write_json(bop / "test_targets_bop19.json", content)
    for dataset in (BopDataset(bop), BopDataset(bop / "test")):
        assert keys(dataset.targets(5)) == [(1, 7, "1"), (1, 7, "2")]
        assert keys(dataset.targets(6)) == [(0, 3, "2")]
        assert dataset.target_rule == "test_targets_bop19.json"


def test_the_list_of_the_test_split_is_not_another_splits(bop: Path) -> None:
    write_json(bop / "test_targets_bop19.json", [])
    (bop / "test").rename(bop / "train_real")
    assert len(BopDataset(bop / "train_real").targets(5)) == 2


def test_several_instances_of_an_object_are_warned_of(bop: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_json(bop / "test_targets_bop19.json", [{"scene_id": 5, "im_id": 3, "obj_id": 1, "inst_count": 2}])
    assert len(BopDataset(bop).targets(5)) == 1
    assert "only the first is scored" in caplog.text


@pytest.mark.parametrize("content", [{"scene_id": 5}, [{"scene_id": 5}], [[5, 3, 1]], [{"scene_id": "x"}]])
def test_a_damaged_list_of_targets_is_named(bop: Path, content: object) -> None:
    write_json(bop / "test_targets_bop19.json", content)
    with pytest.raises(SourceError, match=r"test_targets_bop19\.json: not a list"):
        BopDataset(bop)


def test_a_target_without_a_pose_is_named(bop: Path) -> None:
    write_json(bop / "test_targets_bop19.json", [{"scene_id": 5, "im_id": 8, "obj_id": 1}])
    with pytest.raises(SourceError, match="no pose of object 1 in image 8"):
        BopDataset(bop).targets(5)


def test_a_model_is_in_metres_with_every_vertex_of_its_file(bop: Path) -> None:
    model = BopDataset(bop).model("1")
    assert model.points_m.tolist() == (CORNERS_MM / 1000).tolist()
    assert model.diameter_m == pytest.approx(DIAMETER_MM / 1000)
    assert model.triangles is not None
    assert model.triangles.tolist() == [[0, 1, 2]]
    assert model.mesh_vertices_m is model.points_m


def test_a_cloud_of_points_has_no_triangles(bop: Path) -> None:
    rows = "\n".join(" ".join(map(str, corner)) for corner in CORNERS_MM)
    header = (
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    )
    (bop / "models" / "obj_000001.ply").write_text(header + rows + "\n")
    model = BopDataset(bop).model("1")
    assert model.triangles is None
    assert len(model.points_m) == 8


def test_vertices_of_the_same_place_are_not_merged(bop: Path) -> None:
    write_model(bop / "models", 1, np.concatenate((CORNERS_MM, CORNERS_MM)))
    assert len(BopDataset(bop).model("1").points_m) == 16


def test_models_for_evaluation_come_before_the_others(bop: Path) -> None:
    (bop / "models").rename(bop / "models_eval")
    write_model(bop / "models", 1, CORNERS_MM[:3])
    assert len(BopDataset(bop).model("1").points_m) == 8
    assert len(BopDataset(bop / "test").model("1").points_m) == 8


def test_a_symmetry_is_declared_absent_or_not_spoken_of(bop: Path) -> None:
    dataset = BopDataset(bop)
    assert (dataset.model("1").symmetric, dataset.model("2").symmetric) == (False, True)
    assert [len(dataset.model(name).symmetries.motions()) for name in ("1", "2")] == [1, 2]
    write_json(bop / "models" / "models_info.json", {"1": {"diameter": DIAMETER_MM}})
    assert dataset.model("1").symmetric is None


def test_a_symmetry_that_cannot_be_one_is_named(bop: Path) -> None:
    entry = {"diameter": DIAMETER_MM, "symmetries_discrete": [[2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]}
    write_json(bop / "models" / "models_info.json", {"1": entry})
    with pytest.raises(SourceError, match=r"models_info\.json: object 1: .*rotation"):
        BopDataset(bop).model("1")


@pytest.mark.parametrize(
    ("vertices", "diameter", "complaint"),
    [
        (CORNERS_MM / 1000, DIAMETER_MM, "both are in millimetres"),
        (CORNERS_MM, DIAMETER_MM / 1000, "both are in millimetres"),
        (CORNERS_MM / 1000, DIAMETER_MM / 1000, "both are in millimetres"),
        (CORNERS_MM * np.nan, DIAMETER_MM, "finite vertices"),
        (CORNERS_MM, "wide", "object 1: ValueError"),
    ],
)
def test_a_model_that_cannot_be_right_is_named(bop: Path, vertices: Floats, diameter: object, complaint: str) -> None:
    write_json(bop / "models" / "models_info.json", {"1": {"diameter": diameter}})
    write_model(bop / "models", 1, vertices)
    with pytest.raises(SourceError, match=complaint):
        BopDataset(bop).model("1")


def test_what_is_not_there_is_named_with_what_is(bop: Path) -> None:
    dataset = BopDataset(bop)
    with pytest.raises(SourceError, match="has no scene 9; it has 5, 6"):
        dataset.scene(9)
    with pytest.raises(SourceError, match=r"no model in .* '7'; it has 1, 2"):
        dataset.model("7")
    (bop / "models" / "obj_000002.ply").write_bytes(b"ply\nbroken")
    with pytest.raises(SourceError, match=r"obj_000002\.ply: not a PLY file"):
        dataset.model("2")
    (bop / "models" / "models_info.json").unlink()
    with pytest.raises(SourceError, match=r"models_info\.json: cannot be read"):
        dataset.model("1")
    (bop / "models").rename(bop / "shapes")
    with pytest.raises(SourceError, match="no folder models_eval or models"):
        dataset.model("1")


def test_numbers_of_bop_objects_are_their_names(bop: Path) -> None:
    dataset = BopDataset(bop)
    assert (dataset.number("2"), dataset.object_with(2)) == (2, "2")
    assert list(dataset.image_ids(6)) == [3, 7]
    with pytest.raises(SourceError, match="called by number, got 'mug'"):
        dataset.number("mug")


@pytest.mark.parametrize("name", ["ycb:here", "bop", "bop:", "", "mug.concept"])
def test_an_unknown_kind_is_answered_with_the_known_ones(name: str) -> None:
    with pytest.raises(SourceError, match="one of bop, synthetic"):
        open_dataset(name)


def test_a_folder_without_scenes_is_named(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(SourceError, match="no scene"):
            open_dataset(f"bop:{path}")


@dataclass(frozen=True, eq=False)
class Box:
    points_m: Floats
    diameter_m: float = 0.08
    symmetric: bool = True
    vertices_m: Floats = field(default_factory=lambda: CORNERS_MM / 1000)
    triangles: npt.NDArray[np.int64] = field(default_factory=lambda: np.array([[0, 1, 2]]))


class Scene:
    """Two frames; the tin is behind the mug in the second."""

    name = "synthetic:table"
    object_ids = ("tin", "mug")

    def __len__(self) -> int:
        return 2

    def __getitem__(self, index: int) -> Frame:
        raise NotImplementedError

    def __iter__(self) -> Iterator[Frame]:
        raise NotImplementedError

    def sightings(self, object_id: str) -> list[Sighting]:
        return [Sighting(i, Pose.identity(), 9, 0.05 if (object_id, i) == ("tin", 1) else 1.0) for i in range(2)]

    def shape(self, object_id: str) -> Box:
        return Box(np.full((1, 3), float(len(object_id))))


def test_a_rendered_scene_is_a_dataset_of_one_scene() -> None:
    dataset: Dataset = SyntheticDataset(Scene())
    assert (dataset.name, dataset.scene_ids) == ("synthetic:table", (1,))
    assert list(dataset.image_ids(1)) == [0, 1]
    assert keys(dataset.targets(1)) == [(0, 0, "mug"), (0, 0, "tin"), (1, 1, "mug")]
    model = dataset.model("mug")
    assert (model.diameter_m, model.symmetric, len(model.symmetries.motions())) == (0.08, True, 315)
    assert model.triangles is not None
    assert (model.triangles.tolist(), len(model.mesh_vertices_m), len(model.points_m)) == ([[0, 1, 2]], 8, 1)


def test_rendered_objects_are_numbered_by_the_order_of_their_names() -> None:
    dataset = SyntheticDataset(Scene())
    assert [dataset.number(object_id) for object_id in ("mug", "tin")] == [1, 2]
    assert [dataset.object_with(number) for number in (1, 2)] == ["mug", "tin"]
    with pytest.raises(SourceError, match="has no object 'cup'; it has mug, tin"):
        dataset.number("cup")
    with pytest.raises(SourceError, match="has no object number 3; it has 1, 2"):
        dataset.object_with(3)
    with pytest.raises(SourceError, match="has no scene 2; it has 1"):
        dataset.targets(2)


def test_the_project_s_own_scene_opens_with_shapes_and_targets() -> None:
    dataset = open_dataset("synthetic:tabletop?frames=2&size=160x120")
    assert dataset.object_ids == tuple(sorted(dataset.scene(1).object_ids))
    targets = dataset.targets(1)
    assert targets
    for object_id in dataset.object_ids:
        model = dataset.model(object_id)
        assert dataset.object_with(dataset.number(object_id)) == object_id
        assert 0 < model.diameter_m <= np.linalg.norm(np.ptp(model.points_m, axis=0)) + 1e-6


@pytest.mark.shared_data
def test_the_recording_opens_with_its_targets_and_models(shared_data: Path) -> None:
    dataset = open_dataset(f"bop:{shared_data / 'rbt'}")
    targets = dataset.targets(1)
    assert len(targets) == len(json.loads((shared_data / "rbt" / "test_targets_bop19.json").read_text()))
    assert {target.object_id for target in targets} == {"1", "2"}
    model = dataset.model("2")
    assert model.points_m.shape == (7415, 3)
    assert model.diameter_m == pytest.approx(0.105446, abs=1e-6)
