"""`python -m eval bench saliency`: what all concepts cost, against one forward pass and against one pass a concept."""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from eval.bench.measurement import Measurement


@dataclass
class SaliencyBench(Measurement):
    """Measure a SigLIP backbone: the whole saliency, one bare forward pass, and the usual loop over concepts."""

    weights: str | None = None
    """As for --backend siglip2. Default: base-patch16-384 with random weights, made for the occasion."""
    labels: int = 20
    """How many concepts."""
    repeat: int = 5
    """Repetitions of the quick ones, interleaved; medians are told."""
    loop_concepts: int = 3
    """How many concepts of the loop are run; its time is scaled to all of them."""
    device: str = "auto"
    """Where the network runs."""
    keep_weights: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Keep the random weights in this folder."""

    def title(self) -> str:
        return f"saliency of {self.labels} concepts"

    def measured(self) -> dict[str, Any]:
        from eval.bench.random_network import save_random_siglip

        if self.weights is not None:
            return self._measured(self.weights)
        temporary = tempfile.TemporaryDirectory() if self.keep_weights is None else nullcontext(self.keep_weights)
        with temporary as folder:
            if not (Path(folder) / "config.json").exists():
                save_random_siglip(Path(folder))
            return self._measured(str(folder))

    def _measured(self, weights: str) -> dict[str, Any]:
        import numpy as np
        import torch

        from eval.bench.grad_cam import grad_cam_loop
        from tracker.saliency import BackendOptions
        from tracker.saliency.siglip2 import SiglipEncoder
        from tracker.saliency.vision_language import GENERAL_LABELS

        encoder = SiglipEncoder(BackendOptions(weights, self.device))
        network = encoder.network
        words = [f"{GENERAL_LABELS[k % 20]} {k // 20}" if k >= 20 else GENERAL_LABELS[k] for k in range(self.labels)]
        texts = encoder.encode_texts([encoder.prompt.format(word) for word in words])
        rng = np.random.default_rng(0)
        pixels = torch.from_numpy(rng.normal(size=(1, 3, encoder.size_px, encoder.size_px)).astype(np.float32))
        device, dtype = network.device, network.dtype
        given = pixels.to(device, dtype)

        def forward() -> None:
            with torch.no_grad():
                network.vision_model(pixel_values=given)

        def ours() -> None:
            encoder.maps(pixels, texts[None])

        def loop() -> None:
            for text in torch.nn.functional.normalize(texts, dim=1)[: self.loop_concepts]:
                picture = network.vision_model(pixel_values=given).pooler_output
                (torch.nn.functional.normalize(picture, dim=1)[0] @ text.to(dtype)).backward()
                network.zero_grad()

        for parameter in network.parameters():
            parameter.requires_grad_(True)  # as loaded
        forward_s, ours_s = self._interleaved(forward, ours)
        run = max(min(self.loop_concepts, self.labels), 1)
        loop_s = _seconds(loop) * self.labels / run
        grad_cam = grad_cam_loop(network.vision_model, given, texts[:run])
        grad_cam_s = _seconds(grad_cam) * self.labels / run if grad_cam else None
        return {
            "ratio_to_forward": ours_s / forward_s,
            "speedup_over_loop": loop_s / ours_s,
            "speedup_over_grad_cam": grad_cam_s / ours_s if grad_cam_s else None,
            "forward_ms": forward_s * 1e3,
            "ours_ms": ours_s * 1e3,
            "loop_ms": loop_s * 1e3,
            "loop_concepts_run": self.loop_concepts,
            "parameters_mb": sum(p.numel() * p.element_size() for p in network.parameters()) / 2**20,
            "precision": str(dtype),
            "device": str(device),
            "threads": torch.get_num_threads(),
            "weights": encoder.weights,
        }

    def _interleaved(self, *ways: Callable[[], None]) -> list[float]:
        """Median seconds of each way."""
        for way in ways:
            way()
        spent = [[_seconds(way) for way in ways] for _ in range(self.repeat)]
        return [statistics.median(of_way) for of_way in zip(*spent, strict=True)]


def _seconds(way: Callable[[], None]) -> float:
    start = time.perf_counter()
    way()
    return time.perf_counter() - start
