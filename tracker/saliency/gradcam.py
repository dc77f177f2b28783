"""GradCAM of many scores in one forward pass (Selvaraju et al., Grad-CAM, ICCV 2017), of any network.

    with GradCam(network, layer) as gradcam:
        maps = gradcam(lambda: scores(network(pixels)), to_grid)

Everything up to the layer runs without a graph: its output is made a leaf, so only what lies behind it is
differentiated, and the products of all L scores with its Jacobian are taken at once. Adapters keep this file free of
any model: `explained` runs the network and returns the scores, `to_grid` brings the layer's tokens into a picture.
Where the mean gradient of what lies right behind the layer is known in closed form, the graph may begin after that.

pytorch-grad-cam, which the paper uses, resizes a map to the picture before it normalises it, one score at a time; here
a map is normalised at the layer's own resolution and resized by whoever samples it. Interpolation is linear, so the
two differ by a scale and an offset only.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from types import TracebackType

import torch
from torch.nn.attention import SDPBackend, sdpa_kernel

# Gradients of a cosine, spread over hundreds of places, vanish in half precision; maps do not depend on their scale.
HALF_PRECISION_SCALE = 1024.0

Explained = Callable[[], torch.Tensor]
Output = torch.Tensor | tuple[torch.Tensor, ...]
ToGrid = Callable[[torch.Tensor], torch.Tensor]


@dataclass(frozen=True, slots=True, eq=False)
class Shortcut:
    """Where the graph begins instead of at the layer. behind: a module that runs after it. mean_gradient: gradients
    (L, B, ...) of the scores at that module's output -> (L, B, C) their mean over the places of the layer."""

    behind: torch.nn.Module
    mean_gradient: Callable[[torch.Tensor], torch.Tensor]


class GradCam:
    """A network that is being looked into. Within the `with` its parameters are frozen and its layer has a hook;
    afterwards they are as they were, whatever happened in between."""

    def __init__(self, network: torch.nn.Module, layer: torch.nn.Module, shortcut: Shortcut | None = None) -> None:
        self._network, self._layer, self._shortcut = network, layer, shortcut
        self._stack, self._formula = ExitStack(), ExitStack()
        self._tokens: torch.Tensor | None = None
        self._leaf: torch.Tensor | None = None

    def __enter__(self) -> GradCam:
        for parameter in self._network.parameters():
            if parameter.requires_grad:
                self._stack.callback(parameter.requires_grad_, True)
                parameter.requires_grad_(False)
        behind = self._layer if self._shortcut is None else self._shortcut.behind
        for module, hook in ((self._layer, self._keep), (behind, self._cut)):
            self._stack.callback(module.register_forward_hook(hook).remove)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._tokens = self._leaf = None
        self._stack.close()

    def __call__(self, explained: Explained, to_grid: ToGrid) -> torch.Tensor:
        """(B, L, h, w) maps in [0, 1].

        explained: runs the network once and returns the (B, L) scores, each picture's from its own output alone.
        to_grid: the layer's (B, T, C) output -> (B, h, w, C), tokens without a place left out.
        Channel weights are the mean gradient over the places, a map is the positive part of the weighted sum of the
        channels, stretched to [0, 1]. Raises RuntimeError where the layer did not take part.
        """
        with torch.enable_grad(), ExitStack() as formula:
            self._tokens = self._leaf = None
            self._formula = formula
            scores = explained()
            if self._tokens is None or self._leaf is None:
                raise RuntimeError("the layer that is to be explained did not run")
            one_each = HALF_PRECISION_SCALE * torch.eye(scores.shape[1], dtype=scores.dtype, device=scores.device)
            # pictures do not meet in the network, so the sum over them keeps their gradients apart
            (gradients,) = torch.autograd.grad(scores.sum(dim=0), self._leaf, one_each, is_grads_batched=True)
        with torch.no_grad():
            if self._shortcut is not None:
                weights = self._shortcut.mean_gradient(gradients)
            else:
                weights = torch.stack([to_grid(gradient).mean(dim=(1, 2)) for gradient in gradients])
            places = to_grid(self._tokens).float()
            return stretched(torch.einsum("lbc,bhwc->blhw", weights.float(), places).clamp_min(0))

    def _keep(self, layer: torch.nn.Module, given: object, output: torch.Tensor) -> None:  # noqa: ARG002
        self._tokens = output.detach()

    def _cut(self, module: torch.nn.Module, given: object, output: Output) -> Output:  # noqa: ARG002
        """The module's output, or the first of its outputs, as the leaf at which the graph begins."""
        first = output if isinstance(output, torch.Tensor) else output[0]
        self._leaf = first.detach().requires_grad_()
        # From here on attention is computed by its formula: the fused kernels have no batched derivative.
        self._formula.enter_context(sdpa_kernel(SDPBackend.MATH))
        return self._leaf if isinstance(output, torch.Tensor) else (self._leaf, *output[1:])


def stretched(maps: torch.Tensor) -> torch.Tensor:
    """Every map of (B, L, h, w) stretched to [0, 1]; one that is the same everywhere says nothing: 0."""
    low, high = maps.amin(dim=(2, 3), keepdim=True), maps.amax(dim=(2, 3), keepdim=True)
    return torch.where(high > low, (maps - low) / (high - low).clamp_min(torch.finfo(maps.dtype).tiny), 0.0)


def square(tokens: torch.Tensor) -> torch.Tensor:
    """(B, h * h, C) -> (B, h, h, C), row by row."""
    side = round(tokens.shape[1] ** 0.5)
    return tokens.reshape(len(tokens), side, side, tokens.shape[2])
