"""Looking for one object at one place in a frame, or at several, until it is found."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeGuard, TypeVar

import numpy as np

from tracker.cloud import LEAST_POINTS, lift
from tracker.concept import ConceptModel
from tracker.confidence import Grounds, confidence, turn_sigma_rad
from tracker.config import TrackerConfig
from tracker.frame import Frame, Mask
from tracker.geometry import Floats, Pose
from tracker.saliency import Saliency
from tracker.search import Hypothesis, Search, Sight
from tracker.stopwatch import Stopwatch
from tracker.verification import LEAST_EXPLAINED
from tracker.view import ObjectView, view_object

LEAST_SURFACE = 0.2  # of what should be seen: where less is in place, its colours prove nothing
MOST_SEEN_THROUGH = 0.1  # of what should be seen: of right poses in rendered scenes one of a hundred has over 0.01
MOST_TRIED = 64  # poses that are remembered
# What is seen where nothing was expected has to end where its outline does or to show much of itself, and most of what
# faces the camera has to be in sight: else it may be a patch of a wall, or a can that stands in a table up to its lid.
LEAST_ENDS, LEAST_PROVED, MOST_HIDDEN = 0.7, 0.5, 0.5
# A look-alike may fit as exactly as the object itself, which a confidence is the higher for; of right poses that are
# found out of nowhere in rendered scenes one of a hundred has more than half of this in another colour.
MOST_CONTRADICTED = 0.15
STEADY_RAD = 0.1  # a pose farther than this from the expected one is a surprise

T = TypeVar("T")
# Asks for the saliency of a view, as often as it takes; is given None where that is not to be had now.
Asking = Generator[ObjectView, Saliency | None, T]


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """Where to look: the pixels of `mask` (H, W), near the pose `start`, or for any pose where there is none. expected:
    all poses that the object was expected at. place_m: (3,) camera coordinates, where somebody said that it is, though
    no pose could be told there. masked: the pixels are known to be the object's; then it is looked for in any pose too,
    where it is not clearly near the start. contested: the next look is to be compared with it, however clear it is."""

    mask: Mask
    start: Pose | None
    expected: Sequence[Pose] = ()
    place_m: Floats | None = None
    masked: bool = False
    contested: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A pose, and what speaks for it. expected: it was about there, or somebody said that it is. masked: by pixels that
    are known to be the object's. missed: why it did not even show at the first place where it was looked for; empty
    where something did. saliency: what concepts said there, None where surface and colours were enough."""

    hypothesis: Hypothesis
    grounds: Grounds
    confidence: float
    expected: bool
    masked: bool
    missed: str = ""
    saliency: Saliency | None = None

    @property
    def score(self) -> float:
        return self.hypothesis.evidence.score


@dataclass(frozen=True, slots=True, eq=False)
class Attempt:
    """How one object was looked for in a frame. looks: where, one after the other, or why nowhere. tried: the poses
    that were found and judged, there and in the whole picture."""

    looks: tuple[Look | str, ...]
    tried: tuple[Found, ...]


def believed(found: Found | str, followed: bool, config: TrackerConfig) -> TypeGuard[Found]:
    """Whether `doubt` has nothing to say."""
    return not doubt(found, followed, config)


def doubt(found: Found | str, followed: bool, config: TrackerConfig) -> str:
    """Why it is not believed, in words; empty where it is."""
    if isinstance(found, str):
        return found
    lacking = _lacking(found, followed, config)
    return lacking and (found.missed or f"poor fit: {lacking}")


def _lacking(found: Found, followed: bool, config: TrackerConfig) -> str:
    """What a pose lacks. It has to be likely. Where nobody says which pixels are the object's, less is asked where it
    was expected while it is followed than of what is seen again near there or has jumped, so that a state does not
    flicker; and most where nothing was expected."""
    seen, goes_on = found.hypothesis.evidence, found.masked or (followed and found.hypothesis.origin != "search")
    out_of_nowhere = not goes_on and not found.expected
    if seen.surface < LEAST_SURFACE:
        return f"{seen.surface:.0%} of what should be seen is in place"
    if seen.explained < LEAST_EXPLAINED:
        return f"{seen.explained:.0%} of what is seen there is explained"
    if seen.seen_through > MOST_SEEN_THROUGH:
        return f"{seen.seen_through:.0%} of what should be seen is seen through"
    if not goes_on and seen.contradicted > MOST_CONTRADICTED:
        return f"{seen.contradicted:.0%} of what is in place has another colour"
    if out_of_nowhere and seen.hidden > MOST_HIDDEN:
        return f"at the best pose {seen.hidden:.0%} of it would be hidden"
    if out_of_nowhere and seen.explained < LEAST_ENDS and seen.proved < LEAST_PROVED:
        return "what is seen at the best pose goes on beyond it"
    least = config.believe if goes_on else config.sure if out_of_nowhere else config.regain
    return "" if found.confidence >= least else f"the best pose is right at {found.confidence:.0%}"


