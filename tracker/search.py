"""Where is it? One object's stages from the correspondences of a frame to a pose with its evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from tracker.appearance import ViewAppearance, view_appearance
from tracker.closest_points import ClosestPoints
from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame, Mask
from tracker.geometry import Pose
from tracker.matching import Correspondences, Matcher
from tracker.refinement import Refined, Refiner
from tracker.registration import Candidate, register
from tracker.silhouette import Silhouette
from tracker.stopwatch import Stopwatch
from tracker.verification import Evidence, Verifier
from tracker.view import ObjectView, view_object


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What one frame shows of an object, and maybe of what is around it. masked: all of it is known to be of it."""

    view: ObjectView
    appearance: ViewAppearance
    masked: bool

    @classmethod
    def of(cls, view: ObjectView, *, masked: bool) -> Sight:
        return cls(view, view_appearance(view), masked)


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A refined pose, the evidence for it, and where the search for it began: concepts, prediction or search. view: the
    pixels by which it was judged."""

    refined: Refined
    evidence: Evidence
    origin: str
    view: ObjectView


class Search:
    """Finds one object in what frames show of it, each by itself."""

    def __init__(self, model: ConceptModel, config: TrackerConfig) -> None:
        self._model, self._config = model, config
        self._device = config.torch_device
        self._match = Matcher(model, config.matching, self._device)
        self._closest = ClosestPoints(model, config.closest_points)
        self._refine = Refiner(model, config.refinement, config.view.pixels_across)
        self._verify = Verifier(model, config.verification, config.view.pixels_across)
        self._silhouette = Silhouette(model, config.silhouette, config.view.pixels_across)
        self._matched: tuple[PointCloud, Correspondences] | None = None

    def __call__(self, sight: Sight, cloud: PointCloud, predicted: Pose | None, clock: Stopwatch) -> Hypothesis | None:
        """The pose that explains best what is seen, anywhere where none is clearly near a prediction; or None."""
        found = None if predicted is None else self.near(predicted, sight, cloud, clock)
        if found is None or found.evidence.score < self._config.trust:
            found = preferred(found, self.anywhere(sight, cloud, clock), self._config)
        return found

    def outline(self, T_cam_obj: Pose, frame: Frame) -> Mask | str:
        """(H, W) bool, where an object shows that is about at this pose, or why it does not."""
        return self._silhouette(T_cam_obj, frame, known=False)

    def continued(self, predicted: Pose, sight: Sight, clock: Stopwatch) -> Hypothesis | None:
        """The pose that surface and colours lead to from the prediction, without any concept."""
        return self._refined(predicted, sight, "prediction", clock)

    def near(self, predicted: Pose, sight: Sight, cloud: PointCloud, clock: Stopwatch) -> Hypothesis | None:
        """The better of two poses near the prediction: by surfaces alone, and pulled by the concepts first."""
        correspondences = self._correspondences(cloud, clock)
        with clock("closest points"):
            pulled = self._closest.align(self._closest.pull(predicted, correspondences, cloud), cloud)
            direct = self._closest.align(predicted, cloud)
        found = self._refined(pulled, sight, "concepts", clock)
        if direct and pulled and self._alike(direct, pulled):
            return found
        return better(self._refined(direct, sight, "prediction", clock), found)

    def _correspondences(self, cloud: PointCloud, clock: Stopwatch) -> Correspondences:
        """Which of the cloud's points is which point of the model? Of the last cloud they are kept."""
        if self._matched is None or self._matched[0] is not cloud:
            with clock("matching"):
                self._matched = (cloud, self._match(cloud))
        return self._matched[1]

    def _alike(self, a: Pose, b: Pose) -> bool:
        """So near that refinement brings them to the same pose."""
        return a.angle_to_rad(b) < 0.03 and a.distance_to_m(b) < 0.01 * self._model.diameter_m

    def anywhere(self, sight: Sight, cloud: PointCloud, clock: Stopwatch) -> Hypothesis | None:
        """The best of the poses on which correspondences agree, wherever that is."""
        correspondences = self._correspondences(cloud, clock)
        with clock("registration"):
            generator = torch.Generator(self._device).manual_seed(self._config.seed)
            candidates = register(correspondences, cloud, self._model, self._config.registration, generator)
            candidates = self._inequivalent(candidates)
        with clock("verification"):
            candidates.sort(key=lambda candidate: -self._roughly(candidate.T_cam_obj, sight))
        best = None
        for candidate in candidates[: self._config.verified]:
            with clock("closest points"):
                closer = self._closest.align(candidate.T_cam_obj, cloud)
            best = better(best, self._refined(closer, sight, "search", clock))
        return best

    def _inequivalent(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Those that the object's symmetry does not make the same as a better supported one."""
        alike = self._config.registration
        poses, distance_m = [c.T_cam_obj for c in candidates], alike.distinct_share * self._model.diameter_m
        return [candidates[k] for k in self._model.symmetry.distinct(poses, alike.distinct_rad, distance_m)]

    def _refined(self, T_start: Pose | None, sight: Sight, origin: str, clock: Stopwatch) -> Hypothesis | None:
        if T_start is None:
            return None
        with clock("refinement"):
            refined = self._refine(T_start, sight.view, sight.appearance)
        if refined is None:
            return None
        with clock("verification"):
            return self._judged(refined, sight, origin)

    def _roughly(self, T_cam_obj: Pose, sight: Sight) -> float:
        evidence = self._verify(T_cam_obj, sight.view, sight.appearance)
        return evidence.score if sight.masked else evidence.of_itself

    def _judged(self, refined: Refined, sight: Sight, origin: str) -> Hypothesis | None:
        """By the object's pixels. Where nobody knows them, by those that the pose itself says are the object's, and
        those around them that lie on: a thing ends where its outline does, a wall or a table goes on. None where none
        are."""
        view, appearance = sight.view, sight.appearance
        if not sight.masked:
            mask = self._silhouette(refined.T_cam_obj, view.frame, known=True)
            if isinstance(mask, str):
                return None
            own = view_object(view.frame, mask, self._model.diameter_m, self._config.view)
            if own is None:
                return None
            view, appearance = own, view_appearance(own)
        return Hypothesis(refined, self._verify(refined.T_cam_obj, view, appearance), origin, view)


def preferred(expected: Hypothesis | None, elsewhere: Hypothesis | None, config: TrackerConfig) -> Hypothesis | None:
    """The expected pose, unless it is not acceptable or the one found elsewhere is clearly better."""
    if expected is None or elsewhere is None or expected.evidence.score < config.accept:
        return better(expected, elsewhere)
    return elsewhere if elsewhere.evidence.score > expected.evidence.score + config.jump else expected


def better(a: Hypothesis | None, b: Hypothesis | None) -> Hypothesis | None:
    """The one with the higher score, the first of equals."""
    if a is None or b is None:
        return a or b
    return a if a.evidence.score >= b.evidence.score else b
