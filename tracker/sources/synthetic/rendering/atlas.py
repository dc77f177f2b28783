"""A texture at several scales, looked up smoothly at the one at which it is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from tracker.geometry import Floats
from tracker.sources.synthetic.things.texture import SCALES, Texture

LOOKUP_WIDTH = 1024  # cv2.remap refuses lines longer than 32767


@dataclass(frozen=True, slots=True, eq=False)
class Atlas:
    """The scales from full to coarse (Williams, Pyramidal parametrics, SIGGRAPH 1983)."""

    levels: Sequence[Texture]

    @classmethod
    def of(cls, texture: Texture) -> Atlas:
        levels = [texture]
        for _ in range(SCALES - 1):
            size = (levels[-1].shape[1] // 2, levels[-1].shape[0] // 2)
            levels.append(cv2.resize(levels[-1], size, interpolation=cv2.INTER_AREA).astype(np.uint8))
        return cls(levels)

    def lookup(self, uv: Floats, texels_per_pixel: Floats) -> Texture:
        """Colours (N, 4) at (N, 2) places in [0, 1], from the nearest scale."""
        level = np.log2(np.maximum(texels_per_pixel, 1)).round()
        colours = np.zeros((len(uv), 4), np.uint8)
        for number, texture in enumerate(self.levels):
            seen = np.flatnonzero(level == number if number < SCALES - 1 else level >= number)
            if len(seen):
                colours[seen] = _bilinear(texture, uv[seen])
        return colours


def _bilinear(texture: Texture, uv: Floats) -> Texture:
    rows = -(-len(uv) // LOOKUP_WIDTH)
    places = np.zeros((rows * LOOKUP_WIDTH, 2), np.float32)
    size_px = np.array([texture.shape[1], texture.shape[0]], np.float32)
    places[: len(uv)] = uv * size_px - np.float32(0.5)  # pixel centres have whole coordinates
    grid = places.reshape(rows, LOOKUP_WIDTH, 2)
    found = cv2.remap(texture, grid[..., 0], grid[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found, np.uint8).reshape(-1, 4)[: len(uv)]
