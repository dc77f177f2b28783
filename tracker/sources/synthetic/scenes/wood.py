"""Procedural wood."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from tracker.sources.synthetic.things.drawing import Picture, Rgb

OAK, WALNUT, PINE = (178, 132, 86), (116, 78, 52), (206, 170, 122)


def waves(shape: tuple[int, int], cells: tuple[int, int], rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """Smooth noise (H, W) of about unit size with that many bumps down and across."""
    coarse = rng.normal(0, 1, (cells[0] + 1, cells[1] + 1)).astype(np.float32)
    return cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC).astype(np.float32, copy=False)


def wood(
    length_mm: float, width_mm: float, colour: Rgb, planks: int, rng: np.random.Generator, scale: float
) -> Picture:
    """Planks that run along the picture's rows; `scale` is in pixels a millimetre."""
    width_px, height_px = round(length_mm * scale), round(width_mm * scale)
    picture = np.empty((height_px, width_px, 3), np.uint8)
    edges = np.linspace(0, height_px, planks + 1).astype(int)
    for top, bottom in pairwise(edges):
        shape = (bottom - top, width_px)
        across = np.linspace(0, rng.uniform(6, 12), shape[0], dtype=np.float32)[:, None] + np.float32(rng.uniform(0, 9))
        rings = np.sin(
            2 * np.float32(np.pi) * (across + 0.8 * waves(shape, (2, 3), rng) + 0.25 * waves(shape, (6, 14), rng))
        )
        fibres = waves(shape, (max(shape[0] // 2, 3), max(width_px // 90, 4)), rng)
        tone = 0.05 * rings * rings * rings + 0.04 * fibres + 0.05 * waves(shape, (1, 4), rng)
        tone += np.float32(1 + rng.normal(0, 0.06))
        for channel, (level, depth) in enumerate(zip(colour, (1.0, 1.15, 1.3), strict=True)):
            picture[top:bottom, :, channel] = np.clip(level * (1 + depth * (tone - 1)), 0, 255)
        picture[top : top + max(1, round(0.8 * scale))] //= 2
    return picture
