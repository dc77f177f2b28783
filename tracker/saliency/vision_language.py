"""What all vision-language backends do alike: crop, resize, ask one batch for all concepts, bring the maps back."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Sequence
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt
import torch

from tracker.errors import ConfigError
from tracker.saliency import Query, Saliency, fingerprint_of, require_labels
from tracker.saliency.text_cache import TextCache
from tracker.view import Box, Float32s, bounding_box

GENERAL_LABELS = (
    "handle", "rim", "lid", "label", "spout", "base", "body", "logo", "printed text", "barcode", "button",
    "screen", "seam", "hole", "corner", "neck", "knob", "cord", "metal part", "rubber grip",
)  # fmt: skip
CROPS_KEPT = 64


class Encoder(Protocol):
    """A vision-language network.

    identity: of its weights. weights: what they are called. size_px: side of the square picture that it takes.
    prompt: of a label, with "{}". mean, std: (3,) of the channels in [0, 1], by which pictures are normalised.
    most_tokens: that a text may have.
    """

    @property
    def identity(self) -> str: ...

    @property
    def weights(self) -> str: ...

    @property
    def size_px(self) -> int: ...

    @property
    def prompt(self) -> str: ...

    @property
    def mean(self) -> Sequence[float]: ...

    @property
    def std(self) -> Sequence[float]: ...

    @property
    def most_tokens(self) -> int: ...

    def count_tokens(self, text: str) -> int: ...

    def encode_texts(self, texts: Sequence[str]) -> torch.Tensor:
        """(L, D) embeddings, of any length."""
        ...

    def maps(self, pixels: torch.Tensor, texts: torch.Tensor) -> torch.Tensor:
        """(B, L, h, w) in [0, 1], where each text of texts (B, L, D) is in its own picture of pixels (B, 3, S, S)."""
        ...


class VisionLanguage:
    """A saliency backend on top of an encoder.

    A crop is the box of the object's mask, with what else is in it, stretched to the encoder's square: averaged where
    it shrinks, bicubic where it grows (the checkpoints' own processors take a bicubic or bilinear filter for both).
    """

    def __init__(self, name: str, encoder: Encoder) -> None:
        self.name, self.weights = name, encoder.weights
        self._encoder = encoder
        self.fingerprint = fingerprint_of(name, f"{encoder.identity} {encoder.prompt} {encoder.size_px}")
        self._text = TextCache(encoder.identity, encoder.encode_texts)
        self._crops: OrderedDict[str, Float32s] = OrderedDict()

    def labels_for(self, wanted: Sequence[str] | None) -> tuple[str, ...]:
        labels = require_labels(GENERAL_LABELS if wanted is None else wanted)
        for label in labels:
            tokens = self._encoder.count_tokens(self._prompted(label))
            if tokens > self._encoder.most_tokens:
                raise ConfigError(
                    f"concept {label[:60]!r} has {tokens} tokens, the text encoder of {self.name} takes "
                    f"{self._encoder.most_tokens} at most"
                )
        return labels

    def __call__(self, queries: Sequence[Query]) -> list[Saliency]:
        boxes = [bounding_box(query.view.mask) or Box(0, 0, 1, 1) for query in queries]
        pictures = [self._picture(query, box) for query, box in zip(queries, boxes, strict=True)]
        keys = [_key(picture, query.labels) for picture, query in zip(pictures, queries, strict=True)]
        new = {key: k for k, key in enumerate(keys) if key not in self._crops}
        if new:
            chosen = list(new.values())
            maps = self._maps([pictures[k] for k in chosen], [queries[k].labels for k in chosen])
            self._crops.update(zip(new, maps, strict=True))
        found = [self._crops[key] for key in keys]
        for key in keys:
            self._crops.move_to_end(key)
        while len(self._crops) > CROPS_KEPT:
            self._crops.popitem(last=False)
        return [Saliency(q.labels, maps, box) for q, maps, box in zip(queries, found, boxes, strict=True)]

    def _picture(self, query: Query, box: Box) -> npt.NDArray[np.uint8]:
        crop, size = query.view.frame.rgb[box.y0 : box.y1, box.x0 : box.x1], self._encoder.size_px
        shrinks = min(crop.shape[:2]) >= size
        filtered = cv2.resize(crop, (size, size), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)
        return np.asarray(filtered, np.uint8)

    def _maps(self, pictures: Sequence[npt.NDArray[np.uint8]], labels: Sequence[tuple[str, ...]]) -> list[Float32s]:
        """A (L, h, w) array a picture, each with its own labels."""
        pixels = torch.from_numpy(np.stack(pictures)).permute(0, 3, 1, 2).float() / 255
        mean, std = (torch.tensor(v).reshape(1, 3, 1, 1) for v in (self._encoder.mean, self._encoder.std))
        texts = [self._text([self._prompted(label) for label in of_one]) for of_one in labels]
        padded = torch.nn.utils.rnn.pad_sequence(texts, batch_first=True)
        maps = self._encoder.maps((pixels - mean) / std, padded).float().cpu().numpy()
        return [np.ascontiguousarray(one[: len(of_one)]) for one, of_one in zip(maps, labels, strict=True)]

    def _prompted(self, label: str) -> str:
        return self._encoder.prompt.format(label.replace("_", " ").lower())


def _key(picture: npt.NDArray[np.uint8], labels: tuple[str, ...]) -> str:
    return hashlib.sha256(picture.tobytes() + repr(labels).encode()).hexdigest()
