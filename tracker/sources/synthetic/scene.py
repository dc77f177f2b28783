"""A synthetic recording: frames rendered when they are asked for, poses known from the motions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from tracker.frame import Frame, Provenance
from tracker.geometry import Intrinsics, Pose
from tracker.sources import Sighting, require_object
from tracker.sources.synthetic.motion import RATE_HZ
from tracker.sources.synthetic.rendering.picture import Rendering, render
from tracker.sources.synthetic.rendering.world import World
from tracker.sources.synthetic.request import Request
from tracker.sources.synthetic.scenes import SCENES
from tracker.sources.synthetic.sensor import developed, exposure, measured_depth_m
from tracker.sources.synthetic.things.objects import ObjectShape, shape_of
from tracker.sources.synthetic.visibility import VisibilityCounter

FOCAL_PX = 600.0  # at a width of 640
SHUTTER = 0.2  # share of the time between frames for which the shutter is open


class SyntheticScene:
    """Frames and poses of one scene. A frame depends on scene, seed, size, noise and index, on nothing else.

    Object frames: centre of the bounding box, z up as the object stands.
    """

    def __init__(self, name: str, request: Request) -> None:
        self.name = name
        self._request = request
        self._layout = SCENES[request.scene].build(request.seed, request.hero)
        scale = request.width / 640
        centre = (319.1 * scale, request.height / 2 - 0.5 + 2.3 * scale)
        self.intrinsics = Intrinsics(FOCAL_PX * scale, FOCAL_PX * scale, *centre, request.width, request.height)
        self._sightings: dict[str, list[Sighting]] = {}
        self._last: tuple[bytes, Rendering] | None = None

    def __len__(self) -> int:
        return self._request.frames

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        """Raises IndexError outside the recording."""
        if not 0 <= index < len(self):
            raise IndexError(f"{self.name} has frames 0 to {len(self) - 1}, not {index}")
        ideal = self._rendering(index)
        noise, seed = self._request.noise, self._request.seed
        rng = np.random.default_rng([seed, index])
        gains = exposure(seed, index, noise)
        frame = Frame(
            rgb=developed(ideal.radiance, gains, self._motion_px(index), noise, rng),
            depth_m=measured_depth_m(ideal, noise, rng),
            intrinsics=self.intrinsics,
            stamp_ns=round(index * 1e9 / RATE_HZ),
            masks={object_id: ideal.owner == number for number, object_id in enumerate(self.object_ids)},
            index=index,
            provenance=Provenance(self.name, "synthetic"),
        )
        return self._layout.fault(frame)

    def camera(self, index: int) -> Intrinsics:  # noqa: ARG002
        """The same in every frame."""
        return self.intrinsics

    @property
    def object_ids(self) -> tuple[str, ...]:
        return tuple(placed.thing.name for placed in self._layout.tracked)

    def sightings(self, object_id: str) -> Sequence[Sighting]:
        """Where the object is, in every frame, also where no pixel of it can be seen."""
        require_object(self, object_id)
        if object_id not in self._sightings:
            number = self.object_ids.index(object_id)
            self._sightings[object_id] = [self._sighting(number, index) for index in range(len(self))]
        return self._sightings[object_id]

    def shape(self, object_id: str) -> ObjectShape:
        require_object(self, object_id)
        return shape_of(object_id)

    def _sighting(self, number: int, index: int) -> Sighting:
        T_world_cam, T_cam_obj = self._camera_pose(index), self._object_pose(number, index)
        visible = self._counter.count(number, T_world_cam, T_cam_obj, index / RATE_HZ)
        return Sighting(index, T_cam_obj, visible.pixels, visible.fraction)

    @cached_property
    def _world(self) -> World:
        return World([*self._layout.tracked, *self._layout.surroundings])  # tracked first: their numbers are the masks'

    @cached_property
    def _counter(self) -> VisibilityCounter:
        return VisibilityCounter(self._world, self._layout.tracked, self.intrinsics)

    def _camera_pose(self, index: float) -> Pose:
        """T_world_cam."""
        pose = self._layout.T_world_cam
        return pose if isinstance(pose, Pose) else pose(index / RATE_HZ)

    def _object_pose(self, number: int, index: int) -> Pose:
        """T_cam_obj."""
        return self._camera_pose(index).inverse() @ self._layout.tracked[number].at(index / RATE_HZ)

    def _rendering(self, index: int) -> Rendering:
        """Where nothing moved since the last one, the last one."""
        time_s = index / RATE_HZ
        things = (*self._layout.tracked, *self._layout.surroundings)
        poses = [self._camera_pose(index), *(placed.at(time_s) for placed in things)]
        moment = np.stack([pose.matrix for pose in poses]).tobytes()
        if self._last is None or self._last[0] != moment:
            self._last = (moment, render(self._world, poses[0], self.intrinsics, time_s))
        return self._last[1]

    def _motion_px(self, index: int) -> tuple[float, float]:
        """By how much the moving camera shifts the picture of the first object while the shutter is open."""
        now, then = (self._camera_pose(i).inverse() for i in (index, index + SHUTTER))
        place = self._layout.tracked[0].at(index / RATE_HZ).translation_m[None]
        x, y = (self.intrinsics.project(then @ place) - self.intrinsics.project(now @ place))[0]
        return float(x), float(y)
