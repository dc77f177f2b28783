"""One picture and a click, a box or nothing -> the pixels of the thing that is meant. By depth alone.

What it stands on, and a wall behind it, are planes that have it on the camera's side; a thing's own flat faces have
not, as no part of a box reaches out of its faces. Without those planes, pixels hang together where depth goes on
without a jump.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from reference.keyframes import LEAST_VISIBLE_PX
from reference.planes import Plane, planes_behind
from tracker.errors import OnboardingError
from tracker.frame import Frame, Mask
from tracker.geometry import Floats
from tracker.pointing import Click, Pointer, around, clicked_m, inside, measured_in
from tracker.view import Box, bounding_box

JUMP_M, JUMP_SHARE = 0.01, 0.01  # between neighbouring pixels, of the depth: where it is more, one thing ends
GAP_PX, GAP_JUMP = 5, 2.0  # a surface goes on behind so many pixels without depth, with a larger jump: a mug's rim
RIM_PX = 2.5  # pixels without depth along an edge that are the nearest surface's
STANDS_WITHIN_M = 0.03  # of the plane: the lowest that is seen of a thing on it
PLAUSIBLE_M = (0.02, 0.6)  # size of a thing
MOST_OF_PICTURE = 0.5
MOSTLY, WHOLLY = 0.5, 0.95  # of the main component has to be in the box, and of a further piece

Labels = npt.NDArray[np.int32]


def segment(frame: Frame, there: Pointer | None = None, seed: int = 42) -> Mask:
    """(H, W) bool, the pixels of one thing: what a click hits, what fills a box best, or, where nothing is said, the
    nearest thing that stands on the largest plane and is wholly in the picture. Depth decides; pixels without it are
    the thing's along its rim only. seed: of the search for planes; the same picture gives the same mask.

    Raises OnboardingError where there is no such thing, or what is found is half the picture.
    """
    where = f"frame {frame.index} of {frame.provenance.source}"
    rows, columns = np.nonzero(frame.depth_m > 0)
    if len(rows) < LEAST_VISIBLE_PX:
        raise OnboardingError(f"{where}: {len(rows)} pixels have depth, no thing can be told from its surroundings")
    points = frame.intrinsics.unproject(columns, rows, frame.depth_m[rows, columns].astype(np.float64))
    meant = _meant(frame, there, where)
    planes = planes_behind(points, meant, np.random.default_rng(seed))
    standing = np.ones(len(points), bool)
    for plane in planes:
        standing &= plane.height_m(points) > plane.thick_m
    kept = np.zeros(frame.depth_m.shape, bool)
    kept[rows[standing], columns[standing]] = True
    labels = _connected(kept, frame.depth_m)
    if isinstance(there, Click):
        mask = labels == _clicked(labels, there, where)
    elif there is not None:
        mask = _boxed(labels, there, frame, where)
    else:
        mask = labels == _nearest(labels, frame, planes, where)
    mask = _with_rim(mask, frame.depth_m)
    if isinstance(there, Box):
        mask &= inside(there, mask.shape)
    if mask.mean() > MOST_OF_PICTURE:
        raise OnboardingError(
            f"{where}: what is there fills {mask.mean():.0%} of the picture and hangs together with all around it; "
            "expected a thing that stands apart. Move it away from what it touches, or give a box"
        )
    size_m = _size_m(mask, frame)
    if size_m > PLAUSIBLE_M[1]:
        raise OnboardingError(
            f"{where}: what is there is {size_m:.1f} m wide and not one thing; expected something of up to "
            f"{PLAUSIBLE_M[1]:g} m that stands apart. Point at the thing itself, or give a box"
        )
    if mask.sum() < LEAST_VISIBLE_PX:
        raise OnboardingError(
            f"{where}: what is there has {mask.sum()} pixels, {LEAST_VISIBLE_PX} are needed: move it closer to the "
            "camera, or point at another place on it"
        )
    return mask


def _meant(frame: Frame, there: Pointer | None, where: str) -> Floats | None:
    """(M, 3) points of what is pointed at, metres, camera coordinates; None where nothing is."""
    if there is None:
        return None
    if isinstance(there, Click):
        point = clicked_m(there, frame)
        if point is None:
            raise OnboardingError(f"{where}: there is no depth at pixel {there.column},{there.row}")
        return point[None]
    rows, columns = np.nonzero(measured_in(there, frame))
    if not len(rows):
        raise OnboardingError(f"{where}: there is no depth in the box {','.join(map(str, there))}")
    return frame.intrinsics.unproject(columns, rows, frame.depth_m[rows, columns].astype(np.float64))


def _connected(kept: Mask, depth_m: npt.NDArray[np.float32]) -> Labels:
    """(H, W) the component of every kept pixel from 1 on, 0 elsewhere."""
    numbers, measured = np.arange(kept.size).reshape(kept.shape), depth_m > 0
    ends: list[tuple[npt.NDArray[Any], npt.NDArray[Any]]] = []
    for axis in (0, 1):
        number, keep = np.swapaxes(numbers, 0, axis), np.swapaxes(kept, 0, axis)
        depth, known = np.swapaxes(depth_m, 0, axis), np.swapaxes(measured, 0, axis)
        nothing = np.ones_like(keep)  # between a pixel and the one so many further
        for gap in range(1, GAP_PX + 2):
            nothing = nothing[:-1] & ~known[gap - 1 : -1] if gap > 1 else nothing[:-1]
            jump_m = np.maximum(JUMP_M, JUMP_SHARE * depth[:-gap]) * (GAP_JUMP if gap > 1 else 1)
            joined = nothing & keep[:-gap] & keep[gap:] & (np.abs(depth[:-gap] - depth[gap:]) < jump_m)
            ends.append((number[:-gap][joined], number[gap:][joined]))
    one, other = (np.concatenate(side) for side in zip(*ends, strict=True))
    graph = coo_array((np.ones(len(one), bool), (one, other)), shape=(kept.size, kept.size))
    labels = connected_components(graph, directed=False)[1].reshape(kept.shape)
    return np.where(kept, labels + 1, 0).astype(np.int32)


def _clicked(labels: Labels, click: Click, where: str) -> int:
    """The component that a click hits: what most of the pixels around it are."""
    found, counts = np.unique(labels[inside(around(click), labels.shape) & (labels > 0)], return_counts=True)
    if not len(found):
        raise OnboardingError(
            f"{where}: pixel {click.column},{click.row} shows what things stand on, or nothing; expected a pixel "
            "on the thing itself"
        )
    return int(found[np.argmax(counts)])


def _boxed(labels: Labels, box: Box, frame: Frame, where: str) -> Mask:
    """The component with most pixels in a box, of those that are mostly in it, and those beside it at its depth: what
    is thin falls into pieces."""
    in_box = inside(box, labels.shape)
    within, whole = (np.bincount(part, minlength=int(labels.max()) + 1) for part in (labels[in_box], labels.ravel()))
    mostly = within >= MOSTLY * np.maximum(whole, 1)
    mostly[0] = False
    if not mostly.any() or not within[mostly].any():
        raise OnboardingError(
            f"{where}: nothing stands apart in the box {','.join(map(str, box))}; expected a box around one thing, all "
            "of it"
        )
    mostly &= within > 0
    main = labels == int(np.argmax(np.where(mostly, within, 0)))
    near = np.abs(frame.depth_m - np.median(frame.depth_m[main])) < _size_m(main, frame)
    wholly = (within > 0) & (within >= WHOLLY * whole)
    return main & in_box | (mostly & wholly)[labels] & near & in_box


def _size_m(mask: Mask, frame: Frame) -> float:
    """The longer side of its box at its median depth, metres; 0 of nothing."""
    box, depths_m = bounding_box(mask), frame.depth_m[mask & (frame.depth_m > 0)]
    if box is None or not len(depths_m):
        return 0.0
    return max(box.x1 - box.x0, box.y1 - box.y0) * float(np.median(depths_m)) / frame.intrinsics.fx


def _nearest(labels: Labels, frame: Frame, planes: list[Plane], where: str) -> int:
    """The component nearest to the camera of those that stand on the plane, are wholly seen and of a plausible size."""
    if not planes:
        raise OnboardingError(f"{where}: there is no plane that things stand on; point at the thing, or put it on one")
    sizes, found = np.bincount(labels.ravel()), []
    for label in np.flatnonzero(sizes >= LEAST_VISIBLE_PX):
        box = bounding_box(labels == label) if label else None
        if box is None or box.x0 < 2 or box.y0 < 2 or box.x1 > labels.shape[1] - 2 or box.y1 > labels.shape[0] - 2:
            continue
        rows, columns = np.nonzero(labels == label)
        points = frame.intrinsics.unproject(columns, rows, frame.depth_m[rows, columns].astype(np.float64))
        size_m = float(np.linalg.norm(np.ptp(points, axis=0)))
        stands = float(np.percentile(planes[0].height_m(points), 2)) < STANDS_WITHIN_M
        if stands and PLAUSIBLE_M[0] < size_m < PLAUSIBLE_M[1]:
            found.append((float(np.median(np.linalg.norm(points, axis=1))), int(label)))
    if not found:
        raise OnboardingError(
            f"{where}: nothing stands on the plane that is seen, wholly in the picture, apart from other things and "
            f"with {LEAST_VISIBLE_PX} pixels or more; put one thing before the camera, or point at it"
        )
    return min(found)[1]


def _with_rim(mask: Mask, depth_m: npt.NDArray[np.float32]) -> Mask:
    """Also the pixels without depth that are nearest to it: cameras measure nothing along edges."""
    measured = depth_m > 0
    away_px, nearest = cv2.distanceTransformWithLabels(
        (~measured).astype(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.asarray(nearest, np.intp)
    of_mask = np.zeros(int(nearest.max()) + 1, bool)
    of_mask[nearest[mask & measured]] = True
    return mask | (of_mask[nearest] & (away_px <= RIM_PX))
