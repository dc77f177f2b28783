"""The model file: exact, whole or absent, and nothing in it that could run."""

from __future__ import annotations

import json
import pickle
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import safetensors.numpy

from tracker.concept import ARRAYS, FORMAT_VERSION, ConceptModel, told_apart
from tracker.declared_symmetry import parse_symmetry
from tracker.errors import ModelError, OutputError
from tracker.saliency import SaliencyBackend
from tracker.symmetry import NO_SYMMETRY

SYMMETRY = NO_SYMMETRY.packed()


def model(points: int = 60, labels: tuple[str, ...] = ("red", "flat", "grün"), seed: int = 0) -> ConceptModel:
    rng = np.random.default_rng(seed)
    return ConceptModel(
        object_id="Tasse №1",
        points=rng.normal(size=(points, 3)),
        normals=rng.normal(size=(points, 3)),
        colours=rng.random((points, 3), np.float32) * 255,
        saliency=rng.random((points, len(labels)), np.float32),
        view_count=rng.integers(1, 4, points).astype(np.int32),
        agreement=rng.random(points, np.float32),
        view_directions=rng.normal(size=(2, 3)),
        diameter_m=0.1 + 0.2,  # not a short decimal
        labels=labels,
        backend="attributes",
        fingerprint="attributes-0123456789ab",
        notes={"reference_frames": ["bop:x:1 image 5"], "quality": {"coverage": 1 / 3, "problems": []}},
        symmetry=parse_symmetry("0.1/0.2/0.3:inf,0.2/-0.1/0:180", np.array([0.1, 1 / 3, 0])),
    )


def same(a: ConceptModel, b: ConceptModel) -> bool:
    arrays = all(
        np.array_equal(getattr(a, name), getattr(b, name)) and getattr(a, name).dtype == getattr(b, name).dtype
        for name in ARRAYS
    )
    others = [name for name in ConceptModel.__slots__ if name not in (*ARRAYS, "references", "symmetry")]
    return (
        arrays
        and a.symmetry.packed() == b.symmetry.packed()
        and all(getattr(a, name) == getattr(b, name) for name in others)
    )


def rewritten(path: Path, **header: Any) -> Path:
    """The model file with other values in its header; a value of None leaves the key out."""
    with safetensors.safe_open(path, framework="numpy") as file:
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
        content = json.loads(file.metadata()["concept_model"]) | header
    kept = {key: value for key, value in content.items() if value is not None}
    safetensors.numpy.save_file(arrays, path, metadata={"concept_model": json.dumps(kept)})
    return path


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    model().save(tmp_path / "mug.concept")
    return tmp_path / "mug.concept"


def test_what_is_loaded_is_what_was_saved_to_the_bit(tmp_path: Path, can_model: ConceptModel) -> None:
    for one in (model(), model(points=1, labels=("a",)), can_model):
        one.save(tmp_path / "one.concept")
        loaded = ConceptModel.load(tmp_path / "one.concept")
        assert same(loaded, one)
        loaded.save(str(tmp_path / "two.concept"))
        assert (tmp_path / "one.concept").read_bytes() == (tmp_path / "two.concept").read_bytes()


def test_a_model_of_strided_arrays_is_saved_as_it_is(tmp_path: Path) -> None:
    strided = replace(model(), points=np.asfortranarray(model().points), saliency=model(120).saliency[::2])
    strided.save(tmp_path / "a.concept")
    assert same(ConceptModel.load(tmp_path / "a.concept"), strided)


def test_the_folder_is_made_and_an_older_file_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "models" / "kitchen" / "mug.concept"
    model(seed=1).save(path)
    model(seed=2).save(path)
    assert same(ConceptModel.load(path), model(seed=2))
    assert [file.name for file in path.parent.iterdir()] == ["mug.concept"]


