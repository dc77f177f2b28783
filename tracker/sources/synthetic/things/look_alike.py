"""Things that are easily taken for another one."""

from __future__ import annotations

import cv2
import numpy as np

from tracker.sources.synthetic.things.thing import Thing

HUE_BAND = 24  # of 256 around the circle: hues this near are of one colour
CHANGED_SHARE = 0.5  # of what has a hue, at least
LEAST_SATURATION, LEAST_VALUE = 60, 40  # under which a colour has no hue


def look_alike(thing: Thing, turn_deg: float) -> Thing:
    """The same shape with another print: its commonest colours, so many that half of what has a colour is changed, have
    hues `turn_deg` further on; the rest, and all that is black, white or gray, stays."""
    hsv = cv2.cvtColor(np.ascontiguousarray(thing.texture[..., :3]), cv2.COLOR_RGB2HSV_FULL).astype(np.int64)
    hue, coloured = hsv[..., 0], (hsv[..., 1] > LEAST_SATURATION) & (hsv[..., 2] > LEAST_VALUE)
    changed = np.zeros_like(coloured)
    while changed.sum() < CHANGED_SHARE * coloured.sum():
        counts = np.bincount(hue[coloured & ~changed], minlength=256)
        common = np.argmax(sum(np.roll(counts, shift) for shift in range(-HUE_BAND, HUE_BAND + 1)))
        changed |= coloured & (np.abs((hue - common + 128) % 256 - 128) <= HUE_BAND)
    hsv[..., 0] = (hue + round(turn_deg / 360 * 256)) % 256
    texture = thing.texture.copy()
    texture[changed, :3] = cv2.cvtColor(hsv.astype(np.uint8), cv2.COLOR_HSV2RGB_FULL)[changed]
    return Thing(f"{thing.name} look-alike", thing.mesh, texture, thing.symmetric)
