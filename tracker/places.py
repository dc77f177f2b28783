"""Where one object may be in a frame: by a mask, by somebody who points, by where it was, or anywhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

from tracker.camera_motion import CameraMotion
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame, Mask
from tracker.geometry import Pose
from tracker.looking import Asking, Look, Looking
from tracker.pointing import Pointer
from tracker.proposals import Proposals
from tracker.stopwatch import Stopwatch
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
        self._model, self._config = model, config
        self._proposals = Proposals(model, config.proposals, config.matching, config.torch_device)
        self._centre_m = model.points.mean(axis=0)
        self._where = Whereabouts()
        self._pointer: Pointer | None = None
        self._there: Mask | None = None

    def told(self, T_cam_obj: Pose) -> None:
        """Somebody says that it was there, in the last frame or since."""
        self._where.told(T_cam_obj)

    def point_out(self, there: Pointer) -> None:
        """Somebody will say so of the next frame."""
        self._pointer = there

    def forget(self) -> None:
        """Where it was."""
        self._where = Whereabouts()

    def looks(self, now: Moment, predicted: Pose | None, followed: bool, look: Looking) -> Iterator[Look | str]:
        """One after the other until it is found; or why nowhere. predicted: where it is if it moves on as it did, which
        is to be expected while it is followed."""
        mask = now.frame.masks.get(self._model.object_id)
        pointer, self._pointer = self._pointer, None
        self._there = self._proposals.pointed_out(pointer, now.frame) if mask is None and pointer else mask
        if mask is not None:
            expected = () if predicted is None else (predicted,)
            yield Look(mask, predicted, expected, masked=True) if mask.any() else "out of view: the mask is empty"
        elif self._there is not None:
            yield Look(self._there, None)
        elif self._config.masks != "carried":
            yield f"no mask of object {self._model.object_id!r} was given"
        elif self._where.known:
            moving = (predicted,) if predicted is not None and followed else ()
            yield from self._near(chain(moving, self._where.expected(now.camera)), now, look)
        elif (place_m := self._where.pointed_out_m(now.camera)) is not None:
            yield Look(now.unclaimed(self._proposals.around(place_m, now.frame)), None)
        else:
            yield "not seen yet"

    def anywhere(self, now: Moment) -> Asking[list[Look] | str]:
        """The likeliest places of the whole picture; or why there are none."""
        if self._there is not None:
            return "it was pointed out elsewhere"
        picture = self._proposals.picture(now.frame, now.unclaimed(now.frame.depth_m > 0))
        if picture is None:
            return "no depth in the picture"
        saliency = yield picture
        with now.clock("proposals"):
            masks = self._proposals.masks(picture, saliency, self._config.cloud)
        return [Look(now.unclaimed(mask), None) for mask in masks]

    def found(self, T_cam_obj: Pose, now: Moment) -> None:
        self._where.found(T_cam_obj, now.camera)

    def not_found(self, now: Moment, suspected: Pose | None = None) -> None:
        """suspected: T_cam_obj of what may be it, which the next frame has to confirm."""
        self._where.carry(now.camera, suspected)
        if self._there is not None:
            self._where.point_out(self._there, now.frame, now.camera)

    def _near(self, expected: Iterable[Pose], now: Moment, look: Looking) -> Iterator[Look | str]:
        """Near each pose, of which there is one at least; where it is clearly at none, anywhere around the first."""
        near: list[Pose] = []
        for pose in expected:
            if not any(self._same(pose, other) for other in near):
                near.append(pose)
                outline = look.outline(pose, now.frame, now.clock)
                yield outline if isinstance(outline, str) else Look(outline, pose, tuple(near))
        around = self._proposals.around((near[0] @ self._centre_m[None])[0], now.frame, MOVED_ON)
        yield Look(now.unclaimed(around), None, tuple(near))

    def _same(self, a: Pose, b: Pose) -> bool:
        return a.angle_to_rad(b) < SAME_RAD and a.distance_to_m(b) < SAME_SHARE * self._model.diameter_m
