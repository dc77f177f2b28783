"""Whether what is seen goes on beyond a surface: a thing ends there, a patch of a table or a wall does not."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from tracker.frame import Mask
from tracker.view import Float32s, ObjectView

GAP_PX = 4  # of a view of the usual resolution: the points of a surface are nowhere farther apart
INNER_PX, OUTER_PX = 1, 4  # the ring around it
SAME_LAB = 12.0  # a colour that differs by less is the same in another light


def goes_on(rows: npt.NDArray, columns: npt.NDArray, lab: Float32s, view: ObjectView, finer: float) -> float:
    """In [0, 1]: of a ring around these pixels (N,) of the view, the share that is inside, so at about their depth, and
    in the colour of the nearest of them.

    lab: (h, w, 3) of the view. finer: how many pixels of it are one of a view of the usual resolution.
    """
    surface = np.zeros(view.inside.shape, np.uint8)
    surface[rows, columns] = 1
    surface = cv2.morphologyEx(surface, cv2.MORPH_CLOSE, _disc(GAP_PX / 2 * finer))
    ring = (cv2.dilate(surface, _disc(OUTER_PX * finer)) > 0) & (cv2.dilate(surface, _disc(INNER_PX * finer)) == 0)
    known = cv2.erode(surface, _disc(1)) > 0  # its border mixes colours
    if not ring.any() or not known.any():
        return 0.0
    beyond = np.nonzero(ring & view.has_depth)
    nearest = _nearest(known)[beyond]
    apart = np.linalg.norm(lab[beyond] - lab.reshape(-1, 3)[nearest], axis=1)
    return float(np.count_nonzero(apart < SAME_LAB) / np.count_nonzero(ring))


def _nearest(of: Mask) -> npt.NDArray[np.intp]:
    """(h, w) for every pixel the flat index of the nearest one that is set."""
    elsewhere = np.where(of, 0, 1).astype(np.uint8)
    found = cv2.distanceTransformWithLabels(elsewhere, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    labels, flat = np.asarray(found[1], np.intp), np.flatnonzero(of)
    index = np.zeros(int(labels.max()) + 1, np.intp)
    index[labels.reshape(-1)[flat]] = flat
    return index[labels]


def _disc(radius_px: float) -> npt.NDArray:
    across = 2 * round(radius_px) + 1
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (across, across))
