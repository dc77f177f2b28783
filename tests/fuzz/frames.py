"""Faults of frames: what a broken camera, driver or segmenter hands over."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from tests.fuzz.damage import Rng
from tracker.frame import Frame
from tracker.geometry import Intrinsics

Parts = dict[str, Any]
Fault = Callable[[Parts, Rng], None]

NUMBERS = (np.nan, np.inf, -np.inf, -1.0, 0.0, 1e-6, 1e-3, 65.535, 1e3, 1e30)


def parts_of(frame: Frame) -> Parts:
    """What a frame is made of, to be changed; `Frame(**parts)` makes it again."""
    return {
        "rgb": frame.rgb.copy(),
        "depth_m": frame.depth_m.copy(),
        "intrinsics": frame.intrinsics,
        "stamp_ns": frame.stamp_ns,
        "masks": {name: mask.copy() for name, mask in frame.masks.items()},
        "index": frame.index,
    }


def _some_pixels(parts: Parts, rng: Rng) -> Any:
    """All, a share, a box, or stripes."""
    shape = parts["depth_m"].shape
    what = rng.integers(4)
    if what == 0:
        return np.ones(shape, bool)
    if what == 1:
        return rng.random(shape) < rng.random()
    there = np.zeros(shape, bool)
    if what == 2:
        y, x = rng.integers(shape[0]), rng.integers(shape[1])
        there[y : y + rng.integers(1, shape[0]), x : x + rng.integers(1, shape[1])] = True
    else:
        there[:: rng.integers(2, 5)] = True
    return there


def depth_of_one_value(parts: Parts, rng: Rng) -> None:
    parts["depth_m"][_some_pixels(parts, rng)] = NUMBERS[rng.integers(len(NUMBERS))]


def depth_of_noise(parts: Parts, rng: Rng) -> None:
    there = _some_pixels(parts, rng)
    parts["depth_m"][there] += rng.normal(0, 10 ** rng.uniform(-3, 1), int(there.sum())).astype(np.float32)
    if rng.random() < 0.8:
        parts["depth_m"].clip(0, None, out=parts["depth_m"])


def depth_of_other_units(parts: Parts, rng: Rng) -> None:
    parts["depth_m"] = (parts["depth_m"] * rng.choice((1000, 0.001, 10, 0.1, 5, 39.37, 3.28))).astype(np.float32)


def colours_of_one_value(parts: Parts, rng: Rng) -> None:
    parts["rgb"][_some_pixels(parts, rng)] = rng.choice((0, 255, 128))


def colours_of_noise(parts: Parts, rng: Rng) -> None:
    there = _some_pixels(parts, rng)
    parts["rgb"][there] = rng.integers(0, 256, (int(there.sum()), 3), np.uint8)


def other_type_or_shape(parts: Parts, rng: Rng) -> None:
    name = ("rgb", "depth_m")[rng.integers(2)]
    array = parts[name]
    others = (
        array[::2, ::2], array[:-1], array.swapaxes(0, 1), array.astype(np.float64), array.astype(np.uint16),
        array[..., None],
        array.ravel(), None, array.tolist(), array[:0], array[:, :0], array.view(np.ndarray)[::-1],
        np.asfortranarray(array),
    )  # fmt: skip
    parts[name] = others[rng.integers(len(others))]


def other_size(parts: Parts, rng: Rng) -> None:
    """Everything, as of a camera that changed its resolution; its matrix goes along, or does not."""
    scale = rng.choice((0.1, 0.5, 0.73, 1.5))
    height, width = (max(1, round(side * scale)) for side in parts["depth_m"].shape)
    for name in ("rgb", "depth_m"):
        parts[name] = cv2.resize(parts[name], (width, height), interpolation=cv2.INTER_NEAREST)
    for name, mask in parts["masks"].items():
        parts["masks"][name] = cv2.resize(mask.astype(np.uint8), (width, height)) > 0
    k = parts["intrinsics"]
    scale = scale if rng.random() < 0.7 else 1
    parts["intrinsics"] = Intrinsics(k.fx * scale, k.fy * scale, k.cx * scale, k.cy * scale, width, height)


def other_camera(parts: Parts, rng: Rng) -> None:
    numbers = list(vars_of(parts["intrinsics"]))
    k = int(rng.integers(6))
    other = NUMBERS[rng.integers(len(NUMBERS))] if k < 4 and rng.random() < 0.5 else numbers[k] * rng.uniform(0.3, 3)
    numbers[k] = float(other) if k < 4 else int(other)
    parts["intrinsics"] = Intrinsics(*numbers)


def vars_of(camera: Intrinsics) -> tuple[Any, ...]:
    return camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height


def other_time(parts: Parts, rng: Rng) -> None:
    now = parts["stamp_ns"]
    times = (0, -1, now - 33_000_000, now - 1, now + 1, now + 10**9, now + 10**15, float(now), np.int64(1), None)
    parts["stamp_ns"] = times[rng.integers(len(times))]


def masks_of_nonsense(parts: Parts, rng: Rng) -> None:
    shape = parts["depth_m"].shape
    nonsense = (
        np.zeros(shape, bool), np.ones(shape, bool), rng.random(shape) < 0.5, rng.random(shape) < 0.01,
        np.eye(*shape, dtype=bool),
        np.zeros((3, 3), bool), np.ones(shape, np.uint8), None, _some_pixels(parts, rng), _some_pixels(parts, rng),
    )  # fmt: skip
    for name in (*parts["masks"], "nobody"):
        parts["masks"][name] = nonsense[rng.integers(len(nonsense))]
    if rng.random() < 0.2:
        parts["masks"] = {}


# In the order in which they can be had together.
FAULTS: tuple[Fault, ...] = (
    depth_of_one_value, depth_of_noise, depth_of_other_units, colours_of_one_value, colours_of_noise, other_size,
    masks_of_nonsense, other_camera, other_time, other_type_or_shape,
)  # fmt: skip
