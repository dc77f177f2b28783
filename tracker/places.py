"""Where one object may be in a frame: by a mask, by somebody who points, by where it was, or anywhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain

from tracker.camera_motion import CameraMotion, Landmarks
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.found import Found, Look
from tracker.frame import Frame, Mask
from tracker.geometry import Pose
from tracker.looking import Asking, Looking
from tracker.pointing import Pointer
from tracker.proposals import Proposals
from tracker.refinement import Refined
from tracker.rest import Rest, Resting
from tracker.stopwatch import Stopwatch
from tracker.symmetry import Symmetry
from tracker.whereabouts import Whereabouts

SAME_RAD, SAME_SHARE = 0.05, 0.03  # poses nearer than this angle and share of the diameter are looked at once
MOVED_ON = 0.4  # diameters that it may have moved while nobody saw it


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A frame, how the camera came there, and the pixels (H, W) that other objects explain, None where none do."""

    frame: Frame
    camera: CameraMotion
    claimed: Mask | None
    clock: Stopwatch

    def unclaimed(self, mask: Mask) -> Mask:
        return mask if self.claimed is None else mask & ~self.claimed


class Places:
    """For one model."""

    def __init__(self, model: ConceptModel, config: TrackerConfig) -> None:
        self._config = config
        self._where, self._rest = Whereabouts(), Rest()
        self._pointer: Pointer | None = None
        self._there: Mask | None = None
        self.exchange(model)

    def exchange(self, model: ConceptModel) -> None:
        """For another one of the same object."""
        config, self._model = self._config, model
        self._proposals = Proposals(model, config.proposals, config.matching, config.torch_device)
        self._centre_m = model.points.mean(axis=0)

    def told(self, T_cam_obj: Pose) -> None:
        """Somebody says that it was there, in the last frame or since."""
        self._where.told(T_cam_obj)

    def point_out(self, there: Pointer) -> None:
        """Somebody will say so of the next frame."""
        self._pointer = there

    def forget(self) -> None:
        """Where it was."""
        self._where, self._rest = Whereabouts(), Rest()

    def looks(self, now: Moment, predicted: Pose | None, followed: bool, look: Looking) -> Iterator[Look | str]:
        """One after the other until it is found; or why nowhere. predicted: where it is if it moves on as it did, which
        is to be expected while it is followed."""
        mask = now.frame.masks.get(self._model.object_id)
        pointer, self._pointer = self._pointer, None
        self._there = self._proposals.pointed_out(pointer, now.frame) if mask is None and pointer else mask
        if mask is not None:
            yield from self._within(mask, predicted, now)
        elif self._there is not None:
            yield Look(self._there, None, told=True)
        elif self._config.masks != "carried":
            yield f"no mask of object {self._model.object_id!r} was given"
        elif self._where.known:
            yield from self._near(predicted if followed else None, now, look)
        elif (place_m := self._where.pointed_out_m(now.camera)) is not None:
            yield Look(now.unclaimed(self._proposals.around(place_m, now.frame)), None, place_m=place_m, told=True)
        else:
            yield "not seen yet"

    @property
    def pointed_out(self) -> bool:
        """Whether somebody said where it is in this frame."""
        return self._there is not None

    def anywhere(self, now: Moment, look: Looking) -> Asking[Found | str]:
        """The likeliest of what is found at the likeliest places of the whole picture; or why there is nothing."""
        picture = self._proposals.picture(now.frame, now.unclaimed(now.frame.depth_m > 0))
        if picture is None:
            return "no depth in the picture"
        saliency = yield picture
        if saliency is None:
            look.waiting = True
            return "its concepts are not known yet"
        with now.clock("proposals"):
            masks = self._proposals.masks(picture, saliency, self._config.cloud)
        place_m = self._where.pointed_out_m(now.camera)
        looks = [Look(now.unclaimed(mask), None, place_m=place_m) for mask in masks]
        return (yield from look.best(looks, now.frame, now.clock))

    def suspected(self, T_then_obj: Pose, then: Landmarks | None, camera: CameraMotion) -> None:
        """It has been seen in this frame or in an earlier one."""
        self._where.suspected(T_then_obj, then, camera)

    def found(self, refined: Refined, now: Moment) -> None:
        """In this frame."""
        self._where.found(refined.T_cam_obj, now.camera)
        # Of what only stood still nothing new is known, and without a prior nothing is held.
        if refined.aligned and self._config.prior:
            self._rest.found(refined, now.camera)

    def not_found(self, now: Moment, suspected: Pose | None = None) -> None:
        """suspected: T_cam_obj of what may be it, which the next frame has to confirm."""
        self._where.carry(now.camera, suspected)
        if self._there is not None:
            self._where.point_out(self._there, now.frame, now.camera)

    def _within(self, mask: Mask, predicted: Pose | None, now: Moment) -> Iterator[Look | str]:
        """Pixels that are known to be its own."""
        if not mask.any():
            yield "out of view: the mask is empty"
            return
        starts = [pose for pose in (predicted, self._where.suspect(now.camera)) if pose is not None]
        rest = self._resting(now)
        if not starts:
            yield Look(mask, None, masked=True, told=True, rest=rest)
        for k, start in enumerate(starts):
            contested = k < len(starts) - 1
            near = tuple(starts[: k + 1])
            yield Look(mask, start, near, masked=True, told=True, contested=contested, rest=rest)

    def _near(self, moving: Pose | None, now: Moment, look: Looking) -> Iterator[Look | str]:
        """Near each pose that is expected, of which there is one at least; where it is clearly at none, anywhere around
        the first. moving: where it is if it moves on as it did, unless it was suspected elsewhere."""
        suspect = self._where.suspect(now.camera)
        contested = moving is not None and suspect is not None and not self.same(moving, suspect)
        near: list[Pose] = []
        for pose in chain(() if moving is None else (moving,), self._where.expected(now.camera)):
            if any(self.same(pose, other) for other in near):
                continue
            near.append(pose)
            outline = look.outline(pose, now.frame, now.clock)
            if isinstance(outline, str):
                yield outline
            else:
                yield Look(outline, pose, tuple(near), contested=contested, rest=self._resting(now))
            contested = False
        around = self._proposals.around((near[0] @ self._centre_m[None])[0], now.frame, MOVED_ON)
        yield Look(now.unclaimed(around), None, tuple(near))

    def _resting(self, now: Moment) -> Callable[[Refined | None, Symmetry], Resting | None] | None:
        """Of a tracker that knows of earlier frames."""
        return partial(self._rest.now, now.camera) if self._config.prior else None

    def same(self, a: Pose, b: Pose) -> bool:
        """So near that they are looked at once."""
        return a.angle_to_rad(b) < SAME_RAD and a.distance_to_m(b) < SAME_SHARE * self._model.diameter_m
