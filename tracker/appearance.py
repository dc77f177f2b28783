"""Colours to align by: of a view with their gradients, and of a model, at a fine and a coarse smoothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import small_gicp

from tracker.concept import ConceptModel
from tracker.geometry import Floats
from tracker.saliency.attributes import lab_of, smooth_inside
from tracker.view import Float32s, ObjectView

SMOOTHING_PX = (0.8, 2.5)  # of a view; the model is smoothed alike over its surface
SMOOTHING_NEIGHBOURS = 96  # at a point or two a pixel, all within two standard deviations of the coarse smoothing


@dataclass(frozen=True, slots=True, eq=False)
class ViewAppearance:
    """Fine and coarse level: lab (h, w, 3) CIE L*a*b*, and gradient (h, w, 6) Lab a pixel along columns, then rows;
    0 across the border of the object."""

    lab: tuple[Float32s, Float32s]
    gradient: tuple[Float32s, Float32s]


@dataclass(frozen=True, slots=True, eq=False)
class ModelAppearance:
    """Fine and coarse level: lab (N, 3) of the model's points."""

    lab: tuple[Floats, Floats]


def view_appearance(view: ObjectView) -> ViewAppearance:
    weights = view.inside.astype(np.float32)
    lab = lab_of(view.rgb)
    fine, coarse = (smooth_inside(lab, weights, sigma) for sigma in SMOOTHING_PX)
    return ViewAppearance((fine, coarse), (_gradient(fine, view.inside), _gradient(coarse, view.inside)))


def model_appearance(model: ConceptModel, pixels_across: int) -> ModelAppearance:
    lab = lab_of(model.colours[None])[0].astype(np.float64)
    neighbours = min(SMOOTHING_NEIGHBOURS, len(model))
    index, squared = small_gicp.KdTree(model.points).batch_knn_search(model.points, neighbours)
    sigma_m = SMOOTHING_PX[1] * model.diameter_m / pixels_across
    weights = np.exp(-np.asarray(squared) / (2 * sigma_m**2))
    weights *= np.einsum("nki,ni->nk", model.normals[np.asarray(index)], model.normals) > 0  # not through thin walls
    coarse = (lab[np.asarray(index)] * weights[:, :, None]).sum(axis=1) / weights.sum(axis=1, keepdims=True)
    return ModelAppearance((lab, coarse))


def _gradient(lab: Float32s, inside: np.ndarray) -> Float32s:
    gradient = np.zeros((*lab.shape[:2], 6), np.float32)
    along_columns = inside[:, 2:] & inside[:, :-2]
    along_rows = inside[2:] & inside[:-2]
    gradient[:, 1:-1, :3] = (lab[:, 2:] - lab[:, :-2]) / 2 * along_columns[:, :, None]
    gradient[1:-1, :, 3:] = (lab[2:] - lab[:-2]) / 2 * along_rows[:, :, None]
    return gradient
