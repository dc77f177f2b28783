"""CLIP (Radford et al., ICML 2021): GradCAM at the first layer norm of the last block, its class token left out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from transformers import AutoTokenizer, CLIPModel

from tracker.saliency import BackendOptions
from tracker.saliency.checkpoint import Published, find_checkpoint
from tracker.saliency.device import precision, torch_device
from tracker.saliency.gradcam import GradCam, square
from tracker.saliency.vision_language import VisionLanguage

SIZES = {
    "large": Published("openai/clip-vit-large-patch14-336", 1.7),
    "base": Published("openai/clip-vit-base-patch16", 0.6),
}


class ClipEncoder:
    """Checkpoints of the architecture "clip"."""

    prompt = "{}."
    mean = (0.48145466, 0.4578275, 0.40821073)
    std = (0.26862954, 0.26130258, 0.27577711)

    def __init__(self, options: BackendOptions) -> None:
        checkpoint = find_checkpoint(options.weights, SIZES, "large", ["clip"])
        self.identity, self.weights = checkpoint.identity, checkpoint.called
        self._device = torch_device(options.device)
        self._dtype = precision(self._device)
        network: Any = CLIPModel.from_pretrained(
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
        tokens = self._tokenizer(list(texts), padding=True, return_tensors="pt").to(self._device)
        pooled = self._network.text_model(**tokens).pooler_output
        return self._network.text_projection(pooled)

    def maps(self, pixels: torch.Tensor, texts: torch.Tensor) -> torch.Tensor:
        network, vision = self._network, self._network.vision_model
        pixels, texts = pixels.to(self._device, self._dtype), texts.to(self._device, self._dtype)
        texts = torch.nn.functional.normalize(texts, dim=2)

        def similarity() -> torch.Tensor:
            picture = network.visual_projection(vision(pixel_values=pixels).pooler_output)
            return (texts @ torch.nn.functional.normalize(picture, dim=1).unsqueeze(2)).squeeze(2)

        with GradCam(network, vision.encoder.layers[-1].layer_norm1) as gradcam:
            return gradcam(similarity, lambda tokens: square(tokens[:, 1:]))


def open_clip(options: BackendOptions) -> VisionLanguage:
    return VisionLanguage("clip", ClipEncoder(options))
