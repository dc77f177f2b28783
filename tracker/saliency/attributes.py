"""Concepts that can be grounded by measuring: basic colour terms, relative colours, and surface terms from depth.

A real backend that needs no weights. A colour term's map is how well the term names a pixel; its "nearby" and "around"
maps are the same smoothed over a small and a large part of the object, so that red next to white differs from red in
red. The relative terms compare a pixel with its surroundings and so hold when exposure or white balance wander.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from tracker.errors import ConfigError
from tracker.saliency import Query, Saliency, fingerprint_of, require_labels
from tracker.view import Float32s, ObjectView

# CIE L*a*b* (D65) of typical samples of the eleven basic colour terms of Berlin and Kay, Basic Color Terms, 1969.
COLOUR_TERMS: dict[str, tuple[float, float, float]] = {
    "black": (12, 0, 0),
    "white": (95, 0, 2),
    "grey": (55, 0, 0),
    "red": (42, 58, 38),
    "green": (50, -45, 30),
    "blue": (38, 8, -45),
    "yellow": (82, 2, 75),
    "brown": (38, 20, 28),
    "pink": (70, 38, 5),
    "purple": (38, 38, -35),
    "orange": (63, 42, 62),
}
LIGHTNESS_WEIGHT = 0.7  # lightness changes with the light more than hue does
COLOUR_SOFTNESS = 25.0  # Lab units over which one term gives way to the next
COLOUR_SCALES = {"": 0.0, " nearby": 0.05, " around": 0.12}  # standard deviation as a share of the object's diameter

RELATIVE_TERMS = ("lighter", "darker", "redder", "greener", "yellower", "bluer")  # than the surroundings: +-L, +-a, +-b
RELATIVE_SCALES = {" than nearby": (0.012, 0.06), " than around": (0.03, 0.15)}  # centre and surroundings
RELATIVE_FULL = 25.0  # Lab units of difference at which a relative term is fully true

SURFACE_TERMS = ("flat", "curved", "convex edge", "rim")
SURFACE_WEIGHT = 0.5  # depth is noisier than colour, so its terms say less
EDGE_SCALE, FORM_SCALE = 0.04, 0.10
BEND_FULL = (
    0.12  # loss of length of the mean normal at which a surface counts as fully bent (about 50 degrees of spread)
)


TERMS = (
    *(term + scale for scale in COLOUR_SCALES for term in COLOUR_TERMS),
    *(term + scale for scale in RELATIVE_SCALES for term in RELATIVE_TERMS),
    *SURFACE_TERMS,
)
LONGEST_FIRST = sorted(TERMS, key=len, reverse=True)  # "red nearby" is that, not "red" and something nearby


class Attributes:
    """The backend `attributes`. Works at the view's own resolution, a few milliseconds a view.

    A label may be one of its terms, or a phrase that has some of them in it: "red handle" is where it is red.
    """

    name, weights = "attributes", "none"
    fingerprint = fingerprint_of(
        "attributes",
        repr((COLOUR_TERMS, LIGHTNESS_WEIGHT, COLOUR_SOFTNESS, COLOUR_SCALES, RELATIVE_SCALES, RELATIVE_FULL))
        + repr((SURFACE_TERMS, SURFACE_WEIGHT, EDGE_SCALE, FORM_SCALE, BEND_FULL)),
    )

    def labels_for(self, wanted: Sequence[str] | None) -> tuple[str, ...]:
        if wanted is None:
            return TERMS
        for label in require_labels(wanted):
            if not terms_in(label):
                raise ConfigError(f"backend attributes cannot measure {label!r}; it knows {', '.join(TERMS)}")
        return tuple(wanted)

    def __call__(self, queries: Sequence[Query]) -> list[Saliency]:
        return [self._maps(query) for query in queries]

    def _maps(self, query: Query) -> Saliency:
        view, weights = query.view, query.view.inside.astype(np.float32)
        lab = smooth_inside(lab_of(view.rgb), weights, 0.7)  # pixel noise is not a concept
        measured = np.concatenate(
            (
                _colour_maps(lab, weights, view.pixels_across),
                _relative_maps(lab, weights, view.pixels_across),
                _surface_maps(view),
            ),
            axis=2,
        )
        maps = np.ascontiguousarray(np.moveaxis(measured * weights[:, :, None], 2, 0))
        if query.labels != TERMS:
            maps = np.stack([maps[[TERMS.index(t) for t in terms_in(label)]].prod(axis=0) for label in query.labels])
        return Saliency(query.labels, maps, view.box)


def terms_in(label: str) -> tuple[str, ...]:
    """The measurable terms of a phrase, each word of it in one of them at most."""
    text, found = f" {' '.join(label.casefold().split())} ", []
    for term in LONGEST_FIRST:
        if f" {term} " in text:
            found.append(term)
            text = text.replace(f" {term} ", " | ", 1)
    return tuple(found)


def lab_of(rgb: Float32s) -> Float32s:
    """(h, w, 3) float32 RGB in [0, 255] -> CIE L*a*b* (D65), L in [0, 100]."""
    return np.asarray(cv2.cvtColor(rgb / np.float32(255), cv2.COLOR_RGB2Lab), np.float32)


def smooth_inside(values: Float32s, weights: Float32s, sigma_px: float) -> Float32s:
    """Gaussian smoothing of (h, w, C) values in which only pixels with weight (h, w) take part."""
    sigma_px = min(sigma_px, 4 * max(weights.shape))  # flatter it cannot get; depth of nearly 0 asks for kilometres
    total = cv2.GaussianBlur(values * weights[:, :, None], (0, 0), sigma_px)
    share = cv2.GaussianBlur(weights, (0, 0), sigma_px)
    return np.asarray(total.reshape(values.shape) / np.maximum(share, 1e-3)[:, :, None], np.float32)


def _colour_maps(lab: Float32s, weights: Float32s, pixels_across: float) -> Float32s:
    """(h, w, scales * 11) soft assignment to the colour terms, which sum to one, at every scale."""
    foci = np.array(list(COLOUR_TERMS.values()), np.float32)
    metric = np.sqrt(np.array([LIGHTNESS_WEIGHT, 1, 1], np.float32))
    squared = (((lab[:, :, None, :] - foci) * metric) ** 2).sum(axis=3)
    closeness = np.exp((squared.min(axis=2, keepdims=True) - squared) / (2 * COLOUR_SOFTNESS**2))
    named = closeness / closeness.sum(axis=2, keepdims=True)
    scaled = (smooth_inside(named, weights, s * pixels_across) if s else named for s in COLOUR_SCALES.values())
    return np.concatenate(list(scaled), axis=2)


def _relative_maps(lab: Float32s, weights: Float32s, pixels_across: float) -> Float32s:
    """(h, w, scales * 6) difference of a pixel's Lab colour to that of its surroundings, each sign a map."""
    maps = []
    for centre, surroundings in RELATIVE_SCALES.values():
        near = smooth_inside(lab, weights, centre * pixels_across)
        difference = (near - smooth_inside(lab, weights, surroundings * pixels_across)) / RELATIVE_FULL
        signed = np.stack((difference, -difference), axis=3)  # (h, w, 3, 2): lighter, darker, redder, greener, ...
        maps.append(np.clip(signed, 0, 1).reshape(*lab.shape[:2], 6))
    return np.concatenate(maps, axis=2)


