"""What goes wrong with a frame after a camera has taken it, as functions of frames of any source."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tracker.frame import Frame
from tracker.geometry import Floats

GAMMA = 2.2  # of the pictures, near enough to sRGB's


def without_depth(frame: Frame) -> Frame:
    """The frame of a depth sensor that answers nothing, while colour goes on."""
    return replace(frame, depth_m=np.zeros_like(frame.depth_m))


def relit(frame: Frame, gains: Floats) -> Frame:
    """The frame in another light. gains: (3,) factors of linear red, green and blue; what gets too bright is white."""
    light = (np.arange(256)[:, None] / 255) ** GAMMA * np.asarray(gains, float)
    tones = np.rint(255 * light.clip(0, 1) ** (1 / GAMMA)).astype(np.uint8)
    rgb: npt.NDArray[np.uint8] = np.stack([tones[frame.rgb[..., c], c] for c in range(3)], axis=-1)
    return replace(frame, rgb=rgb)
