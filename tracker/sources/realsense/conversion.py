"""What the SDK hands over -> frames: depth filtered, registered to the colour, in metres."""

from __future__ import annotations

from typing import Any

import numpy as np

from tracker.errors import FrameError, SourceError
from tracker.frame import Frame, Provenance
from tracker.geometry import Intrinsics
from tracker.sources.lens import PINHOLE_AT_ZERO, Lens
from tracker.sources.pairing import Pair, Shot
from tracker.sources.raw_depth import metres_per_unit
from tracker.sources.raw_frame import raw_to_frame
from tracker.sources.realsense.devices import COLOUR_FORMATS, Profile, Streams
from tracker.sources.realsense.request import Options

WAIT_MS = 5_000  # for a filter of the SDK, which answers in milliseconds


def shot_of(frame: Any) -> Shot:
    """A frame of the SDK with its stamp (milliseconds there) and the clock that this is of."""
    return Shot(round(frame.get_timestamp() * 1e6), frame.get_frame_timestamp_domain().name, frame)


class Converter:
    """Frames of one pair of streams. Raises SourceError or FrameError where the camera is none that can be used."""

    def __init__(self, sdk: Any, streams: Streams, options: Options, name: str) -> None:
        self._sdk, self._name, self._options = sdk, name, options
        self._stated_unit_m, self._last_unit_m = streams.depth_unit_m, 0.0
        self._order = COLOUR_FORMATS[streams.colour.format().name]
        camera = streams.colour.get_intrinsics()
        intrinsics = Intrinsics(camera.fx, camera.fy, camera.ppx, camera.ppy, camera.width, camera.height)
        try:
            intrinsics.check()
        except FrameError as error:
            raise FrameError(f"{name}: the colour camera: {error}") from error
        self._lens = Lens(intrinsics, camera.model.name, camera.coeffs, f"{name}: the colour camera")
        kinds = {"spatial": sdk.spatial_filter, "temporal": sdk.temporal_filter, "hole": sdk.hole_filling_filter}
        self._filters = [kinds[kind]() for kind in options.filters]
        # The SDK's registration widens what it moves by up to a pixel, so what is registered already is left alone.
        self._align = None if _are_registered(streams.depth, streams.colour, name) else _Alignment(sdk)

    def __call__(self, pair: Pair, index: int) -> Frame:
        """Raises SourceError and FrameError as `raw_to_frame` does. Without depth the picture of it is empty."""
        colour = pair.colour.picture
        where = f"{self._name} frame {index}"
        if pair.depth is None:
            raw_depth = np.zeros((self._lens.intrinsics.height, self._lens.intrinsics.width), np.uint16)
        else:
            self._last_unit_m = self._unit_m(pair.depth.picture, where)
            try:
                raw_depth = np.asanyarray(self._registered(pair.depth.picture, colour).get_data())
            except RuntimeError as error:
                raise FrameError(f"{where}: its depth cannot be registered to the colour ({error})") from error
        provenance = Provenance(where, pair.colour.clock, pair.skew_ns, self._last_unit_m)
        picture = np.asanyarray(colour.get_data())
        if self._order in ("yuyv", "uyvy") and picture.dtype == np.uint16:
            picture = picture.view(np.uint8).reshape(*picture.shape, 2)
        return raw_to_frame(picture, self._order, raw_depth, self._lens, pair.colour.stamp_ns, index, provenance)

    def _unit_m(self, depth: Any, where: str) -> float:
        of_frame = float(depth.as_depth_frame().get_units())
        stated = of_frame if of_frame > 0 else self._stated_unit_m
        return metres_per_unit("realsense", where, stated, override=self._options.depth_unit_m)

    def _registered(self, depth: Any, colour: Any) -> Any:
        for smooth in self._filters:
            depth = smooth.process(depth)
        return depth if self._align is None else self._align(depth, colour)


class _Alignment:
    """The SDK registers depth to colour in sets of frames only: one is made of the two."""

    def __init__(self, sdk: Any) -> None:
        self._align = sdk.align(sdk.stream.color)
        self._set = sdk.frame_queue(1)
        self._joining: list[Any] = []

        def join(_: Any, source: Any) -> None:
            source.frame_ready(source.allocate_composite_frame(self._joining))

        self._join = sdk.processing_block(join)
        self._join.start(self._set)

    def __call__(self, depth: Any, colour: Any) -> Any:
        self._joining = [depth, colour]
        self._join.invoke(depth)
        joined = self._set.wait_for_frame(WAIT_MS).as_frameset()
        self._joining = []
        return self._align.process(joined).get_depth_frame()


def _are_registered(depth: Profile, colour: Profile, name: str) -> bool:
    """Raises SourceError where nobody knows how the two cameras stand to each other."""
    one, other = depth.get_intrinsics(), colour.get_intrinsics()
    keys = ("width", "height", "fx", "fy", "ppx", "ppy")
    same_camera = all(getattr(one, key) == getattr(other, key) for key in keys)
    straight = all(not any(lens.coeffs) and lens.model.name in PINHOLE_AT_ZERO for lens in (one, other))
    same_lens = straight or (one.model == other.model and list(one.coeffs) == list(other.coeffs))
    try:
        between = depth.get_extrinsics_to(colour)
    except RuntimeError as error:
        raise SourceError(
            f"{name}: where depth and colour camera stand to each other is not known ({error})"
        ) from error
    same_place = np.array_equal(between.rotation, np.eye(3).ravel()) and not np.any(between.translation)
    return same_camera and same_lens and bool(same_place)
