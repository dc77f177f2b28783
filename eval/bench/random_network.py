"""A vision-language network of a real architecture with random weights: its maps mean nothing, its speed does."""

from __future__ import annotations

import json
from pathlib import Path

import torch
from tokenizers import Tokenizer, models, pre_tokenizers
from transformers import PreTrainedTokenizerFast, SiglipConfig, SiglipModel

from tracker.saliency.checkpoint import RANDOM

VISION = {
    "hidden_size": 768, "intermediate_size": 3072, "num_hidden_layers": 12, "num_attention_heads": 12,
    "image_size": 384, "patch_size": 16,
}  # fmt: skip
# Embeddings of texts are cached, so the text tower's size changes nothing that is measured.
TEXT = {
    "hidden_size": 768, "intermediate_size": 256, "num_hidden_layers": 1, "num_attention_heads": 12,
    "vocab_size": 256, "max_position_embeddings": 64,
}  # fmt: skip


def save_random_siglip(folder: Path, seed: int = 0) -> None:
    """SigLIP base-patch16-384 as `siglip2` loads it, marked as random, with a tokenizer of single letters."""
    torch.manual_seed(seed)
    network = SiglipModel(SiglipConfig(text_config=TEXT, vision_config=VISION))
    network.save_pretrained(folder)
    config = folder / "config.json"
    config.write_text(json.dumps({**json.loads(config.read_text()), RANDOM: True}, indent=1))
    letters = {chr(code): code for code in range(32, 127)}
    tokenizer = Tokenizer(models.WordLevel({"<pad>": 0, "<unk>": 1, **letters}, unk_token="<unk>"))  # noqa: S106
    tokenizer.pre_tokenizer = pre_tokenizers.Split("", "isolated")  # pyright: ignore[reportAttributeAccessIssue]
    special = {"pad_token": "<pad>", "unk_token": "<unk>"}
    PreTrainedTokenizerFast(tokenizer_object=tokenizer, model_max_length=64, **special).save_pretrained(folder)
