"""Pictures of Orbbec's SDK -> frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from tracker.errors import FrameError, SourceError
from tracker.frame import Frame, Provenance
from tracker.geometry import Intrinsics
from tracker.sources.approximate_time import Pair
from tracker.sources.image_files import decode_image
from tracker.sources.lens import Lens
from tracker.sources.raw_depth import metres_per_unit
from tracker.sources.raw_frame import raw_to_frame

# the SDK's name of a format -> the order of `raw_frame.COLOUR_ORDERS`, bytes a pixel
ORDERS = {
    "RGB": ("rgb", 3),
    "BGR": ("bgr", 3),
    "RGBA": ("rgba", 4),
    "BGRA": ("bgra", 4),
    "YUYV": ("yuyv", 2),
    "UYVY": ("uyvy", 2),
    "Y8": ("gray", 1),
}
DEPTH_FORMATS = ("Y16", "Z16")
# the SDK's name of a distortion -> the name of `lens.MODELS`, and its coefficients in their order
DISTORTIONS = {
    "NONE": ("none", ""),
    "BROWN_CONRADY": ("brown_conrady", "k1 k2 p1 p2 k3"),
    "BROWN_CONRADY_K6": ("rational_polynomial", "k1 k2 p1 p2 k3 k4 k5 k6"),
    "MODIFIED_BROWN_CONRADY": ("modified_brown_conrady", "k1 k2 p1 p2 k3"),
    "INVERSE_BROWN_CONRADY": ("inverse_brown_conrady", "k1 k2 p1 p2 k3"),
    "KANNALA_BRANDT4": ("kannala_brandt4", "k1 k2 k3 k4"),
}


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A copy of what the SDK has, as its buffers are used again. kind: its format. model, camera: of colours, the name
    of the distortion, and fx, fy, cx, cy with its coefficients. scale: of depth."""

    data: npt.NDArray[np.uint8]
    kind: str
    width: int
    height: int
    model: str = "NONE"
    camera: tuple[float, ...] = ()
    scale: float = 0.0


def colour_of(frame: Any, where: str) -> Picture:
    """Raises SourceError, which begins with `where`, for a distortion that is not known."""
    profile = profile_of(frame)
    camera, bent = profile.get_intrinsic(), profile.get_distortion()
    model = bent.model.name
    if model not in DISTORTIONS:
        raise SourceError(f"{where}: distortion {model} is not known; known are {', '.join(DISTORTIONS)}")
    coefficients = [float(getattr(bent, field)) for field in DISTORTIONS[model][1].split()]
    told = (float(camera.fx), float(camera.fy), float(camera.cx), float(camera.cy), *coefficients)
    return Picture(_copied(frame), frame.get_format().name, frame.get_width(), frame.get_height(), model, told)


def depth_of(frame: Any) -> Picture:
    kind, scale = frame.get_format().name, float(frame.get_depth_scale())
    return Picture(_copied(frame), kind, frame.get_width(), frame.get_height(), scale=scale)


def profile_of(frame: Any) -> Any:
    """Of its stream: camera and rate."""
    return frame.get_stream_profile().as_video_stream_profile()


class Converter:
    """Makes frames of pairs. depth_unit_m: metres per unit whatever the camera says."""

    def __init__(self, name: str, depth_unit_m: float | None = None) -> None:
        self._name, self._unit_m = name, depth_unit_m
        self._lens: tuple[tuple[Any, ...], Lens] | None = None

    def __call__(self, pair: Pair[Picture], index: int) -> Frame:
        """Raises SourceError for pictures that cannot be read, FrameError as Frame does."""
        where = f"{self._name} {pair.first_ns}"
        pixels, order = _colours(pair.first, where)
        stored = _depths(pair.second, where)
        unit_m = metres_per_unit("orbbec", f"{where}: depth", pair.second.scale, override=self._unit_m)
        skew_ns = pair.first_ns - pair.second_ns
        provenance = Provenance(where, "camera", skew_ns, unit_m, str(pair.first_ns))
        return raw_to_frame(pixels, order, stored, self._lens_of(pair.first), pair.first_ns, index, provenance)

    def _lens_of(self, colour: Picture) -> Lens:
        told = (colour.width, colour.height, colour.model, colour.camera)
        if self._lens is None or self._lens[0] != told:
            where = f"{self._name}: colour camera"
            intrinsics = Intrinsics(*colour.camera[:4], width=colour.width, height=colour.height)
            try:
                intrinsics.check()
            except FrameError as error:
                raise SourceError(f"{where}: {error}") from error
            self._lens = told, Lens(intrinsics, DISTORTIONS[colour.model][0], colour.camera[4:], where)
        return self._lens[1]


def _colours(picture: Picture, where: str) -> tuple[npt.NDArray[np.uint8], str]:
    if picture.kind == "MJPG":
        flag = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
        return np.asarray(decode_image(picture.data.tobytes(), flag, f"{where}: colour"), np.uint8), "bgr"
    if picture.kind not in ORDERS:
        raise SourceError(f"{where}: colour in {picture.kind} is not read; MJPG, {', '.join(ORDERS)} are")
    order, channels = ORDERS[picture.kind]
    return _shaped(picture, channels, f"{where}: colour"), order


def _depths(picture: Picture, where: str) -> npt.NDArray[np.uint16]:
    if picture.kind not in DEPTH_FORMATS:
        raise SourceError(f"{where}: depth in {picture.kind} is not read; {', '.join(DEPTH_FORMATS)} are")
    return _shaped(picture, 2, f"{where}: depth").view(np.uint16)[:, :, 0]


def _shaped(picture: Picture, channels: int, where: str) -> npt.NDArray[np.uint8]:
    if picture.data.size != picture.height * picture.width * channels:
        told = f"{picture.width} x {picture.height} pixels of {channels} bytes"
        raise SourceError(f"{where}: {picture.data.size} bytes are not {told}")
    return picture.data.reshape(picture.height, picture.width, channels)


def _copied(frame: Any) -> npt.NDArray[np.uint8]:
    return np.array(frame.get_data(), np.uint8).ravel()
