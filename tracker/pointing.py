"""Somebody points at an object in a picture: with a box around it, or by a click on it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from tracker.errors import ConfigError
from tracker.frame import Frame, Mask
from tracker.geometry import Floats
from tracker.view import Box

REACH_PX = 4  # around a click: depth has holes, and a hand shakes


class Click(NamedTuple):
    """A pixel of a frame that shows the object."""

    column: int
    row: int


Pointer = Box | Click


def parse_pointer(text: str) -> Pointer:
    """ "X,Y" -> a click, "X0,Y0,X1,Y1" -> a box. Raises ConfigError for anything else."""
    try:
        numbers = [int(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) == 2:
        return Click(*numbers)
    if len(numbers) == 4 and numbers[0] < numbers[2] and numbers[1] < numbers[3]:
        return Box(*numbers)
    raise ConfigError(f"{text!r} points nowhere; expected a pixel X,Y or a box X0,Y0,X1,Y1, whole numbers")


def parse_pointers(texts: Iterable[str], object_ids: Sequence[str]) -> dict[str, Pointer]:
    """ "NAME=POINTER", or "POINTER" alone where there is one object -> by object. Raises ConfigError where it is not
    clear which object is meant, or where it is."""
    pointers = {}
    for text in texts:
        name, separator, there = text.rpartition("=")
        if not separator and len(object_ids) > 1:
            raise ConfigError(f"{text}: of which object? Write NAME={text}, NAME one of {', '.join(object_ids)}")
        pointers[name if separator else object_ids[0]] = parse_pointer(there)
    return pointers


def around(click: Click) -> Box:
    """The pixels that a click stands for."""
    column, row = click
    return Box(column - REACH_PX, row - REACH_PX, column + REACH_PX + 1, row + REACH_PX + 1)


def inside(box: Box, shape: tuple[int, ...]) -> Mask:
    """(H, W) bool, the pixels of a picture of this shape that are in the box."""
    mask = np.zeros(shape, bool)
    mask[max(box.y0, 0) : max(box.y1, 0), max(box.x0, 0) : max(box.x1, 0)] = True
    return mask


def measured_in(box: Box, frame: Frame) -> Mask:
    """(H, W) bool, the pixels of the box that have depth. What lies behind the object is among them."""
    return inside(box, frame.depth_m.shape) & (frame.depth_m > 0)


def clicked_m(click: Click, frame: Frame) -> Floats | None:
    """(3,) the point of the surface that was clicked, metres, camera coordinates; None where there is no depth."""
    depths_m = frame.depth_m[measured_in(around(click), frame)]
    if not len(depths_m):
        return None
    at = (np.array([click.column]), np.array([click.row]), np.array([np.median(depths_m)], float))
    return frame.intrinsics.unproject(*at)[0]
