"""SigLIP 2 (Tschannen et al., 2025): GradCAM at the vision tower's last layer norm, as in the paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from transformers import AutoTokenizer, SiglipModel

from tracker.saliency import BackendOptions
from tracker.saliency.checkpoint import Published, find_checkpoint
from tracker.saliency.device import precision, torch_device
from tracker.saliency.gradcam import GradCam
from tracker.saliency.vision_language import VisionLanguage

SIZES = {
    "giant": Published("google/siglip2-giant-opt-patch16-384", 7.5),
    "large": Published("google/siglip2-large-patch16-384", 3.5),
    "base": Published("google/siglip2-base-patch16-384", 1.5),
}


class SiglipEncoder:
    """Fixed-resolution SigLIP 2 checkpoints, which are of the architecture "siglip"."""

    prompt = "{}."
    mean = std = (0.5, 0.5, 0.5)

    def __init__(self, options: BackendOptions) -> None:
        checkpoint = find_checkpoint(options.weights, SIZES, "giant", ["siglip"])
        self.identity = checkpoint.identity
        self._device = torch_device(options.device)
        self._dtype = precision(self._device)
        network: Any = SiglipModel.from_pretrained(
            checkpoint.folder, local_files_only=True, use_safetensors=True, dtype=self._dtype
        )
        self._network = network.to(self._device).eval()
        self._tokenizer: Any = AutoTokenizer.from_pretrained(checkpoint.folder, local_files_only=True)
        self.size_px = int(self._network.config.vision_config.image_size)
        self.most_tokens = int(self._network.config.text_config.max_position_embeddings)

    def count_tokens(self, text: str) -> int:
        return len(self._tokenizer(text)["input_ids"])

    @torch.no_grad()
    def encode_texts(self, texts: Sequence[str]) -> torch.Tensor:
        # SigLIP was trained with texts filled up to their greatest length, and without a mask over the filling
        tokens = self._tokenizer(
            list(texts), padding="max_length", max_length=self.most_tokens, truncation=True, return_tensors="pt"
        )
        return self._network.text_model(input_ids=tokens["input_ids"].to(self._device)).pooler_output

    def maps(self, pixels: torch.Tensor, texts: torch.Tensor) -> torch.Tensor:
        vision = self._network.vision_model
        pixels, texts = pixels.to(self._device, self._dtype), texts.to(self._device, self._dtype)
        texts = torch.nn.functional.normalize(texts, dim=2)

        def similarity() -> torch.Tensor:
            picture = torch.nn.functional.normalize(vision(pixel_values=pixels).pooler_output, dim=1)
            return (texts @ picture.unsqueeze(2)).squeeze(2)

        with GradCam(vision, vision.post_layernorm) as gradcam:
            return gradcam(similarity, square)


def square(tokens: torch.Tensor) -> torch.Tensor:
    """(B, h * h, C) -> (B, h, h, C), row by row."""
    side = round(tokens.shape[1] ** 0.5)
    return tokens.reshape(len(tokens), side, side, tokens.shape[2])


def open_siglip2(options: BackendOptions) -> VisionLanguage:
    return VisionLanguage("siglip2", SiglipEncoder(options))
