"""What is looked for in a frame, and what was found of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from tracker.confidence import Grounds
from tracker.frame import Mask
from tracker.geometry import Floats, Pose
from tracker.refinement import Refined
from tracker.rest import Resting
from tracker.saliency import Saliency
from tracker.search import Hypothesis
from tracker.symmetry import Symmetry


class Usual(NamedTuple):
    """Medians over the last frames in which an object was followed: of what was explained, and as in the evidence."""

    explains: float
    colour: float
    contradicted: float


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """Where to look: the pixels of `mask` (H, W), near the pose `start`, or for any pose where there is none. expected:
    all poses that the object was expected at. place_m: (3,) camera coordinates, where somebody said that it is, though
    no pose could be told there. masked: the pixels are known to be the object's; then it is looked for in any pose too,
    where it is not clearly near the start. told: somebody said that it is there, so that it is worth a longer search.
    contested: the next look is to be compared with it, however clear it is. rest: tells where it is if it stands still,
    None where that is not known; it is to be asked in this frame."""

    mask: Mask
    start: Pose | None
    expected: Sequence[Pose] = ()
    place_m: Floats | None = None
    masked: bool = False
    told: bool = False
    contested: bool = False
    rest: Callable[[Refined | None, Symmetry], Resting | None] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A pose, and what speaks for it. expected: it was about there, or somebody said that it is. masked: by pixels that
    are known to be the object's. jumped: it was looked for in any pose, and is not in one that was expected. missed:
    why it did not even show at the first place where it was looked for; empty where something did. saliency: what
    concepts said there, None where surface and colours were enough. usual: how it looked while it was followed, None
    where it was not. told_apart: in [0, 1], how surely it is told from what is turned otherwise, None where
    surface and colours were enough: then hardly anything else was tried."""

    hypothesis: Hypothesis
    grounds: Grounds
    confidence: float
    expected: bool
    masked: bool
    jumped: bool = False
    missed: str = ""
    saliency: Saliency | None = None
    usual: Usual | None = None
    told_apart: float | None = None

    @property
    def score(self) -> float:
        return self.hypothesis.evidence.score

    @property
    def explains(self) -> float:
        """In [0, 1], what the picture alone says of it."""
        return min(self.score, self.hypothesis.evidence.of_itself)


@dataclass(frozen=True, slots=True, eq=False)
class Attempt:
    """How one object was looked for in a frame. looks: where, one after the other, or why nowhere. tried: the poses
    that were found and judged, there and in the whole picture."""

    looks: tuple[Look | str, ...]
    tried: tuple[Found, ...]
