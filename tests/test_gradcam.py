"""GradCAM in one pass: the maps of the straightforward way, and nothing left behind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from tests.tiny_networks import SAVE, save_siglip
from tracker.saliency import BackendOptions
from tracker.saliency.clip import ClipEncoder
from tracker.saliency.dinotxt import DinotxtEncoder
from tracker.saliency.gradcam import GradCam, stretched
from tracker.saliency.siglip2 import SiglipEncoder, square

LABELS = ("handle", "rim", "lid", "label", "red spout", "body")
OPTIONS = {"device": "cpu"}
ENCODERS: dict[str, Any] = {"siglip2": SiglipEncoder, "clip": ClipEncoder, "dinotxt": DinotxtEncoder}


def pictures(count: int) -> torch.Tensor:
    return torch.rand((count, 3, 64, 64), generator=torch.Generator().manual_seed(3)) * 2 - 1


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return {name: save(tmp_path_factory.mktemp(name)) for name, save in SAVE.items()}


@pytest.fixture(autouse=True)
def fp32(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Full precision, so that two ways of the same sum agree; and no cache but the test's own."""
    for module in ("siglip2", "clip", "dinotxt"):
        monkeypatch.setattr(f"tracker.saliency.{module}.precision", lambda device: torch.float32)  # noqa: ARG005
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def one_by_one(network: Any, layer: torch.nn.Module, score: Any, count: int, to_grid: Any) -> torch.Tensor:
    """The usual way: for every concept a pass with the whole graph, gradients caught by hooks."""
    maps = []
    for k in range(count):
        kept: dict[str, torch.Tensor] = {}

        def forward(module: Any, given: Any, output: torch.Tensor, kept: dict[str, torch.Tensor] = kept) -> None:  # noqa: ARG001
            kept["activation"] = output
            output.register_hook(lambda g, kept=kept: kept.update(gradient=g))

        hook = layer.register_forward_hook(forward)
        score()[:, k].sum().backward()
        hook.remove()
        network.zero_grad()
        activation, gradient = to_grid(kept["activation"].detach()), to_grid(kept["gradient"])
        weights = gradient.mean(dim=(1, 2), keepdim=True)
        maps.append(torch.relu((weights * activation).sum(dim=3)))
    return stretched(torch.stack(maps, dim=1))


def assert_same_maps(found: torch.Tensor, expected: torch.Tensor) -> None:
    assert found.shape == expected.shape == (2, len(LABELS), 4, 4)
    for a, b in zip(found.reshape(-1, 16).numpy(), expected.reshape(-1, 16).numpy(), strict=True):
        if b.max() > 0:
            assert np.corrcoef(a, b)[0, 1] >= 0.99999
            assert a.argmax() == b.argmax()
        else:
            assert a.max() == 0
    assert (expected.amax(dim=(2, 3)) > 0).sum() > len(LABELS)  # most maps have something in them


def texts_of(encoder: Any) -> torch.Tensor:
    return encoder.encode_texts([encoder.prompt.format(label) for label in LABELS]).expand(2, -1, -1)


def test_siglip_maps_are_those_of_a_backward_pass_a_concept(folders: dict[str, Path]) -> None:
    encoder = SiglipEncoder(BackendOptions(str(folders["siglip2"]), "cpu"))
    texts, vision = texts_of(encoder), encoder.network.vision_model

    def score() -> torch.Tensor:
        picture = torch.nn.functional.normalize(vision(pixel_values=pictures(2)).pooler_output, dim=1)
        return torch.einsum("bld,bd->bl", torch.nn.functional.normalize(texts, dim=2), picture)

    expected = one_by_one(vision, vision.post_layernorm, score, len(LABELS), square)
    assert_same_maps(encoder.maps(pictures(2), texts), expected)


def test_clip_maps_are_those_of_a_backward_pass_a_concept(folders: dict[str, Path]) -> None:
    encoder = ClipEncoder(BackendOptions(str(folders["clip"]), "cpu"))
    texts, network = texts_of(encoder), encoder._network

    def score() -> torch.Tensor:
        picture = network.visual_projection(network.vision_model(pixel_values=pictures(2)).pooler_output)
        normal = torch.nn.functional.normalize
        return torch.einsum("bld,bd->bl", normal(texts, dim=2), normal(picture, dim=1))

    layer = network.vision_model.encoder.layers[-1].layer_norm1
    expected = one_by_one(network, layer, score, len(LABELS), lambda tokens: square(tokens[:, 1:]))
    assert_same_maps(encoder.maps(pictures(2), texts), expected)


