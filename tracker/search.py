"""Where is it? One object's stages from the correspondences of a frame to a pose with its evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from tracker.appearance import ViewAppearance
from tracker.closest_points import ClosestPoints
from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.contacts import Contacts
from tracker.frame import Frame, Mask
from tracker.geometry import Floats, Pose
from tracker.glance import Glance
from tracker.matching import Matcher
from tracker.refinement import Refined, Refiner
from tracker.registration import register
from tracker.rest import Resting
from tracker.revolution import TURNS, Turns
from tracker.silhouette import Silhouette
from tracker.stopwatch import Stopwatch
from tracker.verification import Evidence, Verifier
from tracker.view import ObjectView, view_object

NEARLY_AS_GOOD = 0.75  # before refinement a turned pose explains less than it will
# Refined at most, none of them next to another, unless every one is asked for.
TURNED, NEIGHBOUR_RAD = 2, 1.5 * 2 * np.pi / TURNS


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What one frame shows of an object, and maybe of what is around it. masked: all of it is known to be of it."""

    view: ObjectView
    appearance: ViewAppearance
    masked: bool

    @classmethod
    def of(cls, view: ObjectView, *, masked: bool) -> Sight:
        return cls(view, ViewAppearance(view), masked)


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A refined pose, the evidence for it, and where the search for it began: concepts, prediction, search, contact, of
    two points, turn, of another pose about its axis, or stillness, where it is if it stands still. view: the pixels by
    which it was judged. anywhere: it was looked for in any pose, not near an expected one, or is a turn of such."""

    refined: Refined
    evidence: Evidence
    origin: str
    view: ObjectView
    anywhere: bool = False


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
        self._turns = Turns(model)
        self._glance = Glance(model, self._verify.surface, config.verification, self._device)
        self._touching = Contacts(model, config.contacts, config.registration, self._match, self._glance)

    def outline(self, T_cam_obj: Pose, frame: Frame) -> Mask | str:
        """(H, W) bool, where an object shows that is about at this pose, or why it does not."""
        return self._silhouette(T_cam_obj, frame, known=False)

    def continued(self, predicted: Pose, sight: Sight, clock: Stopwatch) -> Hypothesis | None:
        """The pose that surface and colours lead to from the prediction, without any concept."""
        return self._refined(predicted, sight, "prediction", clock)

    def near(
        self,
        predicted: Pose,
        continued: Hypothesis | None,
        sight: Sight,
        cloud: PointCloud,
        clock: Stopwatch,
        *,
        by_surface: bool,
    ) -> list[Hypothesis]:
        """Poses near the prediction, two at most, other than the one that it was continued to: pulled by the concepts
        first, and by_surface alone too."""
        with clock("matching"):
            correspondences = self._match(cloud, self._config.closest_points.concept_points)
        with clock("closest points"):
            pulled = self._closest.align(self._closest.pull(predicted, correspondences, cloud), cloud)
            direct = self._closest.align(predicted, cloud) if by_surface else None
        reached = [] if continued is None else [continued.refined.T_cam_obj]
        found = []
        for pose, origin in ((pulled, "concepts"), (direct, "prediction")):
            if pose and not any(self._alike(pose, other) for other in reached):
                found.append(self._refined(pose, sight, origin, clock))
                reached.append(pose)
        return [hypothesis for hypothesis in found if hypothesis]

    def settled(self, hypothesis: Hypothesis, sight: Sight, clock: Stopwatch) -> Hypothesis | None:
        """What it comes to if its refinement does not end early."""
        with clock("refinement"):
            refined = self._refine.settled(hypothesis.refined.T_cam_obj, sight.view, sight.appearance)
        if refined is None:
            return None
        with clock("verification"):
            judged = self._judged(refined, sight, hypothesis.origin)
        return judged and replace(judged, anywhere=hypothesis.anywhere)

    def held(self, refined: Refined | None, resting: Resting, sight: Sight, clock: Stopwatch) -> Hypothesis | None:
        """The pose, as sure as the picture leaves it, held by where it is if it stands still."""
        with clock("verification"):
            return self._judged(resting.held(refined, self._model.symmetry), sight, "stillness")

    def _alike(self, a: Pose, b: Pose) -> bool:
        """So near that refinement brings them to the same pose."""
        return a.angle_to_rad(b) < 0.03 and a.distance_to_m(b) < 0.01 * self._model.diameter_m

    def anywhere(self, sight: Sight, cloud: PointCloud, clock: Stopwatch) -> list[Hypothesis]:
        """The poses on which correspondences agree, wherever they are, that explain most of what is seen."""
        with clock("matching"):
            correspondences = self._match(cloud)
        with clock("registration"):
            generator = torch.Generator(self._device).manual_seed(self._config.seed)
            candidates = register(correspondences, cloud, self._model, self._config.registration, generator)
            poses = self._inequivalent([candidate.T_cam_obj for candidate in candidates])
        with clock("verification"):
            best_first = np.argsort(-self._roughly(poses, sight), kind="stable")
        return self._best_of([poses[k] for k in best_first], sight, cloud, "search", clock)

    def touching(self, sight: Sight, cloud: PointCloud, clock: Stopwatch) -> list[Hypothesis]:
        """The poses in which one point touches another that is like it, wherever they are, that explain most of what is
        seen: they are had where next to no correspondence is right, and take longer."""
        with clock("contacts"):
            poses = self._touching(cloud, sight.view, sight.appearance, masked=sight.masked)
            poses = self._inequivalent(poses)
        return self._best_of(poses, sight, cloud, "contact", clock)

    def _best_of(
        self, poses: Sequence[Pose], sight: Sight, cloud: PointCloud, origin: str, clock: Stopwatch
    ) -> list[Hypothesis]:
        """What the first of them lead to, once where several lead to the same."""
        found, reached = [], []
        for pose in poses[: self._config.verified]:
            with clock("closest points"):
                closer = self._closest.align(pose, cloud)
            if closer and not any(self._alike(closer, other) for other in reached):
                found.append(self._refined(closer, sight, origin, clock))
                reached.append(closer)
        return [replace(hypothesis, anywhere=True) for hypothesis in found if hypothesis]

    def turned(
        self, hypothesis: Hypothesis, sight: Sight, clock: Stopwatch, *, every: bool = False
    ) -> list[Hypothesis]:
        """The poses that its shape hardly tells from this one: those that explain most of what is seen, or every one
        that explains nearly as much. One that leads back to it began where it did."""
        turns = self._turns.of(hypothesis.refined.T_cam_obj)
        with clock("verification"):
            own, *worth = self._roughly([hypothesis.refined.T_cam_obj, *turns], sight)
        chosen: list[Pose] = []
        for pose in (turns[k] for k in np.argsort(worth)[::-1] if worth[k] > NEARLY_AS_GOOD * own):
            apart = all(pose.angle_to_rad(other) > NEIGHBOUR_RAD for other in chosen)
            if every or (len(chosen) < TURNED and apart):
                chosen.append(pose)
        found = [turned for pose in chosen if (turned := self._refined(pose, sight, "turn", clock))]
        there = hypothesis.refined.T_cam_obj
        back = [self._alike(turned.refined.T_cam_obj, there) for turned in found]
        origins = [hypothesis.origin if same else turned.origin for turned, same in zip(found, back, strict=True)]
        return [
            replace(turned, origin=origin, anywhere=hypothesis.anywhere)
            for turned, origin in zip(found, origins, strict=True)
        ]

    def _inequivalent(self, poses: Sequence[Pose]) -> list[Pose]:
        """Those that the object's symmetry does not make the same as one before them."""
        alike = self._config.registration
        distance_m = alike.distinct_share * self._model.diameter_m
        return [poses[k] for k in self._model.symmetry.distinct(poses, alike.distinct_rad, distance_m)]

    def _refined(self, T_start: Pose | None, sight: Sight, origin: str, clock: Stopwatch) -> Hypothesis | None:
        if T_start is None:
            return None
        with clock("refinement"):
            refined = self._refine(T_start, sight.view, sight.appearance)
        if refined is None:
            return None
        with clock("verification"):
            return self._judged(refined, sight, origin)

    def _roughly(self, poses: Sequence[Pose], sight: Sight) -> Floats:
        """(B,) how well each explains what is seen."""
        motions = self._glance.motions(poses)
        return self._glance(motions, sight.view, sight.appearance, masked=sight.masked).cpu().numpy()

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
            view, appearance = own, ViewAppearance(own)
        evidence = self._verify(refined.T_cam_obj, view, appearance, around=not sight.masked)
        return Hypothesis(refined, evidence, origin, view)
