"""A picture of what the concepts saw: for every reference view its crop and a tile a concept, with the scale."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from reference.sheet import Picture, write_png
from tracker.concept import ConceptModel
from tracker.frame import PosedFrame
from tracker.saliency import Query, SaliencyBackend
from tracker.view import Float32s, ViewConfig, bounding_box, view_object

TILE_PX, LABEL_PX, GAP_PX = 150, 20, 6
SCALE_PX = GAP_PX + 2 * LABEL_PX  # the height of what tells which colour is which value
PAPER, INK = (255, 255, 255), (30, 30, 30)
LONGEST_LABEL = 22  # characters that fit under a tile
MOST_COLUMNS = 10


def write_concept_plate(path: Path, model: ConceptModel, backend: SaliencyBackend) -> None:
    """Write a PNG of the model's reference views and the scale. Raises OutputError where it cannot be written."""
    plates = [_plate(view, model, backend) for view in model.references]
    plates += [_scale()] if plates else []
    width = max((plate.shape[1] for plate in plates), default=1)
    plates = [np.pad(p, ((0, 0), (0, width - p.shape[1]), (0, 0)), constant_values=255) for p in plates]
    whole = np.concatenate(plates) if plates else np.full((1, 1, 3), 255, np.uint8)
    write_png(path, whole)


def _plate(frame: PosedFrame, model: ConceptModel, backend: SaliencyBackend) -> Picture:
    view = view_object(frame.frame, frame.mask, model.diameter_m, ViewConfig())
    box = bounding_box(frame.mask)
    if view is None or box is None:
        return np.full((1, 1, 3), 255, np.uint8)
    (saliency,) = backend([Query(view, model.labels)])
    crop = frame.frame.rgb[box.y0 : box.y1, box.x0 : box.x1]
    maps = saliency.full(*frame.frame.depth_m.shape)[:, box.y0 : box.y1, box.x0 : box.x1]
    tiles = [_tile(crop, f"view {frame.frame.index}")]
    tiles += [_tile(_heated(crop, one), label) for one, label in zip(maps, model.labels, strict=True)]
    columns = min(MOST_COLUMNS, len(tiles))
    blank = np.full_like(tiles[0], 255)
    tiles += [blank] * (-len(tiles) % columns)
    return np.concatenate([np.concatenate(tiles[k : k + columns], axis=1) for k in range(0, len(tiles), columns)])


def _heated(crop: Picture, saliency: Float32s) -> Picture:
    """The crop in faint gray, under the map from dark to bright; in every tile bright is the same value, 1."""
    gray = cv2.cvtColor(crop, cv2.COLOR_RGB2GRAY)[:, :, None]
    levels = np.rint(np.clip(saliency, 0, 1) * 255).astype(np.uint8)
    heat = cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS)[:, :, ::-1]  # even for colour-blind readers
    return (0.3 * gray + 0.7 * heat).astype(np.uint8)


def _scale() -> Picture:
    """Which colour is which value, over the same gray as a tile's, in the middle of what that may be."""
    tile = np.full((SCALE_PX, TILE_PX, 3), 255, np.uint8)
    tile[GAP_PX : GAP_PX + LABEL_PX] = _heated(
        np.full((LABEL_PX, TILE_PX, 3), 128, np.uint8),
        np.tile(np.linspace(0, 1, TILE_PX, dtype=np.float32), (LABEL_PX, 1)),
    )
    for value, left in (("0", 2), ("0.5", TILE_PX // 2 - 10), ("1", TILE_PX - 10)):
        cv2.putText(tile, value, (left, GAP_PX + LABEL_PX + 14), cv2.FONT_HERSHEY_SIMPLEX, 0.38, INK, 1, cv2.LINE_AA)
    return tile


def _tile(picture: Picture, label: str) -> Picture:
    scale = TILE_PX / max(picture.shape[:2])
    size = (max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale)))
    shrunk = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    tile = np.full((TILE_PX + LABEL_PX + GAP_PX, TILE_PX + GAP_PX, 3), 255, np.uint8)
    top, left = (TILE_PX - size[1]) // 2, (TILE_PX - size[0]) // 2
    tile[top : top + size[1], left : left + size[0]] = shrunk
    text = label if len(label) <= LONGEST_LABEL else label[: LONGEST_LABEL - 2] + ".."
    ascii_only = text.encode("ascii", "replace").decode()  # the built-in font has no other letters
    cv2.putText(tile, ascii_only, (2, TILE_PX + 14), cv2.FONT_HERSHEY_SIMPLEX, 0.38, INK, 1, cv2.LINE_AA)
    return tile
