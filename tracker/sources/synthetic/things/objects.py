"""The table of the objects that are tracked, and what an evaluation needs to know of their shapes.

Object frame: centre of the bounding box, z up as the thing stands, metres.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from tracker.errors import SourceError
from tracker.geometry import Floats
from tracker.sources.synthetic.things import cereal_prints, tea_prints
from tracker.sources.synthetic.things.clamp import clamp
from tracker.sources.synthetic.things.drawing import Picture
from tracker.sources.synthetic.things.mesh import Ints, surface_samples
from tracker.sources.synthetic.things.solids import box
from tracker.sources.synthetic.things.texture import glossy, pack
from tracker.sources.synthetic.things.thing import Thing
from tracker.sources.synthetic.things.vessels import bowl, mug, soup_can

SURFACE_SAMPLES = 4000


@dataclass(frozen=True, slots=True, eq=False)
class ObjectShape:
    """What an evaluation needs: (N, 3) points on the surface in the object frame, the diameter, the symmetry, the mesh.

    symmetric: any turn about the object's z axis looks the same. vertices_m: (V, 3). triangles: (M, 3) indices of them.
    """

    points_m: Floats
    diameter_m: float
    symmetric: bool
    vertices_m: Floats
    triangles: Ints


def _carton(
    name: str, size_mm: tuple[float, float, float], sides: Mapping[str, Callable[[], Picture]], gloss: float
) -> Thing:
    texture, windows = pack({side: glossy(draw(), gloss) for side, draw in sides.items()})
    return Thing(name, box(np.divide(size_mm, 1000).tolist(), windows), texture)


OBJECTS: Mapping[str, Callable[[], Thing]] = {
    "cereal_box": lambda: _carton("cereal_box", cereal_prints.SIZE_MM, cereal_prints.SIDES, 0.3),
    "tea_box": lambda: _carton("tea_box", tea_prints.SIZE_MM, tea_prints.SIDES, 0.4),
    "soup_can": soup_can,
    "mug": mug,
    "clamp": clamp,
    "bowl": bowl,
}

SECOND = "_2"  # of two objects that are alike


@cache
def tracked_object(object_id: str) -> Thing:
    """Raises SourceError that lists the objects if there is no such one."""
    kind = object_id.removesuffix(SECOND)
    if kind not in OBJECTS:
        raise SourceError(f"there is no synthetic object {object_id!r}; there is {', '.join(OBJECTS)}")
    return replace(OBJECTS[kind](), name=object_id)


@cache
def shape_of(object_id: str) -> ObjectShape:
    thing = tracked_object(object_id)
    mesh = thing.mesh
    points_m = surface_samples(mesh, SURFACE_SAMPLES)
    return ObjectShape(points_m, mesh.diameter_m, thing.symmetric, mesh.vertices_m, mesh.faces)
