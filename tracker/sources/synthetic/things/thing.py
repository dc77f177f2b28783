"""What a scene is made of: a mesh and its paint."""

from __future__ import annotations

from dataclasses import dataclass

from tracker.sources.synthetic.things.mesh import Mesh
from tracker.sources.synthetic.things.texture import Texture


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """A mesh and what is painted on it. symmetric: turning it about z changes neither its shape nor its look."""

    name: str
    mesh: Mesh
    texture: Texture
    symmetric: bool = False
