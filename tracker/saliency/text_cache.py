"""Embeddings of texts, kept in memory and on disk: a text is encoded once a machine."""

from __future__ import annotations

import hashlib
import json
import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import safetensors
import safetensors.torch
import torch

logger = logging.getLogger(__name__)

Encode = Callable[[Sequence[str]], torch.Tensor]


class TextCache:
    """Embeddings by one text encoder. identity: of its weights. folder: None for ~/.cache/conceptrack/text (under
    XDG_CACHE_HOME where that is set)."""

    def __init__(self, identity: str, encode: Encode, folder: Path | None = None) -> None:
        self._identity, self._encode = identity, encode
        self._folder = folder or cache_folder()
        self._known: dict[tuple[str, ...], torch.Tensor] = {}

    def __call__(self, texts: Sequence[str]) -> torch.Tensor:
        """(L, D) float32 on the CPU, a row a text."""
        key = tuple(texts)
        if key not in self._known:
            path = self._folder / f"{self._name(key)}.safetensors"
            embeddings = _read(path, len(key))
            if embeddings is None:
                embeddings = self._encode(key).float().cpu().contiguous()
                _write(path, embeddings)
            self._known[key] = embeddings
        return self._known[key]

    def _name(self, texts: tuple[str, ...]) -> str:
        return hashlib.sha256(json.dumps([self._identity, *texts]).encode()).hexdigest()[:32]


def cache_folder() -> Path:
    given = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (given if given.is_absolute() else Path.home() / ".cache") / "conceptrack" / "text"


def _read(path: Path, count: int) -> torch.Tensor | None:
    """None where there is nothing, or nothing whole."""
    try:
        embeddings = safetensors.torch.load_file(path)["embeddings"]
    except (OSError, KeyError, safetensors.SafetensorError):
        return None
    whole = embeddings.ndim == 2 and len(embeddings) == count and bool(torch.isfinite(embeddings).all())
    return embeddings if whole else None


def _write(path: Path, embeddings: torch.Tensor) -> None:
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        safetensors.torch.save_file({"embeddings": embeddings}, partial)
        os.replace(partial, path)
    except (OSError, safetensors.SafetensorError) as error:  # they are only encoded again next time
        logger.warning("%s: embeddings of texts cannot be kept (%s)", path, error)
        partial.unlink(missing_ok=True)