@pytest.mark.parametrize("broken", ["pathlib.Path.write_bytes", "os.replace"])
def test_a_disk_that_fails_leaves_the_older_file_and_no_litter(
    saved: Path, broken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(broken, full)
    with pytest.raises(OutputError, match=r"mug\.concept: cannot be written \(No space left"):
        model(seed=5).save(saved)
    monkeypatch.undo()
    assert same(ConceptModel.load(saved), model())
    assert list(saved.parent.iterdir()) == [saved]


def test_a_place_that_cannot_be_written_to_is_named(saved: Path) -> None:
    (saved.parent / "folder").mkdir()
    for path in (saved / "within" / "a.concept", saved / "a.concept", saved.parent / "folder"):
        with pytest.raises(OutputError, match=f"{path}: cannot be written"):
            model().save(path)
    assert same(ConceptModel.load(saved), model())


@pytest.mark.parametrize("share", [0.0, 0.0005, 0.01, 0.3, 0.9, 1.0])
def test_a_truncated_file_is_named(saved: Path, share: float) -> None:
    whole = saved.read_bytes()
    saved.write_bytes(whole[: min(int(share * len(whole)), len(whole) - 1)])
    with pytest.raises(ModelError, match=r"mug\.concept: not a whole concept model"):
        ConceptModel.load(saved)


def test_a_model_of_another_version_is_refused_with_both_versions_and_what_to_do(saved: Path) -> None:
    rewritten(saved, version=FORMAT_VERSION + 1)
    with pytest.raises(
        ModelError, match=f"of version {FORMAT_VERSION + 1}, this program reads version {FORMAT_VERSION}: make"
    ):
        ConceptModel.load(saved)


@pytest.mark.parametrize(
    ("header", "complaint"),
    [
        ({"format": None}, "but not a concept model"),
        ({"format": "a language model"}, "but not a concept model"),
        ({"labels": None}, "header's labels is None, expected a list"),
        ({"labels": "red"}, "header's labels is 'red', expected a list"),
        ({"labels": []}, r"header's labels are \[\], expected texts"),
        ({"labels": ["red", 5, None]}, "header's labels are .*, expected texts"),
        ({"labels": ["red", "flat"]}, r"saliency has shape \(60, 3\) \(expected \(60, 2\)\)"),
        ({"object_id": 5}, "header's object_id is 5, expected a str"),
        ({"backend": None}, "header's backend"),
        ({"fingerprint": None}, "header's fingerprint"),
        ({"notes": []}, "header's notes"),
        ({"symmetry": None}, "header's symmetry is None, expected a dict"),
        ({"symmetry": {}}, "a symmetry has turns, origin_m and axis: KeyError"),
        ({"symmetry": SYMMETRY | {"turns": "all"}}, "a symmetry has turns, origin_m and axis: ValueError"),
        ({"symmetry": SYMMETRY | {"turns": []}}, r"1 to 360 turns of 3x3, got shape \(0,\)"),
        ({"symmetry": SYMMETRY | {"turns": [np.eye(3).tolist()] * 361}}, "1 to 360 turns"),
        ({"symmetry": SYMMETRY | {"turns": [np.diag([-1, -1, 1]).tolist()]}}, "rotations, the identity first"),
        ({"symmetry": SYMMETRY | {"turns": [np.eye(3).tolist(), np.diag([1, 1, -1]).tolist()]}}, "are rotations"),
        ({"symmetry": SYMMETRY | {"turns": [[[float("nan")] * 3] * 3]}}, "are rotations"),
        ({"symmetry": SYMMETRY | {"origin_m": [0, 0]}}, "origin_m is three finite numbers"),
        ({"symmetry": SYMMETRY | {"axis": [0, 0, 2]}}, "axis is a unit vector or null"),
        ({"diameter_m": "wide"}, "header's diameter_m is 'wide', expected a float"),
        ({"diameter_m": 0.0}, r"header's diameter_m is 0\.0, expected a length"),
        ({"diameter_m": 1e9}, "expected a length in metres"),
        ({"diameter_m": float("nan")}, "header's diameter_m is nan, expected a length"),
    ],
)
def test_a_header_that_cannot_be_right_is_refused_by_what_is_wrong(
    saved: Path, header: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(ModelError, match=rf"mug\.concept: .*{complaint}"):
        ConceptModel.load(rewritten(saved, **header))


@pytest.mark.parametrize(
    ("name", "array", "complaint"),
    [
        ("normals", np.zeros((59, 3)), r"normals has shape \(59, 3\) \(expected \(60, 3\)\)"),
        ("points", np.full((60, 3), np.nan), "points .* not finite"),
        ("points", np.full((60, 3), 1e200), "points has values beyond 1000"),
        ("points", np.zeros((60, 3), np.int32), "points .* is of int32"),
        ("saliency", np.full((60, 3), 1e30, np.float32), "saliency has values beyond 2"),
        ("view_count", np.zeros((60, 1), np.int32), "view_count has shape"),
        ("view_count", np.zeros(60, np.float32), "view_count .* is of float32"),
        ("agreement", None, "not a whole concept model .*agreement"),
    ],
)
def test_arrays_that_cannot_be_right_are_refused_by_name(
    saved: Path, name: str, array: np.ndarray | None, complaint: str
) -> None:
    with safetensors.safe_open(saved, framework="numpy") as file:
        arrays = {key: file.get_tensor(key) for key in ARRAYS}
        metadata = file.metadata()
    kept = {key: value for key, value in (arrays | {name: array}).items() if value is not None}
    safetensors.numpy.save_file(kept, saved, metadata=metadata)
    with pytest.raises(ModelError, match=rf"mug\.concept: {complaint}"):
        ConceptModel.load(saved)


def test_a_header_that_is_no_object_is_refused(saved: Path) -> None:
    for text in ("[]", "5", '"text"', "[" * 5000):
        safetensors.numpy.save_file({"points": np.zeros((3, 3))}, saved, metadata={"concept_model": text})
        with pytest.raises(ModelError, match=r"mug\.concept: "):
            ConceptModel.load(saved)


def test_views_that_claim_more_pictures_than_there_is_memory_are_refused_before_they_are_made(saved: Path) -> None:
    camera = [6000.0, 6000.0, 2880.0, 2880.0, 5760, 5760]  # 8 bytes a pixel, and the file holds none of them
    with pytest.raises(ModelError, match=r"mug\.concept: .*9 reference views of 298598400.* expected at most"):
        ConceptModel.load(rewritten(with_views(saved, 9), references=[{"camera": camera}] * 9))
    for header, complaint in (
        (view_of(15_000), "an image has at most"),
        ("a view", "damaged"),
        ({"camera": [60, 60, 5, 5, 10**400, 10]}, "damaged"),
        (view_of(10) | {"x": "left"}, "damaged"),
        (view_of(10) | {"depth_unit_m": float("nan")}, "damaged"),
    ):
        with pytest.raises(ModelError, match=rf"mug\.concept: .*a reference view is damaged.*{complaint}|{complaint}"):
            ConceptModel.load(rewritten(with_views(saved, 1), references=[header]))


def with_views(path: Path, count: int) -> Path:
    """Arrays of so many views of one pixel, whatever the header says."""
    with safetensors.safe_open(path, framework="numpy") as file:
        arrays = {name: file.get_tensor(name) for name in ARRAYS}
        metadata = file.metadata()
    kinds = {
        "rgb": np.zeros((1, 1, 3), np.uint8),
        "depth": np.zeros((1, 1), np.uint16),
        "mask": np.zeros((1, 1), np.uint8),
    }
    views = {f"view{k}.{part}": array for k in range(count) for part, array in kinds.items()}
    safetensors.numpy.save_file(arrays | views, path, metadata=metadata)
    return path


def view_of(size: int) -> dict[str, Any]:
    """The header of a view."""
    camera = [size, size, size / 2, size / 2, size, size]
    told = {"depth_unit_m": 0.001, "T_cam_obj": np.eye(4).tolist(), "source": "", "index": 0}
    return {"x": 0, "y": 0, "camera": camera, **told}


def test_what_is_no_model_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "none.concept", tmp_path):
        with pytest.raises(ModelError, match=f"{path}: there is no such model file"):
            ConceptModel.load(path)
    (tmp_path / "text.concept").write_text("a mug, probably")
    with pytest.raises(ModelError, match=r"text\.concept: not a whole concept model"):
        ConceptModel.load(tmp_path / "text.concept")
    safetensors.numpy.save_file({"weights": np.zeros(3)}, tmp_path / "net.safetensors")
    with pytest.raises(ModelError, match="a safetensors file, but not a concept model"):
        ConceptModel.load(tmp_path / "net.safetensors")
    safetensors.numpy.save_file({"a": np.zeros(3)}, tmp_path / "odd.concept", metadata={"concept_model": "{"})
    with pytest.raises(ModelError, match=r"odd\.concept: not a whole concept model"):
        ConceptModel.load(tmp_path / "odd.concept")


class Bomb:
    """Unpickling it makes a file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self._path,)


def test_a_pickle_in_a_model_s_clothes_is_refused_and_does_not_run(tmp_path: Path) -> None:
    path, mark = tmp_path / "mug.concept", tmp_path / "it ran"
    path.write_bytes(pickle.dumps({"points": Bomb(mark)}))
    with pytest.raises(ModelError, match="not a whole concept model"):
        ConceptModel.load(path)
    assert not mark.exists()
    pickle.loads(path.read_bytes())  # noqa: S301 (the bomb is live, so the line above says something)
    assert mark.exists()


def test_the_file_is_a_json_header_and_bare_numbers(saved: Path) -> None:
    data = saved.read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + length])
    concept = json.loads(header.pop("__metadata__")["concept_model"])
    assert concept["labels"] == ["red", "flat", "grün"]
    assert set(header) == set(ARRAYS)
    assert len(data) == 8 + length + sum(getattr(model(), name).nbytes for name in ARRAYS)


def test_a_model_of_another_backend_or_other_settings_is_refused_and_told_how_to_make_it_again(
    can_model: ConceptModel, attributes: SaliencyBackend
) -> None:
    can_model.require_backend(attributes)
    for other in (
        replace(can_model, backend="clip", fingerprint="clip-aa"),
        replace(can_model, fingerprint="attributes-000000000000"),
    ):
        with pytest.raises(ModelError, match=r"python -m reference \.\.\. --backend attributes") as caught:
            other.require_backend(attributes)
        for part in (repr(other.object_id), other.backend, other.fingerprint, attributes.fingerprint):
            assert part in str(caught.value)


def test_two_of_a_kind_are_told_apart_by_name(can_model: ConceptModel) -> None:
    mug = replace(can_model, object_id="mug")
    named = told_apart([can_model, mug, can_model, can_model])
    assert [model.object_id for model in named] == ["soup_can", "mug", "soup_can_2", "soup_can_3"]
    assert all(model.points is can_model.points for model in named)
