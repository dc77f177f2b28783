"""Textures, and several of them packed into one.

A texture is (H, W, 4) uint8: RGB as sRGB, then gloss (0 dull .. 255 bare metal).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from tracker.sources.synthetic.things.drawing import Picture

Texture = npt.NDArray[np.uint8]
Window = tuple[float, float, float, float]  # left, top, right, bottom in a texture, in [0, 1]
Name = TypeVar("Name", str, int)

MARGIN_PX = 16  # repeated border pixels: smaller scales and bilinear lookup must not see the neighbour
SCALES = 5  # at which a texture is looked up, each half of the one before; the margin is a pixel in the last


def glossy(picture: Picture, gloss: float) -> Texture:
    """A printed picture with the same gloss, in [0, 1], everywhere."""
    return np.dstack((picture, np.full(picture.shape[:2], round(gloss * 255), np.uint8)))


def plain(rgb: tuple[int, int, int], gloss: float) -> Texture:
    """One colour."""
    return glossy(np.full((8, 8, 3), rgb, np.uint8), gloss)


def pack(pictures: Mapping[Name, Texture]) -> tuple[Texture, dict[Name, Window]]:
    """All pictures in one, in rows by falling height, and the window of each in [0, 1]."""
    padded = {name: _framed(picture) for name, picture in pictures.items()}
    area = sum(p.shape[0] * p.shape[1] for p in padded.values())
    step = 2 ** (SCALES - 1)
    width = max(int(np.sqrt(area) * 1.1) // step * step, *(p.shape[1] for p in padded.values()))
    corners: dict[Name, tuple[int, int]] = {}
    x = y = row_height = 0
    for name in sorted(padded, key=lambda n: -padded[n].shape[0]):
        if x + padded[name].shape[1] > width:
            x, y, row_height = 0, y + row_height, 0
        corners[name] = (x, y)
        x, row_height = x + padded[name].shape[1], max(row_height, padded[name].shape[0])
    sheet = np.zeros((y + row_height, width, 4), np.uint8)
    windows: dict[Name, Window] = {}
    for name, (left, top) in corners.items():
        h, w = padded[name].shape[:2]
        sheet[top : top + h, left : left + w] = padded[name]
        inner_h, inner_w = pictures[name].shape[:2]
        left, top = left + MARGIN_PX, top + MARGIN_PX
        windows[name] = (left / width, top / len(sheet), (left + inner_w) / width, (top + inner_h) / len(sheet))
    return sheet, windows


def _framed(picture: Texture) -> Texture:
    """With the margin, and sizes that all scales divide."""
    step = 2 ** (SCALES - 1)
    right, bottom = (MARGIN_PX + -length % step for length in (picture.shape[1], picture.shape[0]))
    framed = cv2.copyMakeBorder(picture, MARGIN_PX, bottom, MARGIN_PX, right, cv2.BORDER_REPLICATE)
    return framed.astype(np.uint8)
