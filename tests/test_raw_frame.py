"""From what cameras hand over to a frame: colours in RGB, depth in metres, no memory shared, damage named."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from tracker.errors import FrameError, SourceError
from tracker.frame import Frame, Provenance
from tracker.geometry import Intrinsics
from tracker.sources.lens import Lens
from tracker.sources.raw_frame import COLOUR_ORDERS, raw_to_frame

CAMERA = Intrinsics(60.0, 61.0, 23.5, 17.0, 48, 36)
RGB = np.broadcast_to(np.array([200, 90, 30], np.uint8), (36, 48, 3)).copy()
FROM_CAM_7 = Provenance("cam 7", "hardware", 2_000_000, 0.001)


def made(**changes: Any) -> Frame:
    parts: dict[str, Any] = {
        "colour": RGB,
        "order": "rgb",
        "raw_depth": np.full((36, 48), 750, np.uint16),
        "lens": Lens(CAMERA),
        "stamp_ns": 5,
        "index": 3,
        "provenance": FROM_CAM_7,
    }
    return raw_to_frame(**(parts | changes))


def test_everything_that_is_known_is_in_the_frame() -> None:
    mask = np.ones((36, 48), bool)
    frame = made(masks={"mug": mask})
    assert np.array_equal(frame.rgb, RGB)
    assert frame.depth_m == pytest.approx(0.75)
    assert (frame.stamp_ns, frame.index, frame.intrinsics, frame.provenance) == (5, 3, CAMERA, FROM_CAM_7)
    assert frame.masks["mug"] is mask


def test_buffers_that_are_used_again_change_nothing() -> None:
    colour, raw_depth = RGB.copy(), np.full((36, 48), 0.75, np.float32)
    frame = made(colour=colour, raw_depth=raw_depth, provenance=Provenance("cam 7", raw_depth_unit_m=1.0))
    colour[:], raw_depth[:] = 0, 0
    assert np.array_equal(frame.rgb, RGB)
    assert (frame.depth_m == np.float32(0.75)).all()


@pytest.mark.parametrize("order", COLOUR_ORDERS)
def test_colours_are_rgb_whatever_their_order(order: str) -> None:
    opaque = np.full((36, 48, 1), 255, np.uint8)
    yuv = cv2.cvtColor(RGB, cv2.COLOR_RGB2YUV)[:, :, :]
    if order in ("yuyv", "uyvy"):  # two pixels share a colour: of all the same, any two do
        y, u, v = (int(np.round(c)) for c in _bt601(RGB[0, 0]))
        pair = np.array([[[y, u], [y, v]]] if order == "yuyv" else [[[u, y], [v, y]]], np.uint8)
        colour = np.tile(pair, (36, 24, 1))
    else:
        colour = {
            "rgb": RGB,
            "bgr": RGB[:, :, ::-1],
            "rgba": np.dstack((RGB, opaque)),
            "bgra": np.dstack((RGB[:, :, ::-1], opaque)),
            "gray": yuv[:, :, 0],
        }[order]
    expected = np.repeat(yuv[:, :, :1], 3, axis=2) if order == "gray" else RGB
    assert np.abs(made(colour=colour, order=order).rgb.astype(int) - expected).max() <= 3
    if order == "gray":
        assert np.array_equal(made(colour=colour[:, :, None], order=order).rgb, expected)


def _bt601(rgb: np.ndarray) -> np.ndarray:
    """Y, U and V as cameras store them: 16 .. 235 (ITU-R BT.601)."""
    weights = np.array([[65.738, 129.057, 25.064], [-37.945, -74.494, 112.439], [112.439, -94.154, -18.285]])
    return weights @ rgb / 256 + [16, 128, 128]


def test_colour_and_depth_go_through_the_same_lens() -> None:
    colour, raw_depth = np.zeros_like(RGB), np.zeros((36, 48), np.uint16)
    colour[:, 40:44], raw_depth[:, 40:44] = 255, 750
    frame = made(colour=colour, raw_depth=raw_depth, lens=Lens(CAMERA, "plumb_bob", [-0.3, 0.1, 0, 0, 0]))
    middle = frame.rgb[17, :, 0] > 127
    assert np.array_equal(middle, frame.depth_m[17] > 0)
    assert not np.array_equal(middle, colour[17, :, 0] > 0)


@pytest.mark.parametrize(
    ("changes", "error", "complaint"),
    [
        ({"order": "hsv"}, SourceError, "cam 7: colours 'hsv' are not known; expected one of rgb, bgr"),
        ({"order": "gray"}, SourceError, r"cam 7: a gray picture is uint8 \(H, W\), got uint8 \(36, 48, 3\)"),
        ({"order": "bgra"}, SourceError, r"cam 7: a bgra picture is uint8 \(H, W, 4\), got uint8 \(36, 48, 3\)"),
        ({"colour": RGB.astype(np.uint16)}, SourceError, "cam 7: a rgb picture is uint8"),
        ({"colour": RGB[:18]}, FrameError, r"cam 7: rgb has shape \(18, 48, 3\), expected \(36, 48, 3\)"),
        ({"raw_depth": np.ones((18, 48), np.uint16)}, FrameError, "cam 7: depth_m has shape"),
        ({"raw_depth": np.ones((36, 48))}, SourceError, "cam 7: a depth picture has one channel"),
        ({"provenance": Provenance("cam 7")}, SourceError, "cam 7: the depth scale must be positive, got 0"),
        ({"provenance": Provenance("cam 7", raw_depth_unit_m=1.0)}, FrameError, "looks like millimetres"),
    ],
)
@pytest.mark.parametrize("lens", [Lens(CAMERA), Lens(CAMERA, "plumb_bob", [-0.3, 0.1, 0, 0, 0])])
def test_what_cannot_be_right_is_named_by_its_source(
    lens: Lens, changes: dict[str, Any], error: type[Exception], complaint: str
) -> None:
    with pytest.raises(error, match=complaint):
        made(lens=lens, **changes)
