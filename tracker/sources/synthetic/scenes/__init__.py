"""The table of scenes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tracker.sources.synthetic.scenes.crowded import shelf, tabletop, twins
from tracker.sources.synthetic.scenes.disturbed import blind, hand, hidden, jerk, lights
from tracker.sources.synthetic.scenes.layout import Layout
from tracker.sources.synthetic.scenes.replaced import away, gone, swapped
from tracker.sources.synthetic.scenes.single import leave, still, turn
from tracker.sources.synthetic.things.objects import OBJECTS


@dataclass(frozen=True, slots=True)
class SceneKind:
    """An entry of the table. frames: how many unless asked otherwise. heroes: its one object is one of these, by the
    seed, unless another is asked for; none where a scene has all objects."""

    summary: str
    frames: int
    build: Callable[[int, str], Layout]
    heroes: tuple[str, ...] = ()

    def hero(self, seed: int) -> str:
        """Empty where the scene has all objects."""
        return self.heroes[seed % len(self.heroes)] if self.heroes else ""


ANY = tuple(OBJECTS)
SCENES: Mapping[str, SceneKind] = {
    "tabletop": SceneKind("six objects and clutter on a table, the camera goes around", 90, tabletop),
    "turn": SceneKind("one object turns and travels, the camera is still", 90, turn, ("mug",)),
    "shelf": SceneKind("six objects on shelves, the camera passes by", 90, shelf),
    "still": SceneKind("one object, nothing moves", 60, still, ("tea_box",)),
    "leave": SceneKind("one object is hidden by a parcel, leaves the view and comes back", 150, leave, ("soup_can",)),
    "twins": SceneKind("two objects that are alike, one passes before the other", 90, twins, ("mug",)),
    "hidden": SceneKind("something covers the object for a second", 78, hidden, ANY),
    "away": SceneKind("the object is taken away and comes back elsewhere, beside a look-alike", 90, away, ANY),
    "gone": SceneKind("the object is not there for 100 frames, half of them of another room", 162, gone, ANY),
    "hand": SceneKind("a hand reaches partly before the object", 66, hand, ANY),
    "jerk": SceneKind("the camera jumps by 15 cm and 40 degrees", 66, jerk, ANY),
    "lights": SceneKind("brightness and colour of the light change", 60, lights, ANY),
    "blind": SceneKind("depth fails for 10 frames", 60, blind, ANY),
    "swapped": SceneKind("another object is all at once where the object was", 60, swapped, ANY),
}
