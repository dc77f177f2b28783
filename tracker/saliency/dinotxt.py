"""DINOv3 (Simeoni et al., 2025) with the dino.txt head (Jose et al., CVPR 2025): patches against texts, no gradient.

A text's embedding has two halves: the first is that of a picture's class token, the second that of its patches. A map
is the cosine between the second half and every patch, stretched to [0, 1].

The head is not in transformers, so its weights have to be brought into this layout (the published ones were not at hand
when this was written; the layout is tested with random weights):

    FOLDER/config.json       {"model_type": "dinotxt", "image_size": 512}
    FOLDER/backbone/         a DINOv3ViTModel
    FOLDER/head.safetensors  blocks.K.* of torch.nn.TransformerEncoderLayer (norm_first, GELU; layer scales folded into
                             self_attn.out_proj and linear2) for the two blocks over the backbone's tokens; norm.*
    FOLDER/text/             a CLIPTextModelWithProjection (GELU, projection to twice the backbone's width), and CLIP's
                             tokenizer
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import safetensors
import safetensors.torch
import torch
from transformers import AutoTokenizer, CLIPTextModelWithProjection, DINOv3ViTModel

from tracker.errors import ConfigError
from tracker.saliency import BackendOptions
from tracker.saliency.checkpoint import find_checkpoint
from tracker.saliency.device import precision, torch_device
from tracker.saliency.gradcam import square, stretched
from tracker.saliency.vision_language import VisionLanguage

HEAD_WIDTH = 64  # channels an attention head, as in all of DINOv3's backbones


class Head(torch.nn.Module):
    """Transformer blocks and a norm over all tokens of the backbone, (B, T, C) -> (B, T, C)."""

    def __init__(self, width: int, blocks: int) -> None:
        super().__init__()
        heads = max(1, width // HEAD_WIDTH)
        self.blocks = torch.nn.ModuleList(
            torch.nn.TransformerEncoderLayer(
                width, heads, 4 * width, dropout=0.0, activation="gelu", batch_first=True, norm_first=True
            )
            for _ in range(blocks)
        )
        self.norm = torch.nn.LayerNorm(width)

    def forward(self, tokens: torch.Tensor) -> torch.Tensor:
        for block in self.blocks:
            tokens = block(tokens)
        return self.norm(tokens)


class DinotxtEncoder:
    """Weights in the layout above."""

    prompt = "{}"
    mean, std = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)

    def __init__(self, options: BackendOptions) -> None:
        if options.weights is None:
            raise ConfigError("backend dinotxt has no weights that can be fetched: give a folder with --weights")
        checkpoint = find_checkpoint(options.weights, {}, "", ["dinotxt"])
        folder = checkpoint.folder
        self.identity, self.weights = checkpoint.identity, checkpoint.called
        self.size_px = int(checkpoint.config.get("image_size", 512))
        self._device = torch_device(options.device)
        self._dtype = precision(self._device)
        loading: dict[str, Any] = {"local_files_only": True, "use_safetensors": True, "dtype": self._dtype}
        text: Any = CLIPTextModelWithProjection.from_pretrained(folder / "text", **loading)
        backbone: Any = DINOv3ViTModel.from_pretrained(folder / "backbone", **loading)
        self._text, self._backbone = text.to(self._device).eval(), backbone.to(self._device).eval()
        self._head = _head(folder / "head.safetensors", self._backbone.config.hidden_size)
        self._head.to(self._device, self._dtype).eval()
        self._tokenizer: Any = AutoTokenizer.from_pretrained(folder / "text", local_files_only=True)
        self.most_tokens = int(self._text.config.max_position_embeddings)

    def count_tokens(self, text: str) -> int:
        return len(self._tokenizer(text)["input_ids"])

    @torch.no_grad()
    def encode_texts(self, texts: Sequence[str]) -> torch.Tensor:
        tokens = self._tokenizer(list(texts), padding=True, return_tensors="pt").to(self._device)
        return self._text(**tokens).text_embeds

    @torch.no_grad()
    def maps(self, pixels: torch.Tensor, texts: torch.Tensor) -> torch.Tensor:
        tokens = self._backbone(pixel_values=pixels.to(self._device, self._dtype)).last_hidden_state
        patches = self._head(tokens)[:, 1 + self._backbone.config.num_register_tokens :]
        of_patches = texts[..., texts.shape[2] // 2 :].to(self._device, self._dtype)
        patches, of_patches = (torch.nn.functional.normalize(v, dim=2) for v in (patches, of_patches))
        return stretched((square(patches) @ of_patches.transpose(1, 2).unsqueeze(1)).permute(0, 3, 1, 2).float())


def _head(path: Path, width: int) -> Head:
    try:
        weights = safetensors.torch.load_file(path)
        head = Head(width, 1 + max(int(name.split(".")[1]) for name in weights if name.startswith("blocks.")))
        head.load_state_dict(weights)
    except (OSError, ValueError, RuntimeError, safetensors.SafetensorError) as error:
        raise ConfigError(f"{path}: not the weights of a dino.txt head of width {width} ({error})") from error
    return head


def open_dinotxt(options: BackendOptions) -> VisionLanguage:
    return VisionLanguage("dinotxt", DinotxtEncoder(options))
