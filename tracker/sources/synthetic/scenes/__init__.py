"""The table of scenes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tracker.sources.synthetic.scenes.crowded import shelf, tabletop
from tracker.sources.synthetic.scenes.layout import Layout
from tracker.sources.synthetic.scenes.single import leave, still, turn


@dataclass(frozen=True, slots=True)
class SceneKind:
    """An entry of the table. frames: how many unless asked otherwise. hero: its object, where it can be chosen."""

    summary: str
    frames: int
    build: Callable[[int, str], Layout]
    hero: str = ""


SCENES: Mapping[str, SceneKind] = {
    "tabletop": SceneKind("six objects and clutter on a table, the camera goes around", 90, tabletop),
    "turn": SceneKind("one object turns and travels, the camera is still", 90, turn, "mug"),
    "shelf": SceneKind("six objects on shelves, the camera passes by", 90, shelf),
    "still": SceneKind("one object, nothing moves", 60, still, "tea_box"),
    "leave": SceneKind("one object is hidden by a parcel, leaves the view and comes back", 150, leave, "soup_can"),
}
