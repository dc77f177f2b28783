"""Frames that were tracked without concepts are looked at again with them, by a worker that may take its time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import Protocol

from tracker.belief import believed
from tracker.camera_motion import CameraMotion, Landmarks
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.found import Found, Look
from tracker.geometry import Pose
from tracker.lockstep import lockstep
from tracker.looking import Asking, Looking
from tracker.places import Moment, Places
from tracker.saliency import Saliency
from tracker.view import ObjectView


@dataclass(frozen=True, slots=True, eq=False)
class Review:
    """What is to be done again, and what was known in that frame: the pose T_cam_obj that was believed, None where none
    was, the landmarks, and how often what was known had been forgotten by then: it says nothing after the next time."""

    again: Asking[Found | None]
    believed: Pose | None
    landmarks: Landmarks | None
    forgotten: int


class SecondLook:
    """One object's. It always asks for concepts, and touches nothing that goes on in later frames meanwhile."""

    def __init__(self, model: ConceptModel, config: TrackerConfig) -> None:
        self._config = config
        self._look = Looking(model, config.model_copy(update={"concepts_every": 1}))

    def __call__(
        self, looks: Iterable[Look | str], places: Places | None, now: Moment, followed: bool, told_apart: float
    ) -> Asking[Found | None]:
        """What is believed of what the looks find, or, where that is nothing, a search of the places; or None.
        told_apart: how surely what is believed is told from what is turned otherwise, as far as is known."""
        self._look.tried.clear()
        self._look.told_apart = told_apart
        # Where it stood can be asked in its own frame alone.
        by_itself = [look if isinstance(look, str) else replace(look, rest=None) for look in looks]
        found = yield from self._look.best(by_itself, now.frame, now.clock)
        if places is not None and not believed(found, followed, self._config):
            found = yield from places.anywhere(now, self._look)
        return found if believed(found, followed, self._config) else None


class Reviewed(Protocol):
    def reviewed(self, review: Review, found: Found, camera: CameraMotion) -> None: ...


Answered = Callable[[Mapping[int, ObjectView]], Mapping[int, Saliency | None]]


class Reviews:
    """One at a time, of all objects that ask for it in a frame. What comes in between is left out, so that the newest
    frame is next.

    skipped: frames in which concepts were asked for while the worker was busy.
    """

    def __init__(self, worker: Executor) -> None:
        self._worker = worker
        self._reviews: Sequence[tuple[Reviewed, Review]] = ()
        self._found: Future[list[Found | None]] | None = None
        self.skipped = 0

    def offer(self, reviews: Sequence[tuple[Reviewed, Review]], answered: Answered) -> None:
        """The newest frame's."""
        if reviews and self._found is not None:
            self.skipped += 1
        elif reviews:
            self._reviews = reviews
            self._found = self._worker.submit(lockstep, [review.again for _, review in reviews], answered)

    def collect(self, camera: CameraMotion) -> None:
        """Tell every object what was found of it, if the worker is done. Raises what the backend raised."""
        if self._found is None or not self._found.done():
            return
        done, self._found = self._found, None
        for (track, review), one in zip(self._reviews, done.result(), strict=True):
            if one is not None:
                track.reviewed(review, one, camera)
