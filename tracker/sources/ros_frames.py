"""ROS messages of a camera -> frames: of a bag and of a running node alike."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any, NamedTuple

import numpy as np

from tracker.errors import FrameError, SourceError
from tracker.frame import Frame, Provenance
from tracker.geometry import Intrinsics
from tracker.sources.lens import Lens
from tracker.sources.raw_depth import metres_per_unit
from tracker.sources.raw_frame import raw_to_frame
from tracker.sources.ros_images import read_colour, read_depth, stamp_ns


class RosFrames:
    """Makes frames of pairs of messages, with the camera that was told of last before the picture.

    name: of the source. depth_unit_m: metres per unit whatever the encoding says, as drivers exist that break it.
    registered: the user says that the depth is registered to the colour, though its frame id is another.
    """

    def __init__(
        self,
        name: str,
        colour_topic: str,
        depth_topic: str,
        depth_unit_m: float | None = None,
        registered: bool = False,
    ) -> None:
        self._name, self._colour, self._depth = name, colour_topic, depth_topic
        self._unit_m, self._registered = depth_unit_m, registered
        self._rectified = is_rectified(colour_topic)
        self._cameras: list[tuple[int, _Camera, Lens]] = []

    @property
    def knows_camera(self) -> bool:
        return bool(self._cameras)

    def tell_camera(self, info: Any) -> None:
        """Of a CameraInfo. Raises SourceError where pictures cannot be read with it."""
        described = _described(info)
        if not self._cameras or self._cameras[-1][1] != described:  # it comes with every picture
            lens = lens_of(info, self._rectified, f"{self._name}: camera_info of {self._colour}")
            self._cameras.append((stamp_ns(info), described, lens))

    def frame(self, colour: Any, depth: Any, index: int) -> Frame:
        """Raises SourceError where a message cannot be read, the depth is not registered to the colour, or no camera
        was told; FrameError as Frame does."""
        at_ns = stamp_ns(colour)
        where = f"{self._name} {at_ns}"
        if not self._cameras:
            raise SourceError(f"{where}: no camera_info came that belongs to {self._colour}")
        pixels, order = read_colour(colour, f"{where}: {self._colour}")
        stored, encoding = read_depth(depth, f"{where}: {self._depth}")
        self._require_registered(where, colour, depth, (pixels.shape[:2], stored.shape))
        unit_m = metres_per_unit(encoding, f"{where}: {self._depth}", override=self._unit_m)
        skew_ns = at_ns - stamp_ns(depth)
        provenance = Provenance(where, "recording", skew_ns, unit_m, str(at_ns))
        return raw_to_frame(pixels, order, stored, self._lens(at_ns), at_ns, index, provenance)

    def _lens(self, at_ns: int) -> Lens:
        place = bisect_right([stamp for stamp, _, _ in self._cameras], at_ns)
        return self._cameras[max(place - 1, 0)][2]

    def _require_registered(
        self, where: str, colour: Any, depth: Any, shapes: tuple[tuple[int, ...], tuple[int, ...]]
    ) -> None:
        frames = [message.header.frame_id.lstrip("/") for message in (colour, depth)]
        if shapes[0] == shapes[1] and (self._registered or frames[0] == frames[1]):
            return
        told = [f"{width}x{height} in {frame!r}" for (height, width), frame in zip(shapes, frames, strict=True)]
        raise SourceError(
            f"{where}: the depth of {self._depth} ({told[1]}) is not registered to the colour of {self._colour} "
            f"({told[0]}); {WHAT_TO_RECORD}"
        )


WHAT_TO_RECORD = (
    "record a depth topic that is: /camera/aligned_depth_to_color/image_raw of a RealSense (align_depth.enable:=true), "
    "depth_registered or depth_to_rgb of others; where it is in truth, say registered=yes"
)


def is_rectified(topic: str) -> bool:
    """Whether the pictures of a topic have been undistorted, by the names that image_proc gives."""
    return any(part.startswith("image_rect") or part.endswith("_rect") for part in topic.split("/"))


def lens_of(info: Any, rectified: bool, where: str) -> Lens:
    """The camera of a CameraInfo: K with its distortion, of rectified pictures P without.

    Raises SourceError, which begins with `where`, where the pictures are only a part of the camera's or binned, where
    it is not calibrated, and for a distortion that is not known.
    """
    told = _described(info)
    if max(told.binning) > 1 or any(told.corner):
        raise SourceError(
            f"{where}: pictures that are binned ({told.binning[0]} x {told.binning[1]}) or cropped (from pixel "
            f"{told.corner}) are not read; the camera matrix is of whole ones"
        )
    matrix = np.reshape(told.P, (3, 4))[:, :3] if rectified else np.reshape(told.K, (3, 3))
    if not matrix.any():
        raise SourceError(f"{where}: {'P' if rectified else 'K'} is all zeros: the camera is not calibrated")
    try:
        camera = Intrinsics.from_matrix(matrix, told.width, told.height)
    except FrameError as error:
        raise SourceError(f"{where}: {error}") from error
    return Lens(camera) if rectified else Lens(camera, told.model or "none", told.D, where)


class _Camera(NamedTuple):
    """What pictures are read by, of a CameraInfo; corner: of the region that was read out, (x, y)."""

    width: int
    height: int
    model: str
    D: tuple[float, ...]
    K: tuple[float, ...]
    P: tuple[float, ...]
    binning: tuple[int, int]
    corner: tuple[int, int]


def _described(info: Any) -> _Camera:
    D, K, P = (info.D, info.K, info.P) if hasattr(info, "K") else (info.d, info.k, info.p)  # in capitals in ROS 1
    return _Camera(
        width=int(info.width),
        height=int(info.height),
        model=str(info.distortion_model),
        D=tuple(map(float, D)),
        K=tuple(map(float, K)),
        P=tuple(map(float, P)),
        binning=(int(info.binning_x), int(info.binning_y)),
        corner=(int(info.roi.x_offset), int(info.roi.y_offset)),
    )
