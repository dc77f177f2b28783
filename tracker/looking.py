"""Looking for one object at one place in a frame, or at several, until it is found."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np

from tracker.belief import AS_EXPLAINED, LEAST_ENDS, LEAST_SURFACE
from tracker.cloud import LEAST_POINTS, lift
from tracker.concept import ConceptModel
from tracker.confidence import Grounds, confidence, turn_sigma_rad
from tracker.config import TrackerConfig
from tracker.found import Found, Look, Usual
from tracker.frame import Frame, Mask
from tracker.geometry import Pose
from tracker.rivals import CLEARLY_MORE, TURNED_RAD, told_apart
from tracker.saliency import Saliency
from tracker.search import Hypothesis, Search, Sight
from tracker.stopwatch import Stopwatch
from tracker.view import ObjectView, view_object

MOST_TRIED = 256  # poses that are remembered: more than one frame leads to
REMEMBERED = 30  # frames in which it was followed: a second of a usual camera
STEADY_RAD = 0.15  # a pose farther than this from the expected one is a surprise
ASKED_LATELY = 3  # frames: what concepts could not explain they cannot in the next ones
ALIKE_RAD = 0.5  # an object that is lost is not expected to be turned by more meanwhile

T = TypeVar("T")
# Asks for the saliency of a view, as often as it takes; is given None where that is not to be had now.
Asking = Generator[ObjectView, Saliency | None, T]


class Looking:
    """For one model. waiting: whether it did without concepts that it asked for, since somebody set that to False.
    tried: what was found lately, believed or not, since somebody cleared it. told_apart: in [0, 1], how surely what was
    believed is told from what is turned otherwise, as it was when that was tried last."""

    def __init__(self, model: ConceptModel, config: TrackerConfig) -> None:
        self._model, self._config = model, config
        self._search, self._centre_m = Search(model, config), model.points.mean(axis=0)
        self._asked, self._without_concepts = False, 0  # ever; looks in a row that did without
        self._usual = 0.0  # score of what was believed last
        self._looked: deque[Usual] = deque(maxlen=REMEMBERED)  # while it was followed
        self.waiting = False
        self.tried: deque[Found] = deque(maxlen=MOST_TRIED)
        self.told_apart = 1.0

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
        told = None if best.saliency is None else told_apart(best, self.tried, self._model)
        return replace(best, missed=missed, told_apart=told)

    def came_of_it(self, found: Found | None) -> None:
        """What was believed, None where the object is lost: next time every place is looked at then."""
        self._usual = 1.0 if found is None else found.score
        self.told_apart = 1.0 if found is None else self.told_apart
        if found is not None:
            self.tells_apart(found)
            evidence, usual = found.hypothesis.evidence, found.usual
            if usual is None or found.explains > AS_EXPLAINED * usual.explains:  # else it hardly shows, or is another
                self._looked.append(Usual(found.explains, evidence.colour, evidence.contradicted))

    def tells_apart(self, found: Found) -> None:
        """What was tried beside it says how surely what is believed, which is the same, is told from others."""
        if found.told_apart is not None:
            self.told_apart = found.told_apart

    def forget(self) -> None:
        """How it usually looked, and what it may be taken for."""
        self._looked.clear()
        self.told_apart = 1.0

    def concepts_asked(self) -> None:
        """And answered."""
        self._asked, self._without_concepts = True, 0

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
        return self._held((yield from self._by_itself(look, sight, clock)), look, sight, clock)

    def _held(self, best: Found | str, look: Look, sight: Sight, clock: Stopwatch) -> Found | str:
        """The same, held by where it is if it stands still, where the picture leaves it unsure and does not deny it."""
        found = None if isinstance(best, str) else best
        if look.rest is None or (found and found.grounds.turn_sigma_rad < self._config.unsure_rad):
            return best
        refined = found and found.hypothesis.refined
        with clock("camera motion"):
            resting = look.rest(refined, self._model.symmetry)
        if resting is None:
            return best
        hypothesis = self._search.held(refined, resting, sight, clock)
        if hypothesis is None:
            return best
        held = self._found(hypothesis, look)
        if found is None:
            return held if held.confidence >= self._config.believe else best
        denied = held.confidence < found.confidence or held.explains < found.explains - CLEARLY_MORE
        return best if denied else replace(held, saliency=found.saliency)

    def _by_itself(self, look: Look, sight: Sight, clock: Stopwatch) -> Asking[Found | str]:
        """What the picture alone says."""
        view = sight.view
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
        self.concepts_asked()
        with clock("cloud"):
            cloud = lift(view, saliency, self._config.cloud)
        if len(cloud) < LEAST_POINTS:
            return best or f"too little to see: {len(cloud)} usable points, {LEAST_POINTS} are needed"
        if look.start is not None:
            unclear = best is None or not self._clear(best)  # else the surface has said all that it can
            near = self._search.near(look.start, continued, sight, cloud, clock, by_surface=unclear)
            best = self._likeliest(best, near, look)
        if look.start is None or (look.masked and (best is None or best.score < self._config.trust)):
            best = self._likeliest(best, self._search.anywhere(sight, cloud, clock), look)
            if look.told and (best is None or not self._good(best)):
                best = self._likeliest(best, self._search.touching(sight, cloud, clock), look)
        if best is None:
            return "poor fit: no pose explains what is seen"
        # What is turned wrongly at first is followed so, and what had rivals may have them still.
        every = (look.told and best.hypothesis.anywhere) or self.told_apart < self._config.sure
        best = self._likeliest(best, self._search.turned(best.hypothesis, sight, clock, every=every), look) or best
        return replace(self._settled(best, sight, look, clock), saliency=saliency)

    def _settled(self, found: Found, sight: Sight, look: Look, clock: Stopwatch) -> Found:
        """The same, refined to the end where it was found from scratch, unless the picture denies where that leads."""
        hypothesis = self._search.settled(found.hypothesis, sight, clock) if found.hypothesis.anywhere else None
        if hypothesis is None:
            return found
        settled = self._found(hypothesis, look)
        return found if settled.explains < found.explains - CLEARLY_MORE else settled

    def _likeliest(self, best: Found | None, hypotheses: Iterable[Hypothesis], look: Look) -> Found | None:
        """The first of those that are most likely."""
        for hypothesis in hypotheses:
            found = self._found(hypothesis, look)
            best = found if best is None or found.confidence > best.confidence else best
        return best

    def _clear(self, found: Found) -> bool:
        """Whether nothing better is to be expected: it fits well or is likely, and fits not much worse than it did."""
        as_usual = found.score >= self._usual - self._config.jump
        return as_usual and self._good(found)

    def _good(self, found: Found) -> bool:
        """Whether it fits well or is likely, however it fitted before."""
        return found.score >= self._config.trust or found.confidence >= self._config.sure

    def _sure(self, continued: Found) -> bool:
        """Whether concepts could say nothing new, as it is clearly where it was expected. Surface and colours alone let
        a plain cup slide around its axis until the handle is out of sight; and what a pose leaves unexplained may be a
        side that the model does not know, or one that it knows at another pose."""
        steady = continued.grounds.turn_rad is not None and continued.grounds.turn_rad < STEADY_RAD
        lately = self._asked and self._without_concepts < ASKED_LATELY
        mostly = continued.hypothesis.evidence.explained >= LEAST_ENDS or lately
        return steady and mostly and self._clear(continued) and continued.confidence >= self._config.sure

    def _found(self, hypothesis: Hypothesis, look: Look) -> Found:
        grounds = self._grounds(hypothesis, look.expected)
        # What is not believed for its surface is no rival of a pose that may be.
        likely = confidence(grounds) if hypothesis.evidence.surface >= LEAST_SURFACE else 0.0
        usual = Usual(*np.median(self._looked, axis=0).tolist()) if self._looked else None
        found = Found(
            hypothesis, grounds, likely, self._expects(look, hypothesis), look.masked,
            jumped=self._jumped(hypothesis, look.expected), usual=usual,
        )  # fmt: skip
        self.tried.append(found)
        return found

    def _jumped(self, hypothesis: Hypothesis, expected: Sequence[Pose]) -> bool:
        pose, symmetry = hypothesis.refined.T_cam_obj, self._model.symmetry
        near = partial(symmetry.same, pose, angle_rad=TURNED_RAD, distance_m=self._model.diameter_m / 4)
        return hypothesis.anywhere and not any(near(other) for other in expected)

    def _expects(self, look: Look, hypothesis: Hypothesis) -> bool:
        """Whether it is no farther than its own size from where it was expected, and turned about alike; or from where
        it is said to be."""
        pose, diameter_m = hypothesis.refined.T_cam_obj, self._model.diameter_m
        centre_m = pose @ self._centre_m[None]
        if look.place_m is not None:
            return float(np.linalg.norm(centre_m - look.place_m)) < diameter_m
        nearest = (self._model.symmetry.nearest(other, pose) for other in look.expected)
        return any(
            float(np.linalg.norm(centre_m - other @ self._centre_m[None])) < diameter_m
            and other.angle_to_rad(pose) < ALIKE_RAD
            for other in nearest
        )

    def _grounds(self, hypothesis: Hypothesis, expected: Sequence[Pose]) -> Grounds:
        refined, symmetry = hypothesis.refined, self._model.symmetry
        grounds = Grounds(hypothesis.evidence, turn_sigma_rad(refined, symmetry))
        if not expected:
            return grounds
        pose = refined.T_cam_obj
        turns_rad = [symmetry.nearest(pose, other).angle_to_rad(other) for other in expected]
        moved_m = [pose.distance_to_m(other) for other in expected] + np.array(turns_rad) * self._model.diameter_m / 2
        return replace(grounds, turn_rad=turns_rad[moved_m.argmin()])