@pytest.mark.parametrize("name", ENCODERS)
def test_maps_of_half_precision_as_on_a_gpu_are_those_of_full_precision(
    name: str, folders: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    options = BackendOptions(str(folders[name]), "cpu")
    full = ENCODERS[name](options)
    monkeypatch.setattr(f"tracker.saliency.{name}.precision", lambda device: torch.float16)  # noqa: ARG005
    half = ENCODERS[name](options)
    expected, found = (encoder.maps(pictures(2), texts_of(encoder).float()).float() for encoder in (full, half))
    assert found.shape == expected.shape
    assert torch.allclose(found, expected, atol=0.02)
    assert (expected.amax(dim=(2, 3)) == 1).any()  # there is something in them


def test_dinotxt_maps_are_cosines_with_the_second_half_of_a_text(folders: dict[str, Path]) -> None:
    encoder = DinotxtEncoder(BackendOptions(str(folders["dinotxt"]), "cpu"))
    texts = texts_of(encoder)
    with torch.no_grad():
        tokens = encoder._head(encoder._backbone(pixel_values=pictures(2)).last_hidden_state)
    patches, half = tokens[:, -16:].numpy(), texts[:, :, 64:].numpy()
    patches = patches / np.linalg.norm(patches, axis=2, keepdims=True)
    half = half / np.linalg.norm(half, axis=2, keepdims=True)
    cosines = np.einsum("btc,blc->blt", patches, half).reshape(2, len(LABELS), 4, 4)
    assert_same_maps(encoder.maps(pictures(2), texts), stretched(torch.from_numpy(cosines)))


def state_of(network: torch.nn.Module) -> tuple[int, list[bool]]:
    hooks = sum(len(m._forward_hooks) + len(m._forward_pre_hooks) + len(m._backward_hooks) for m in network.modules())
    return hooks, [parameter.requires_grad for parameter in network.parameters()]


class Net(torch.nn.Module):
    """Three places of two channels; one parameter is frozen from the start."""

    def __init__(self) -> None:
        super().__init__()
        self.body, self.layer, self.head = torch.nn.Linear(4, 2), torch.nn.Identity(), torch.nn.Linear(2, 3)
        self.head.bias.requires_grad_(False)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.head(self.layer(self.body(x))).mean(dim=1)


def as_picture(tokens: torch.Tensor) -> torch.Tensor:
    return tokens.unsqueeze(1)


def test_nothing_is_left_on_the_network() -> None:
    net, x = Net(), torch.rand(2, 3, 4)
    before = state_of(net)
    with GradCam(net, net.layer) as gradcam:
        assert state_of(net) == (2, [False] * 4)
        assert gradcam(lambda: net(x), as_picture).shape == (2, 3, 1, 3)
    assert state_of(net) == before == (0, [True, True, True, False])
    assert all(parameter.grad is None for parameter in net.parameters())


@pytest.mark.parametrize("inside", [True, False])
def test_nothing_is_left_when_the_body_raises(inside: bool) -> None:
    net = Net()
    before = state_of(net)

    def broken() -> torch.Tensor:
        net(torch.rand(1, 3, 4))
        raise ValueError("of the body")

    def body() -> None:
        with GradCam(net, net.layer) as gradcam:
            if not inside:
                broken()
            gradcam(broken, as_picture)

    with pytest.raises(ValueError, match="of the body"):
        body()
    assert state_of(net) == before
    assert torch.backends.cuda.flash_sdp_enabled()  # the choice of attention kernels is as it was


def test_a_layer_that_does_not_run_is_an_error() -> None:
    net = Net()
    with GradCam(net, torch.nn.Identity()) as gradcam, pytest.raises(RuntimeError, match="did not run"):
        gradcam(lambda: net(torch.rand(1, 3, 4)), as_picture)


def test_the_graph_begins_at_the_layer(tmp_path: Path) -> None:
    """What lies before it keeps nothing for a backward pass."""
    encoder = SiglipEncoder(BackendOptions(str(save_siglip(tmp_path)), "cpu"))
    vision, seen = encoder.network.vision_model, []
    hook = vision.encoder.register_forward_hook(lambda m, i, o: seen.append(o.last_hidden_state.requires_grad))  # noqa: ARG005
    encoder.maps(pictures(2), texts_of(encoder))
    hook.remove()
    assert seen == [False]
