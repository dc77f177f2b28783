"""Shapes in files of vertices -> the model that errors are measured on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.distance import pdist

from eval.datasets import ObjectModel
from tracker.errors import SourceError
from tracker.geometry import Floats
from tracker.sources.text_files import read_points

LARGEST_PLAUSIBLE_M = 3.0  # across an object; one in millimetres is always larger


def read_model(candidates: Sequence[Path], symmetric: bool | None) -> ObjectModel:
    """From the first of the files that exists, in metres: a mesh (OBJ) or points (XYZ, three numbers a line).

    All vertices count, and the diameter is the largest distance between two of them. Raises SourceError where none of
    the files is there, or the first holds no shape.
    """
    path = next((file for file in candidates if file.is_file()), None)
    if path is None:
        raise SourceError(f"errors are measured on a shape, expected in {' or '.join(map(str, candidates))}")
    points_m = read_points(path) if path.suffix == ".xyz" else _read_vertices(path)
    try:
        diameter_m = float(pdist(points_m[ConvexHull(points_m).vertices]).max())
    except (QhullError, ValueError) as error:
        raise SourceError(f"{path}: expected the points of a solid, got {len(points_m)} that span none") from error
    if diameter_m > LARGEST_PLAUSIBLE_M:
        raise SourceError(f"{path}: the shape is {diameter_m:.0f} across: this looks like millimetres, expected metres")
    return ObjectModel(points_m=points_m, diameter_m=diameter_m, symmetric=symmetric)


def _read_vertices(path: Path) -> Floats:
    import trimesh

    try:
        mesh = trimesh.load(path, process=False, maintain_order=True, skip_materials=True, force="mesh")
        points = np.asarray(getattr(mesh, "vertices", ()), np.float64)
    except Exception as error:  # the parser raises what it stumbles over
        raise SourceError(f"{path}: not a mesh that can be read ({error!r})") from error
    if points.shape[1:] != (3,) or not len(points) or not np.isfinite(points).all():
        raise SourceError(f"{path}: expected finite vertices, got shape {points.shape}")
    return points
