"""SigLIP 2 (Tschannen et al., 2025): GradCAM at the vision tower's last layer norm, as in the paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from transformers import AutoTokenizer, SiglipModel

from tracker.saliency import BackendOptions
from tracker.saliency.checkpoint import Published, find_checkpoint
from tracker.saliency.device import precision, torch_device
from tracker.saliency.gradcam import GradCam, Shortcut, square
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
        self.identity, self.weights = checkpoint.identity, checkpoint.called
        self._device = torch_device(options.device)
        self._dtype = precision(self._device)
        network: Any = SiglipModel.from_pretrained(
            checkpoint.folder, local_files_only=True, use_safetensors=True, dtype=self._dtype
        )
        self.network = network.to(self._device).eval()
        self._tokenizer: Any = AutoTokenizer.from_pretrained(checkpoint.folder, local_files_only=True)
        self.size_px = int(self.network.config.vision_config.image_size)
        self._places = (self.size_px // int(self.network.config.vision_config.patch_size)) ** 2
        self.most_tokens = int(self.network.config.text_config.max_position_embeddings)

    def count_tokens(self, text: str) -> int:
        return len(self._tokenizer(text)["input_ids"])

    @torch.no_grad()
    def encode_texts(self, texts: Sequence[str]) -> torch.Tensor:
        # SigLIP was trained with texts filled up to their greatest length, and without a mask over the filling
        tokens = self._tokenizer(
            list(texts), padding="max_length", max_length=self.most_tokens, truncation=True, return_tensors="pt"
        )
        return self.network.text_model(input_ids=tokens["input_ids"].to(self._device)).pooler_output

    def maps(self, pixels: torch.Tensor, texts: torch.Tensor) -> torch.Tensor:
        vision = self.network.vision_model
        pixels, texts = pixels.to(self._device, self._dtype), texts.to(self._device, self._dtype)
        texts = torch.nn.functional.normalize(texts, dim=2)

        def similarity() -> torch.Tensor:
            picture = torch.nn.functional.normalize(vision(pixel_values=pixels).pooler_output, dim=1)
            return (texts @ picture.unsqueeze(2)).squeeze(2)

        pooling = vision.head.attention
        shortcut = Shortcut(pooling, lambda gradients: _before_pooling(gradients, pooling, self._places))
        with GradCam(vision, vision.post_layernorm, shortcut) as gradcam:
            return gradcam(similarity, square)


def _before_pooling(gradients: torch.Tensor, pooling: torch.nn.MultiheadAttention, places: int) -> torch.Tensor:
    """Gradients (L, B, 1, C) behind attention pooling -> (L, B, C) their mean over the tokens before it, exactly.

    Pooling is sum_t a_t V x_t with a = softmax(q K x). The gradient by x_t has a part through V, a_t V^T g, which sums
    to V^T g as the a_t sum to one, and a part through a, which sums to nothing as the a_t can only grow at one
    another's expense. So of the tokens' gradients, the dearest part of GradCAM here, none is needed.
    """
    value = pooling.in_proj_weight[2 * pooling.embed_dim :].float()
    return gradients[:, :, 0].float() @ pooling.out_proj.weight.float() @ value / places


def open_siglip2(options: BackendOptions) -> VisionLanguage:
    return VisionLanguage("siglip2", SiglipEncoder(options))
