"""The reference frames of a model, as far as they show the object: kept so that more can be asked of them later."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from tracker.errors import TrackerError
from tracker.frame import Frame, PosedFrame, Provenance
from tracker.geometry import MOST_PIXELS, Intrinsics, Pose
from tracker.sources.json_files import DAMAGE
from tracker.view import Box, bounding_box

PARTS = ("rgb", "depth", "mask")
MOST_VIEWED = 8 * MOST_PIXELS  # of all views together, as whole pictures
DEPTH_STEPS = 65535  # depth is kept in so many steps up to its greatest value: finer than any sensor's


def packed(views: Sequence[PosedFrame]) -> tuple[dict[str, npt.NDArray], list[dict[str, Any]]]:
    """Arrays and JSON-ready headers of the pixels within each mask's box."""
    arrays, headers = {}, []
    for k, view in enumerate(views):
        box = bounding_box(view.mask) or Box(0, 0, 1, 1)
        frame, place = view.frame, (slice(box.y0, box.y1), slice(box.x0, box.x1))
        unit_m = max(float(frame.depth_m[place].max()), 1e-6) / DEPTH_STEPS
        arrays[f"view{k}.rgb"] = np.ascontiguousarray(frame.rgb[place])
        arrays[f"view{k}.depth"] = np.rint(frame.depth_m[place] / unit_m).astype(np.uint16)
        arrays[f"view{k}.mask"] = view.mask[place].astype(np.uint8)
        camera = frame.intrinsics
        headers.append(
            {
                "x": box.x0,
                "y": box.y0,
                "camera": [camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height],
                "depth_unit_m": unit_m,
                "T_cam_obj": view.T_cam_obj.matrix.tolist(),
                "source": frame.provenance.source,
                "index": frame.index,
            }
        )
    return arrays, headers


def unpacked(arrays: Mapping[str, npt.NDArray], headers: Sequence[Any], object_id: str) -> tuple[PosedFrame, ...]:
    """The frames again, empty outside the box. Raises ValueError where arrays and headers do not fit together."""
    total = sum(_pixels(header) for header in headers)
    if not total <= MOST_VIEWED:  # a file holds the boxes alone, and may claim what it likes of the rest
        raise ValueError(
            f"damaged: {len(headers)} reference views of {total} pixels together, expected at most {MOST_VIEWED}"
        )
    return tuple(
        _unpacked([arrays[f"view{k}.{part}"] for part in PARTS], header, object_id) for k, header in enumerate(headers)
    )


def _pixels(header: Any) -> float:
    try:
        width, height = (float(v) for v in header["camera"][4:6])
    except DAMAGE as error:
        raise ValueError(f"a reference view is damaged: {error!r}") from error
    return abs(width * height)


def _unpacked(parts: list[npt.NDArray], header: Any, object_id: str) -> PosedFrame:
    try:
        fx, fy, cx, cy, width, height = (float(v) for v in header["camera"])
        camera = Intrinsics(fx, fy, cx, cy, int(width), int(height))
        camera.check()
        size = (camera.height, camera.width)
        place = np.s_[header["y"] : header["y"] + len(parts[0]), header["x"] : header["x"] + parts[0].shape[1]]
        rgb, depth_m, mask = np.zeros((*size, 3), np.uint8), np.zeros(size, np.float32), np.zeros(size, bool)
        rgb[place], mask[place] = parts[0], parts[2]
        depth_m[place] = parts[1] * np.float32(header["depth_unit_m"])
        provenance = Provenance(str(header["source"]), raw_depth_unit_m=header["depth_unit_m"])
        frame = Frame(rgb, depth_m, camera, 0, {object_id: mask}, int(header["index"]), provenance)
        T_cam_obj = np.array(header["T_cam_obj"], np.float64)
        Pose.from_matrix(T_cam_obj)  # refuses what is none; what it returns is rounded anew, and a saved pose stays
        return PosedFrame(frame, object_id, Pose(T_cam_obj[:3, :3], T_cam_obj[:3, 3]), mask)
    except (*DAMAGE, TrackerError) as error:
        raise ValueError(f"a reference view is damaged: {error}") from error
