"""One-shot relative pose: an anchor and a query image of one object, a model made of the anchor alone.

The protocol of Oryon (Corsetti et al., CVPR 2024) and of ConceptPose: T_query_anchor is estimated, and composed with
the anchor's true pose, to be scored as a pose of the query.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from eval.datasets import Target

PairKind = Literal["cross-scene", "same-scene"]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """An object in an image, with the truth."""

    scene_id: int
    target: Target


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Two views of one object: the anchor, of which a model is made, and the query, whose pose is asked for."""

    anchor: View
    query: View

    @property
    def kind(self) -> PairKind:
        return "same-scene" if self.anchor.scene_id == self.query.scene_id else "cross-scene"

    @property
    def object_id(self) -> str:
        return self.query.target.object_id