def _surface_maps(view: ObjectView) -> Float32s:
    """(h, w, 4) flat, curved, convex edge, rim."""
    weights = view.has_depth.astype(np.float32)
    points = _points_map(view)
    normals = _normals_map(smooth_inside(points, weights, 1.2), points)
    bend, outward = {}, {}
    for scale in (EDGE_SCALE, FORM_SCALE):
        mean_normal = smooth_inside(normals, weights, scale * view.pixels_across)
        height_m = ((points - smooth_inside(points, weights, scale * view.pixels_across)) * mean_normal).sum(axis=2)
        bend[scale] = np.clip((1 - np.linalg.norm(mean_normal, axis=2)) / BEND_FULL, 0, 1)
        outward[scale] = np.clip(0.5 + 2 * height_m / (scale * view.extent_m), 0, 1)
    edge = bend[EDGE_SCALE] * outward[EDGE_SCALE]
    rim = bend[EDGE_SCALE] * (1 - outward[EDGE_SCALE])
    maps = np.stack((1 - bend[FORM_SCALE], bend[FORM_SCALE] * (1 - bend[EDGE_SCALE]), edge, rim), axis=2)
    return (SURFACE_WEIGHT * maps * weights[:, :, None]).astype(np.float32)


def _points_map(view: ObjectView) -> Float32s:
    """(h, w, 3) points in camera coordinates, metres."""
    rows, columns = np.indices(view.depth_m.shape)
    points = view.camera.unproject(columns.ravel(), rows.ravel(), view.depth_m.ravel())
    return points.reshape(*view.depth_m.shape, 3).astype(np.float32)


def _normals_map(smooth: Float32s, points: Float32s) -> Float32s:
    """(h, w, 3) unit normals that face the camera, from the tangents of a smoothed map of points."""
    normals = np.cross(np.gradient(smooth, axis=0), np.gradient(smooth, axis=1))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True) + 1e-12
    return np.where((normals * points).sum(axis=2, keepdims=True) > 0, -normals, normals)
