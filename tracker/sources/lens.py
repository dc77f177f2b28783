"""The lens of a camera: pictures as a pinhole camera with the same matrix would have taken them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import cv2
import numpy as np
import numpy.typing as npt

from tracker.errors import SourceError
from tracker.geometry import Floats, Intrinsics

Maps = tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]


def _polynomial(camera: Intrinsics, coefficients: Floats) -> Maps:
    K, size = camera.matrix, (camera.width, camera.height)
    return _as_maps(cv2.initUndistortRectifyMap(K, coefficients, np.eye(3), K, size, cv2.CV_32FC1))


def _fisheye(camera: Intrinsics, coefficients: Floats) -> Maps:
    K, size = camera.matrix, (camera.width, camera.height)
    return _as_maps(cv2.fisheye.initUndistortRectifyMap(K, coefficients[:4], np.eye(3), K, size, cv2.CV_32FC1))


def _radial_first(camera: Intrinsics, coefficients: Floats) -> Maps:
    """librealsense's own: the tangential part is of the point that the radial part has moved already (rsutil.h)."""
    k1, k2, p1, p2, k3 = coefficients
    rows, columns = np.indices((camera.height, camera.width))
    x, y = (columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy
    squared = x * x + y * y
    factor = 1 + squared * (k1 + squared * (k2 + squared * k3))
    x, y = x * factor, y * factor
    moved_x = x + 2 * p1 * x * y + p2 * (squared + 2 * x * x)
    moved_y = y + 2 * p2 * x * y + p1 * (squared + 2 * y * y)
    return _as_maps((moved_x * camera.fx + camera.cx, moved_y * camera.fy + camera.cy))


def _as_maps(maps: Sequence[npt.NDArray]) -> Maps:
    return maps[0].astype(np.float32), maps[1].astype(np.float32)


# name -> how many coefficients it may have (more of them only if they are 0), and where a pixel is in the picture
MODELS: Mapping[str, tuple[tuple[int, ...], Callable[[Intrinsics, Floats], Maps]]] = {
    "brown_conrady": ((4, 5, 8, 12, 14), _polynomial),  # OpenCV's order: k1 k2 p1 p2 k3 k4 ..
    "plumb_bob": ((4, 5), _polynomial),
    "rational_polynomial": ((8, 12, 14), _polynomial),
    "modified_brown_conrady": ((5,), _radial_first),
    "inverse_brown_conrady": ((5,), _radial_first),  # librealsense projects both alike
    "kannala_brandt4": ((4, 5), _fisheye),
    "equidistant": ((4,), _fisheye),
    "fisheye": ((4,), _fisheye),
}
PINHOLE_AT_ZERO = {"none", *(name for name, (_, maps) in MODELS.items() if maps is not _fisheye)}


class Lens:
    """A camera with its distortion; made once, as what it has computed is used for every picture.

    model: one of MODELS, or "none". coefficients: in the order of OpenCV, which is that of ROS and of librealsense too.
    Raises SourceError, which begins with `where`, for a model that is not known or does not have so many coefficients:
    distortion is never ignored.
    """

    def __init__(
        self, intrinsics: Intrinsics, model: str = "none", coefficients: Sequence[float] = (), where: str = "camera"
    ) -> None:
        self.intrinsics = intrinsics
        self._maps: Maps | None = None
        values = np.asarray(coefficients, float).ravel()
        if not np.isfinite(values).all():
            raise SourceError(f"{where}: the distortion coefficients are not finite: {values.tolist()}")
        if not values.any() and model in PINHOLE_AT_ZERO:
            return
        if model not in MODELS:
            raise SourceError(
                f"{where}: pictures with distortion {model!r} {values.tolist()} cannot be undistorted; "
                f"known are none, {', '.join(MODELS)}"
            )
        counts, make_maps = MODELS[model]
        if len(values) not in counts:
            raise SourceError(f"{where}: distortion {model!r} has {counts} coefficients, got {len(values)}")
        self._maps = make_maps(intrinsics, values)

    def undistort(
        self, rgb: npt.NDArray[np.uint8], depth_m: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
        """Colour and the depth that is registered to it; black and 0 where the picture does not reach.

        Depth is not interpolated: between two surfaces there is none.
        """
        size = (self.intrinsics.height, self.intrinsics.width)
        if self._maps is None or rgb.shape[:2] != size or depth_m.shape != size:
            return rgb, depth_m  # a picture of another size is refused by the frame, in its words
        return (
            np.asarray(cv2.remap(rgb, *self._maps, cv2.INTER_LINEAR), np.uint8),
            np.asarray(cv2.remap(depth_m, *self._maps, cv2.INTER_NEAREST), np.float32),
        )