class Looking:
    """For one model. waiting: whether it did without concepts that it asked for, since somebody set that to False.
    tried: what was found lately, believed or not, since somebody cleared it."""

    def __init__(self, model: ConceptModel, config: TrackerConfig) -> None:
        self._model, self._config = model, config
        self._search, self._centre_m = Search(model, config), model.points.mean(axis=0)
        self._without_concepts = 0  # looks in a row that did without
        self._usual = 0.0  # score of what was believed last
        self.waiting = False
        self.tried: deque[Found] = deque(maxlen=MOST_TRIED)

    def best(self, looks: Iterable[Look | str], frame: Frame, clock: Stopwatch) -> Asking[Found | str]:
        """The likeliest of what the looks find, no further than the first that leaves no doubt; or why there is
        nothing: what was said of the first place."""
        best, missed = None, ""
        for look in looks:
            seen = look if isinstance(look, str) else (yield from self._seen(look, frame, clock))
            if isinstance(seen, str):
                missed = missed if missed or best else seen
            elif best is None or seen.confidence > best.confidence:
                best = seen
            if best and self._clear(best) and not (isinstance(look, Look) and look.contested):
                break
        if best is None:
            return missed or "nothing in the picture looks like it"
        return replace(best, missed=missed)

    def came_of_it(self, score: float | None) -> None:
        """The score of what was believed, None where the object is lost: next time every place is looked at then."""
        self._usual = 1.0 if score is None else score

    def concepts_asked(self) -> None:
        """Somebody else has done so."""
        self._without_concepts = 0

    def outline(self, T_cam_obj: Pose, frame: Frame, clock: Stopwatch) -> Mask | str:
        """See `Search.outline`."""
        with clock("mask"):
            return self._search.outline(T_cam_obj, frame)

    def _seen(self, look: Look, frame: Frame, clock: Stopwatch) -> Asking[Found | str]:
        with clock("view"):
            view = view_object(frame, look.mask, self._model.diameter_m, self._config.view)
        if view is None:
            return "no depth within the mask"
        sight = Sight.of(view, masked=look.masked)
        asks = self._without_concepts >= self._config.concepts_every - 1
        continued = None if look.start is None else self._search.continued(look.start, sight, clock)
        best = continued and self._found(continued, look)
        if best and not asks and self._sure(best):
            self._without_concepts += 1
            return best
        saliency = yield view
        if saliency is None:
            self.waiting = True
            return best or "its concepts are not known yet"
        self._without_concepts = 0
        with clock("cloud"):
            cloud = lift(view, saliency, self._config.cloud)
        if len(cloud) < LEAST_POINTS:
            return f"too little to see: {len(cloud)} usable points, {LEAST_POINTS} are needed"
        if look.start is not None:
            best = self._likeliest(best, self._search.near(look.start, sight, cloud, clock), look)
        if look.start is None or (look.masked and (best is None or best.score < self._config.trust)):
            best = self._likeliest(best, self._search.anywhere(sight, cloud, clock), look)
        if best is None:
            return "poor fit: no pose explains what is seen"
        best = self._likeliest(best, self._search.turned(best.hypothesis, sight, clock), look) or best
        return replace(best, saliency=saliency)

    def _likeliest(self, best: Found | None, hypotheses: Iterable[Hypothesis], look: Look) -> Found | None:
        """The first of those that are most likely."""
        for hypothesis in hypotheses:
            found = self._found(hypothesis, look)
            best = found if best is None or found.confidence > best.confidence else best
        return best

    def _clear(self, found: Found) -> bool:
        """Whether nothing better is to be expected: it fits well or is likely, and fits not much worse than it did."""
        as_usual = found.score >= self._usual - self._config.jump
        return as_usual and (found.score >= self._config.trust or found.confidence >= self._config.sure)

    def _sure(self, continued: Found) -> bool:
        """Whether concepts could say nothing new, as it is clearly where it was expected. Surface and colours alone let
        a plain cup slide around its axis until the handle is out of sight; and what a pose leaves unexplained may be a
        side that the model does not know, or one that it knows at another pose."""
        steady = continued.grounds.turn_rad is not None and continued.grounds.turn_rad < STEADY_RAD
        mostly = continued.hypothesis.evidence.explained >= LEAST_ENDS
        return steady and mostly and self._clear(continued) and continued.confidence >= self._config.sure

    def _found(self, hypothesis: Hypothesis, look: Look) -> Found:
        grounds = self._grounds(hypothesis, look.expected)
        # What is not believed for its surface is no rival of a pose that may be.
        likely = confidence(grounds) if hypothesis.evidence.surface >= LEAST_SURFACE else 0.0
        found = Found(hypothesis, grounds, likely, self._expects(look, hypothesis), look.masked)
        self.tried.append(found)
        return found

    def _expects(self, look: Look, hypothesis: Hypothesis) -> bool:
        """Whether it is no farther than its own size from a place where it was expected, or is said to be."""
        places_m = [pose @ self._centre_m[None] for pose in look.expected] if look.place_m is None else [look.place_m]
        centre_m = hypothesis.refined.T_cam_obj @ self._centre_m[None]
        return any(float(np.linalg.norm(centre_m - place_m)) < self._model.diameter_m for place_m in places_m)

    def _grounds(self, hypothesis: Hypothesis, expected: Sequence[Pose]) -> Grounds:
        refined, symmetry = hypothesis.refined, self._model.symmetry
        grounds = Grounds(hypothesis.evidence, turn_sigma_rad(refined, symmetry))
        if not expected:
            return grounds
        pose = refined.T_cam_obj
        nearest = min(expected, key=pose.distance_to_m)
        return replace(grounds, turn_rad=symmetry.nearest(pose, nearest).angle_to_rad(nearest))
