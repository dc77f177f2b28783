"""The vision-language backends from the outside: real loading of tiny networks, sound maps, bad input refused."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from tests.tiny_networks import SAVE, save_clip, save_siglip
from tracker.errors import ConfigError
from tracker.frame import Mask, PosedFrame
from tracker.geometry import Pose
from tracker.saliency import BackendOptions, Query, Saliency, SaliencyBackend, open_backend
from tracker.saliency.vision_language import CROPS_KEPT, GENERAL_LABELS
from tracker.view import ObjectView, ViewConfig, bounding_box, view_object

LABELS = ("handle", "rim", "red spout", "body")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "conceptrack" / "text"


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return {name: save(tmp_path_factory.mktemp(name)) for name, save in SAVE.items()}


def opened(name: str, folder: Path) -> SaliencyBackend:
    return open_backend(name, BackendOptions(str(folder), "cpu"))


@pytest.fixture(scope="module")
def balls(globe: Callable[..., PosedFrame]) -> list[ObjectView]:
    places = ((0.01, -0.005, 0.35), (-0.03, 0.02, 0.5))
    return [seen(ball, ball.mask) for ball in (globe(Pose(np.eye(3), np.array(at))) for at in places)]


def seen(posed: PosedFrame, mask: Mask) -> ObjectView:
    view = view_object(posed.frame, mask, 0.1, ViewConfig())
    assert view is not None
    return view


def asked(backend: SaliencyBackend, views: list[ObjectView], labels: tuple[str, ...] = LABELS) -> list[Saliency]:
    return backend([Query(view, labels) for view in views])


@pytest.mark.parametrize("name", SAVE)
def test_every_backend_maps_every_label_over_the_box_of_the_mask(
    name: str, folders: dict[str, Path], balls: list[ObjectView]
) -> None:
    backend = opened(name, folders[name])
    assert backend.name == name
    for saliency, view in zip(asked(backend, balls), balls, strict=True):
        assert saliency.labels == LABELS
        assert saliency.maps.shape == (4, 4, 4)
        assert saliency.maps.dtype == np.float32
        assert saliency.maps.min() >= 0
        assert saliency.maps.max() == pytest.approx(1, abs=1e-3)
        assert saliency.box == bounding_box(view.mask)


@pytest.mark.parametrize("name", SAVE)
def test_a_batch_gives_what_one_by_one_gives_whatever_the_vocabularies(
    name: str, folders: dict[str, Path], balls: list[ObjectView]
) -> None:
    queries = [Query(balls[0], LABELS), Query(balls[1], ("lid", "label"))]
    together = opened(name, folders[name])(queries)
    for query, saliency in zip(queries, together, strict=True):
        (alone,) = opened(name, folders[name])([query])
        assert alone.maps.shape == (len(query.labels), 4, 4)
        assert np.allclose(alone.maps, saliency.maps, atol=5e-3)


def test_the_maps_are_of_the_crop_and_follow_the_object(
    folders: dict[str, Path], globe: Callable[..., PosedFrame]
) -> None:
    """The same pixels elsewhere in the picture: the same maps, in a box that moved along."""
    ball = globe(Pose(np.eye(3), np.array([0.0, 0.0, 0.5])))
    moved_frame = replace(
        ball.frame, rgb=np.roll(ball.frame.rgb, 20, axis=1), depth_m=np.roll(ball.frame.depth_m, 20, axis=1)
    )
    moved = replace(ball, frame=moved_frame, mask=np.roll(ball.mask, 20, axis=1))
    here, there = asked(opened("siglip2", folders["siglip2"]), [seen(ball, ball.mask), seen(moved, moved.mask)])
    assert np.allclose(here.maps, there.maps, atol=5e-3)
    assert there.box.x0 == here.box.x0 + 20


def test_an_unchanged_crop_is_not_computed_again(
    folders: dict[str, Path], balls: list[ObjectView], monkeypatch: pytest.MonkeyPatch
) -> None:
    backend = opened("siglip2", folders["siglip2"])
    first = asked(backend, balls)
    batches: list[int] = []
    maps = backend._encoder.maps  # type: ignore[attr-defined]

    def counted(pixels: torch.Tensor, texts: torch.Tensor) -> torch.Tensor:
        batches.append(len(pixels))
        return maps(pixels, texts)

    monkeypatch.setattr(backend._encoder, "maps", counted)  # type: ignore[attr-defined]
    again = asked(backend, balls)
    assert batches == []
    assert all(np.array_equal(a.maps, b.maps) for a, b in zip(first, again, strict=True))
    asked(backend, balls[:1], ("rim",))  # another vocabulary is another question
    changed = replace(balls[1], frame=replace(balls[1].frame, rgb=255 - balls[1].frame.rgb))
    asked(backend, [balls[0], changed])
    assert batches == [1, 1]
    assert len(backend._crops) <= CROPS_KEPT  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", SAVE)
def test_one_pixel_and_a_mask_at_the_border_have_maps_too(
    name: str, folders: dict[str, Path], globe: Callable[..., PosedFrame]
) -> None:
    ball = globe(Pose(np.eye(3), np.array([0.0, 0.0, 0.5])))
    pixel, border = np.zeros_like(ball.mask), np.zeros_like(ball.mask)
    pixel[ball.mask.shape[0] // 2, ball.mask.shape[1] // 2] = True
    border[:, :40] = border[-10:] = True
    for saliency in asked(opened(name, folders[name]), [seen(ball, pixel), seen(ball, border)]):
        assert saliency.maps.shape == (4, 4, 4)
        assert np.isfinite(saliency.maps).all()


def test_without_a_vocabulary_there_is_a_general_one(folders: dict[str, Path]) -> None:
    backend = opened("clip", folders["clip"])
    assert backend.labels_for(None) == GENERAL_LABELS
    assert len(set(GENERAL_LABELS)) == 20
    assert backend.labels_for(["rim", "lid"]) == ("rim", "lid")


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        (("rim", "the " * 30 + "handle"), ("'the the", "tokens", "at most")),
        (("rim", "Rim"), ("'Rim'", "twice")),
        ((), ("empty",)),
        (("rim", ""), ("''",)),
    ],
)
@pytest.mark.parametrize("name", SAVE)
def test_a_vocabulary_that_cannot_be_asked_is_refused(
    name: str, labels: tuple[str, ...], words: tuple[str, ...], folders: dict[str, Path]
) -> None:
    with pytest.raises(ConfigError) as refusal:
        opened(name, folders[name]).labels_for(labels)
    assert all(word in str(refusal.value) for word in words)


def test_the_fingerprint_is_of_the_weights_and_not_of_the_folder(folders: dict[str, Path], tmp_path: Path) -> None:
    fingerprint = opened("siglip2", folders["siglip2"]).fingerprint
    shutil.copytree(folders["siglip2"], tmp_path / "copy")
    assert opened("siglip2", tmp_path / "copy").fingerprint == fingerprint
    assert opened("siglip2", save_siglip(tmp_path / "other", seed=1)).fingerprint != fingerprint


@pytest.mark.parametrize(
    ("name", "weights", "words"),
    [
        ("siglip2", "{clip}", ("'clip'", "expected 'siglip'")),
        ("clip", "{siglip2}", ("'siglip'", "expected 'clip'")),
        ("dinotxt", "{clip}", ("'clip'", "expected 'dinotxt'")),
        ("siglip2", "{empty}", ("config.json",)),
        ("siglip2", "huge", ("'huge'", "giant, large, base")),
        ("siglip2", "./nowhere/at-all", ("nowhere",)),
        ("dinotxt", None, ("--weights",)),
    ],
)
def test_weights_of_another_kind_or_of_none_are_refused(
    name: str, weights: str | None, words: tuple[str, ...], folders: dict[str, Path], tmp_path: Path
) -> None:
    places = {**{key: str(path) for key, path in folders.items()}, "empty": str(tmp_path)}
    with pytest.raises(ConfigError) as refusal:
        open_backend(name, BackendOptions(weights and weights.format(**places), "cpu"))
    assert all(word in str(refusal.value) for word in words)


def test_weights_that_are_cut_off_are_refused(tmp_path: Path) -> None:
    folder = save_clip(tmp_path)
    (folder / "config.json").write_text('{"model_type": "clip", "vis')
    with pytest.raises(ConfigError, match="not the configuration"):
        opened("clip", folder)
    (folder / "config.json").write_text('{"model_type": "clip"}')
    (folder / "model.safetensors").unlink()
    with pytest.raises(ConfigError, match="no weights"):
        opened("clip", folder)


def test_weights_that_are_not_here_are_named_with_their_size_and_the_command(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_CACHE", str(tmp_path))
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_OFFLINE", True)
    with pytest.raises(ConfigError) as refusal:
        open_backend("siglip2", BackendOptions("large", "cpu"))
    name = "google/siglip2-large-patch16-384"
    assert all(word in str(refusal.value) for word in (name, "3.5 GB", f"hf download {name}"))


def test_a_device_that_is_not_there_is_refused(folders: dict[str, Path]) -> None:
    with pytest.raises(ConfigError, match="device 'abacus'"):
        open_backend("clip", BackendOptions(str(folders["clip"]), "abacus"))


def test_texts_are_encoded_once_a_machine(
    folders: dict[str, Path], balls: list[ObjectView], cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = asked(opened("clip", folders["clip"]), balls)
    (file,) = cache.glob("*.safetensors")
    backend = opened("clip", folders["clip"])
    monkeypatch.setattr(backend._text, "_encode", None)  # type: ignore[attr-defined]
    for a, b in zip(expected, asked(backend, balls), strict=True):
        assert np.array_equal(a.maps, b.maps)
    whole = file.read_bytes()
    for damage in (b"", whole[:100], b"x" * 300):
        file.write_bytes(damage)
        asked(opened("clip", folders["clip"]), balls)
        assert file.read_bytes() == whole
