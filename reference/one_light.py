"""Colours of several reference views as one light would show them, as far as views of the same surface tell."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array, diags_array

from reference.group_means import GroupMeans
from tracker.geometry import Floats

DARKEST = 8.0  # of 255: darker colours are mostly noise, of which logarithms would make much
RATIO_SIGMA = 0.08  # how far the log colours of a surface stray where light does not change them
GAIN_SIGMA, SLOPE_SIGMA = 0.3, 0.2  # how far views differ in a channel, and from one side of the object to the other
ALIKE = 200  # neighbouring voxels err alike: so many tell of the light what one would
ROUNDS = 5


def in_one_light(
    colours: Floats, normals: Floats, voxel: npt.NDArray[np.intp], views: npt.NDArray[np.intp], weights: Floats
) -> Floats:
    """(N, 3) colours, 0 to 255, of points that several views show: what each view's light makes of them is taken off.

    normals: (N, 3) in axes common to all views. voxel, views: (N,) where on the surface a point is, and the number of
    the view that it is of. weights: (N,).

    Light makes log colours differ from view to view by a constant a channel, exposure and white balance, and by about
    a linear function of the normal, as one side is brighter (Ramamoorthi and Hanrahan, SIGGRAPH 2001, of the first
    order). Those are found that make the views of each voxel agree best, in spite of what print, gloss or a shadow
    does to some (weights of Cauchy's). What no two views show alike is left as it is.
    """
    pairs, point_of = np.unique(np.stack((voxel, views), axis=1), axis=0, return_inverse=True)
    mean = GroupMeans(point_of.reshape(-1), weights)
    target, normal = mean(np.log(np.maximum(colours, DARKEST))), mean(normals)
    voxel, view = np.unique(pairs[:, 0], return_inverse=True)[1].reshape(-1), pairs[:, 1]
    count = int(views.max()) + 1
    rows, channel = np.arange(3 * len(view)), np.repeat(np.arange(3), len(view))
    of_view, measured = np.tile(6 * view, 3), target.T.reshape(-1)
    # A row is a channel of a pair; it tells of a gain and of three slopes of the view, and of what the voxel is.
    columns = np.concatenate((of_view + channel, *(of_view + 3 + axis for axis in range(3))))
    values = np.concatenate((np.ones(len(rows)), *np.tile(normal.T, 3)))
    terms = csr_array((values, (np.tile(rows, 4), columns)), shape=(len(rows), 6 * count))
    voxels = csr_array((np.ones(len(rows)), (rows, 3 * np.tile(voxel, 3) + channel)))
    share, trust = np.tile(mean.total / mean.total.mean(), 3), np.ones(len(rows))
    prior = np.diag(np.tile([GAIN_SIGMA**-2] * 3 + [SLOPE_SIGMA**-2] * 3, count)) * RATIO_SIGMA**2 * ALIKE
    light = np.zeros(6 * count)
    for _ in range(ROUNDS):
        weight = diags_array(trust * share)
        gather = voxels.T @ weight
        mean_of = (gather @ terms).toarray().T / gather.sum(axis=1)  # a voxel is the mean of its views
        matrix = (terms.T @ weight @ terms).toarray() - mean_of @ (gather @ terms)
        light = np.linalg.solve(matrix + prior, terms.T @ weight @ measured - mean_of @ (gather @ measured))
        left = measured - terms @ light
        left -= voxels @ ((gather @ left) / gather.sum(axis=1))
        trust = 1 / (1 + (left / RATIO_SIGMA) ** 2)
    gains, slopes = np.split(light.reshape(count, 6), 2, axis=1)
    lit = gains[views] + (slopes[views] * normals).sum(axis=1, keepdims=True)
    return np.clip(colours * np.exp(-lit), 0, 255)
