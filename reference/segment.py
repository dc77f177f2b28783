"""One picture and a click, a box or nothing -> the pixels of the thing that is meant. By depth alone.

What it stands on, and a wall behind it, are planes that have it on the camera's side; a thing's own flat faces have
not, as no part of a box reaches out of its faces. Without those planes, pixels hang together where depth goes on
without a jump.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from reference.keyframes import LEAST_VISIBLE_PX
from tracker.errors import OnboardingError
from tracker.frame import Frame, Mask
from tracker.geometry import Floats
from tracker.pointing import REACH_PX, Click, Pointer, clicked_m, measured_in
from tracker.view import Box, bounding_box

JUMP_M, JUMP_SHARE = 0.01, 0.01  # between neighbouring pixels, of the depth: where it is more, one thing ends
NEARBY_M = 0.4  # around what is pointed at: planes that matter are seen there
TRIED, SAMPLED, NEAR_PLANE_M = 400, 3000, 0.008  # RANSAC: planes, points to compare by, what is on one
LEAST_THICK_M, MOST_THICK_M = 0.004, 0.012  # of what is taken away with a plane: three sigma of its points, within this
MOST_PLANES, LEAST_PLANE_SHARE = 5, 0.08  # the table, walls, faces of the thing; of the points that are looked at
LEAST_ABOVE = 0.2  # of the points in a box that have to be before a plane which is behind the thing
GAP_PX, GAP_JUMP = 5, 2.0  # without depth, and how much larger a jump may be there, so that a surface goes on behind: the rim of a mug is seen as such
RIM_PX = 2.5  # pixels without depth along an edge that are the nearest surface's
STANDS_WITHIN_M = 0.03  # of the plane: the lowest that is seen of a thing on it
PLAUSIBLE_M = (0.02, 0.5)  # size of a thing that somebody means without saying so
MOST_OF_PICTURE = 0.5
MOSTLY, WHOLLY = 0.5, 0.95  # of the main component has to be in the box, and of a further piece

Labels = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class _Plane:
    """normal (3,) points to the camera's side; thick_m is what counts as on it."""

    normal: Floats
    offset_m: float
    thick_m: float

    def height_m(self, points: Floats) -> Floats:
        """(N,) of points (N, 3), above 0 on the camera's side."""
        return points @ self.normal + self.offset_m


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
    planes = _planes_behind(points, meant, np.random.default_rng(seed))
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
        mask &= _inside(there, mask.shape)
    if mask.mean() > MOST_OF_PICTURE:
        raise OnboardingError(
            f"{where}: what is there fills {mask.mean():.0%} of the picture and hangs together with all around it; "
            "expected a thing that stands apart. Move it away from what it touches, or give a box"
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


def _planes_behind(points: Floats, meant: Floats | None, rng: np.random.Generator) -> list[_Plane]:
    """Of the largest planes around what is meant those that have it on the camera's side, the largest first. Where
    nothing is meant, the largest of all."""
    if meant is not None:
        points = points[np.linalg.norm(points - np.median(meant, axis=0), axis=1) < NEARBY_M]
    planes, least, left = [], max(LEAST_PLANE_SHARE * len(points), 3), points
    for _ in range(1 if meant is None else MOST_PLANES):
        plane = _largest_plane(left, rng) if len(left) >= least else None
        if plane is None:
            break
        on = np.abs(plane.height_m(left)) < max(plane.thick_m, NEAR_PLANE_M)
        if on.sum() < least:
            break
        if planes and plane.thick_m == MOST_THICK_M:  # a slab through several things
            pass
        elif meant is None or (plane.height_m(meant) > plane.thick_m).mean() >= LEAST_ABOVE:
            planes.append(plane)
        left = left[~on]
    return planes


def _largest_plane(points: Floats, rng: np.random.Generator) -> _Plane | None:
    """By RANSAC, then fitted to its points (of N, 3). None where all points are on a line."""
    corners = points[rng.integers(len(points), size=(TRIED, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    usable = lengths > 1e-9
    if not usable.any():
        return None
    normals = normals[usable] / lengths[usable, None]
    offsets = -np.einsum("ij,ij->i", normals, corners[usable, 0])
    compared = points[rng.integers(len(points), size=SAMPLED)]
    best = int(np.argmax((np.abs(compared @ normals.T + offsets) < NEAR_PLANE_M).sum(axis=0)))
    plane = _Plane(normals[best], float(offsets[best]), NEAR_PLANE_M)
    for _ in range(2):
        near = points[np.abs(plane.height_m(points)) < NEAR_PLANE_M]
        centre = near.mean(axis=0)
        normal = np.linalg.eigh(np.cov((near - centre).T))[1][:, 0]
        normal = normal if normal @ centre < 0 else -normal  # the camera is the origin
        sigma_m = 1.4826 * float(np.median(np.abs((near - centre) @ normal)))
        plane = _Plane(normal, -float(normal @ centre), float(np.clip(3 * sigma_m, LEAST_THICK_M, MOST_THICK_M)))
    return plane


def _connected(kept: Mask, depth_m: npt.NDArray[np.float32]) -> Labels:
    """(H, W) the component of every kept pixel from 1 on, 0 elsewhere."""
    numbers, measured = np.arange(kept.size).reshape(kept.shape), depth_m > 0
    ends: list[tuple[npt.NDArray[Any], npt.NDArray[Any]]] = []
    for axis in (0, 1):
        across = [np.swapaxes(picture, 0, axis) for picture in (numbers, kept, depth_m, measured)]
        number, keep, depth, known = across
        nothing = np.ones_like(keep)  # between a pixel and the one so many further
        for gap in range(1, GAP_PX + 2):
            if gap > 1:
                nothing = nothing[:-1] & ~known[gap - 1 : -1]
            else:
                nothing = nothing[:-1]
            jump_m = np.maximum(JUMP_M, JUMP_SHARE * depth[:-gap]) * (GAP_JUMP if gap > 1 else 1)
            joined = nothing & keep[:-gap] & keep[gap:] & (np.abs(depth[:-gap] - depth[gap:]) < jump_m)
            ends.append((number[:-gap][joined], number[gap:][joined]))
    one, other = (np.concatenate(side) for side in zip(*ends, strict=True))
    graph = coo_array((np.ones(len(one), bool), (one, other)), shape=(kept.size, kept.size))
    labels = connected_components(graph, directed=False)[1].reshape(kept.shape)
    return np.where(kept, labels + 1, 0).astype(np.int32)


def _clicked(labels: Labels, click: Click, where: str) -> int:
    """The component that a click hits: what most of the pixels around it are."""
    inside = _inside(Box(click.column - REACH_PX, click.row - REACH_PX, click.column + 5, click.row + 5), labels.shape)
    found, counts = np.unique(labels[inside & (labels > 0)], return_counts=True)
    if not len(found):
        raise OnboardingError(
            f"{where}: pixel {click.column},{click.row} shows what things stand on, or nothing; expected a pixel on the "
            "thing itself"
        )
    return int(found[np.argmax(counts)])


def _boxed(labels: Labels, box: Box, frame: Frame, where: str) -> Mask:
    """The component with most pixels in a box, of those that are mostly in it, and those beside it at its depth: what
    is thin falls into pieces."""
    inside = _inside(box, labels.shape)
    within, whole = (np.bincount(part, minlength=int(labels.max()) + 1) for part in (labels[inside], labels.ravel()))
    mostly = within >= MOSTLY * np.maximum(whole, 1)
    mostly[0] = False
    if not mostly.any() or not within[mostly].any():
        raise OnboardingError(
            f"{where}: nothing stands apart in the box {','.join(map(str, box))}; expected a box around one thing, all "
            "of it"
        )
    mostly &= within > 0
    main = labels == int(np.argmax(np.where(mostly, within, 0)))
    box_of_main = bounding_box(main)
    depths_m = frame.depth_m[main]
    width_px = max(box_of_main.x1 - box_of_main.x0, box_of_main.y1 - box_of_main.y0) if box_of_main else 0
    size_m = width_px * float(np.median(depths_m)) / frame.intrinsics.fx
    near = np.abs(frame.depth_m - np.median(depths_m)) < size_m
    wholly = (within > 0) & (within >= WHOLLY * whole)
    return main & inside | (mostly & wholly)[labels] & near & inside


def _nearest(labels: Labels, frame: Frame, planes: list[_Plane], where: str) -> int:
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
    of_mask = np.zeros(int(nearest.max()) + 1, bool)
    of_mask[nearest[mask & measured]] = True
    return mask | (of_mask[nearest] & (away_px <= RIM_PX))


def _inside(box: Box, shape: tuple[int, ...]) -> Mask:
    inside = np.zeros(shape, bool)
    inside[max(box.y0, 0) : max(box.y1, 0), max(box.x0, 0) : max(box.x1, 0)] = True
    return inside
