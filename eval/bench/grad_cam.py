"""pytorch-grad-cam on the same network, where it is installed (extra bench) beside a torchvision that fits torch."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import torch

from tracker.saliency.siglip2 import square


class _Pooled(torch.nn.Module):
    """The vision tower as a function from pixels to a unit embedding, which is what pytorch-grad-cam explains."""

    def __init__(self, vision: Any) -> None:
        super().__init__()
        self.vision = vision

    def forward(self, pixels: torch.Tensor) -> torch.Tensor:
        return torch.nn.functional.normalize(self.vision(pixel_values=pixels).pooler_output, dim=1)


def grad_cam_loop(vision: Any, pixels: torch.Tensor, texts: torch.Tensor) -> Callable[[], None] | None:
    """A call of pytorch-grad-cam for each of the texts (L, D), None where the package cannot be imported."""
    try:
        grad_cam = import_module("pytorch_grad_cam").GradCAM
    except (ImportError, RuntimeError):  # a torchvision that does not fit raises either
        return None

    def loop() -> None:
        layers = [vision.post_layernorm]
        with grad_cam(
            _Pooled(vision), layers, reshape_transform=lambda tokens: square(tokens).permute(0, 3, 1, 2)
        ) as explain:
            for text in torch.nn.functional.normalize(texts, dim=1).to(pixels):
                explain(pixels, [lambda embedding, text=text: (embedding * text).sum()])

    return loop
