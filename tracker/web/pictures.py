"""The pictures of the page as JPEG: a frame with its overlay, and a concept's map over the object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
import numpy.typing as npt

from tracker.errors import OutputError
from tracker.overlay import Picture, Shape, draw_overlay
from tracker.saliency import Saliency
from tracker.view import Float32s, ObjectView
from tracker.web.board import Shown

QUALITY = 80
LEAST_PX = 160  # of a map's longer side


def overlay_picture(shown: Shown, shapes: Mapping[str, Shape]) -> bytes:
    """shapes: what is drawn of every object, by its id."""
    return as_jpeg(draw_overlay(shown.frame, shown.results, shapes, shown.truth))


def strongest(view: ObjectView, saliency: Saliency) -> Sequence[tuple[str, float]]:
    """Every label with the mean of its map over the object's own pixels, in [0, 1], the highest first."""
    means = _at(view, saliency).mean(axis=0)
    order = np.argsort(-means, kind="stable")
    return [(saliency.labels[k], float(means[k])) for k in order]


def concept_picture(view: ObjectView, saliency: Saliency, label: str) -> bytes:
    """The object, gray, under the map of one of the labels, from dark blue (0) to yellow (1).

    Raises OutputError where the saliency is not of this label.
    """
    if label not in saliency.labels:
        raise OutputError(f"concept {label!r} was not asked for; there are {', '.join(saliency.labels)}")
    height, width = view.frame.depth_m.shape
    box = view.box
    part = np.s_[max(box.y0, 0) : min(box.y1, height), max(box.x0, 0) : min(box.x1, width)]
    rows, columns = np.mgrid[part]
    one = Saliency((label,), saliency.maps[[saliency.labels.index(label)]], box)
    levels = one.sample(columns.ravel(), rows.ravel()).reshape(rows.shape)
    gray = cv2.cvtColor(np.ascontiguousarray(view.frame.rgb[part]), cv2.COLOR_RGB2GRAY)[:, :, None]
    heat = _heat(levels)
    inside = view.mask[part][:, :, None]
    picture = np.where(inside, 0.15 * gray + 0.85 * heat, 0.5 * gray + 64).astype(np.uint8)
    scale = max(1, round(LEAST_PX / max(picture.shape[:2])))
    return as_jpeg(picture.repeat(scale, axis=0).repeat(scale, axis=1))


def as_jpeg(picture: Picture) -> bytes:
    """Of an RGB picture."""
    bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    written, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not written:
        raise OutputError("this OpenCV cannot write JPEG pictures")
    return data.tobytes()


def _heat(levels: Float32s) -> npt.NDArray[np.uint8]:
    """Viridis: even for colour-blind readers."""
    whole = np.rint(np.clip(levels, 0, 1) * 255).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(whole, cv2.COLORMAP_VIRIDIS)[:, :, ::-1], np.uint8)


def _at(view: ObjectView, saliency: Saliency) -> Float32s:
    """(N, L) values at the object's pixels of the frame."""
    rows, columns = np.nonzero(view.mask)
    return saliency.sample(columns, rows)
