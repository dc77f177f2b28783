"""Colours to align by: of a view with their gradients, and of a model, at a fine and a coarse smoothing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import small_gicp

from tracker.concept import ConceptModel
from tracker.frame import Mask
from tracker.geometry import Floats
from tracker.saliency.attributes import lab_of, smooth_inside
from tracker.view import Float32s, ObjectView

SMOOTHING_PX = (0.8, 2.5)  # of a view; the model is smoothed alike over its surface
SMOOTHING_NEIGHBOURS = 96  # at a point or two a pixel, all within two standard deviations of the coarse smoothing


class Smoothed:
    """lab: (h, w, 3) CIE L*a*b* of a view, smoothed within the object's pixels, inside: (h, w) bool."""

    def __init__(self, lab: Float32s, inside: Mask) -> None:
        self.lab, self._inside = lab, inside

    @cached_property
    def gradient(self) -> Float32s:
        """(h, w, 6) Lab a pixel along columns, then rows; 0 across the border of the object."""
        lab, inside = self.lab, self._inside
        gradient = np.zeros((*inside.shape, 6), np.float32)
        along_columns, along_rows = inside[:, 2:] & inside[:, :-2], inside[2:] & inside[:-2]
        gradient[:, 1:-1, :3] = (lab[:, 2:] - lab[:, :-2]) / 2 * along_columns[:, :, None]
        gradient[1:-1, :, 3:] = (lab[2:] - lab[:-2]) / 2 * along_rows[:, :, None]
        return gradient


class ViewAppearance:
    """Each level is worked out when it is asked for: a pose is judged by the fine one alone."""

    def __init__(self, view: ObjectView) -> None:
        self._lab, self._inside = lab_of(view.rgb), view.inside

    @cached_property
    def fine(self) -> Smoothed:
        return self._smoothed(SMOOTHING_PX[0])

    @cached_property
    def coarse(self) -> Smoothed:
        return self._smoothed(SMOOTHING_PX[1])

    def _smoothed(self, sigma_px: float) -> Smoothed:
        return Smoothed(smooth_inside(self._lab, self._inside.astype(np.float32), sigma_px), self._inside)


@dataclass(frozen=True, slots=True, eq=False)
class ModelAppearance:
    """(N, 3) CIE L*a*b* of the model's points."""

    fine: Floats
    coarse: Floats


def model_appearance(model: ConceptModel, pixels_across: int) -> ModelAppearance:
    lab = lab_of(model.colours[None])[0].astype(np.float64)
    neighbours = min(SMOOTHING_NEIGHBOURS, len(model))
    index, squared = small_gicp.KdTree(model.points).batch_knn_search(model.points, neighbours)
    sigma_m = SMOOTHING_PX[1] * model.diameter_m / pixels_across
    weights = np.exp(-np.asarray(squared) / (2 * sigma_m**2))
    weights *= np.einsum("nki,ni->nk", model.normals[np.asarray(index)], model.normals) > 0  # not through thin walls
    coarse = (lab[np.asarray(index)] * weights[:, :, None]).sum(axis=1) / weights.sum(axis=1, keepdims=True)
    return ModelAppearance(lab, coarse)
