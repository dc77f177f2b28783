"""Networks of the real architectures, tiny and random, saved as their authors save theirs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from tokenizers import Tokenizer, models, pre_tokenizers, processors
from transformers import (
    CLIPConfig,
    CLIPModel,
    CLIPTextConfig,
    CLIPTextModelWithProjection,
    DINOv3ViTConfig,
    DINOv3ViTModel,
    PreTrainedTokenizerFast,
    SiglipConfig,
    SiglipModel,
)

from tracker.saliency.dinotxt import Head

WORDS = ("handle", "rim", "lid", "label", "spout", "body", "the", "of", "red", ".", *(f"word{k}" for k in range(60)))
PIXELS, PATCH, WIDTH = 64, 16, 64


def save_tokenizer(folder: Path, longest: int) -> None:
    """A tokenizer.json of whole words; the last token of a text is <e>, as CLIP's encoder expects it."""
    vocabulary = {word: k for k, word in enumerate(("<p>", "<u>", *WORDS, "<e>"))}
    tokenizer = Tokenizer(models.WordLevel(vocabulary, unk_token="<u>"))  # noqa: S106
    tokenizer.pre_tokenizer = pre_tokenizers.Sequence(  # pyright: ignore[reportAttributeAccessIssue]
        [pre_tokenizers.WhitespaceSplit(), pre_tokenizers.Punctuation()]
    )
    tokenizer.post_processor = processors.TemplateProcessing(  # pyright: ignore[reportAttributeAccessIssue]
        single="$A <e>", special_tokens=[("<e>", vocabulary["<e>"])]
    )
    special = {"pad_token": "<p>", "unk_token": "<u>", "eos_token": "<e>"}
    PreTrainedTokenizerFast(tokenizer_object=tokenizer, model_max_length=longest, **special).save_pretrained(folder)


def text_settings(longest: int) -> dict[str, Any]:
    return {
        "hidden_size": WIDTH, "intermediate_size": 128, "num_hidden_layers": 2, "num_attention_heads": 4,
        "vocab_size": len(WORDS) + 3, "max_position_embeddings": longest, "eos_token_id": len(WORDS) + 2,
        "bos_token_id": 0, "pad_token_id": 0,
    }  # fmt: skip


def vision_settings() -> dict[str, Any]:
    return {
        "hidden_size": WIDTH, "intermediate_size": 128, "num_hidden_layers": 3, "num_attention_heads": 4,
        "image_size": PIXELS, "patch_size": PATCH,
    }  # fmt: skip


def save_siglip(folder: Path, seed: int = 0) -> Path:
    torch.manual_seed(seed)
    network = SiglipModel(SiglipConfig(text_config=text_settings(16), vision_config=vision_settings()))
    return _saved(network, folder, seed, 16)


def save_clip(folder: Path, seed: int = 0) -> Path:
    torch.manual_seed(seed)
    settings = {"text_config": text_settings(12), "vision_config": vision_settings(), "projection_dim": 32}
    return _saved(CLIPModel(CLIPConfig(**settings)), folder, seed, 12)  # pyright: ignore[reportArgumentType]


def save_dinotxt(folder: Path, seed: int = 0) -> Path:
    torch.manual_seed(seed)
    backbone = DINOv3ViTModel(DINOv3ViTConfig(**vision_settings(), num_register_tokens=4))
    text = CLIPTextModelWithProjection(CLIPTextConfig(**text_settings(12), projection_dim=2 * WIDTH, hidden_act="gelu"))
    _saved(backbone, folder / "backbone", seed, None)
    _saved(text, folder / "text", seed, 12)
    safetensors.torch.save_file(Head(WIDTH, 2).state_dict(), folder / "head.safetensors")
    (folder / "config.json").write_text(json.dumps({"model_type": "dinotxt", "image_size": PIXELS}))
    return folder


def _saved(network: Any, folder: Path, seed: int, longest: int | None) -> Path:
    """With weights large enough for maps that have something in them."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in network.parameters():
            if parameter.ndim > 1:
                parameter.copy_(torch.randn(parameter.shape, generator=generator) * 0.15)
    network.save_pretrained(folder)
    if longest is not None:
        save_tokenizer(folder, longest)
    return folder


SAVE = {"siglip2": save_siglip, "clip": save_clip, "dinotxt": save_dinotxt}
