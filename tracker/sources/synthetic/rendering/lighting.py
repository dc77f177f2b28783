"""How surfaces look: a lamp with soft shadows, light from all around less what is close by, and reflections.

Radiance is linear; 1 is what the camera shows as full white at its nominal exposure.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from tracker.sources.synthetic.rendering.raycast import Float32s, Hits, dot
from tracker.sources.synthetic.rendering.sharing import TILE, shared
from tracker.sources.synthetic.rendering.world import World

LAMP_M = np.array([-0.85, -0.95, 1.70], np.float32)
LAMP_SIZE_M = 0.30
LAMP_REACH_M = 2.2  # at which LAMP_COLOUR is its irradiance
LAMP_COLOUR = np.array([0.95, 0.90, 0.82], np.float32)
SKY_COLOUR = np.array([0.46, 0.49, 0.54], np.float32)
GROUND_COLOUR = np.array([0.26, 0.22, 0.18], np.float32)
NEARBY_M = 0.16  # what is closer than this takes ambient light away
LIFT_M = 8e-4  # shadow rays start above the surface

_SRGB_TO_LINEAR = ((np.arange(256) / 255) ** 2.2).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """What the light falls on, per ray: albedo (N, 3) linear, gloss (N,), both in [0, 1]."""

    albedo: Float32s
    gloss: Float32s


def surface(world: World, hits: Hits, texels_per_pixel: Float32s) -> Surface:
    looked_up = world.atlas.lookup(hits.uv, texels_per_pixel)
    return Surface(np.take(_SRGB_TO_LINEAR, looked_up[:, :3]), looked_up[:, 3] * np.float32(1 / 255))


def lamp_and_sky(
    world: World, points: Float32s, hits: Hits, time_s: float, shape: tuple[int, int]
) -> tuple[Float32s, Float32s]:
    """Shares in [0, 1] of the lamp and of the sky that (H * W, 3) points of a picture see, each (H * W,).

    Every second pixel of every second row sends rays. Neighbours take different ones and share what they find:
    interleaved sampling (Keller and Heidrich, 2001), then joint bilateral upsampling (Kopf et al., 2007).
    """
    chosen = np.arange(shape[0] * shape[1]).reshape(shape)[::2, ::2]
    normals = hits.normals[chosen.ravel()]
    starts = points[chosen.ravel()] + LIFT_M * normals
    sample = _tiled(_order(), chosen.shape)
    lamp = world.occluded(starts, LAMP_M + _lamp_offsets()[sample] - starts, time_s)
    towards = _hemisphere()[sample] + normals * np.float32(1.02)  # a unit sphere on the normal's tip: cosine weighted
    sky = world.occluded(starts, towards * np.float32(NEARBY_M / 1.4), time_s)
    dark = [blocked.reshape(chosen.shape).astype(np.float32) for blocked in (lamp, sky)]
    lit = [1 - values.ravel() for values in shared(dark, hits.owner.reshape(shape), hits.distance.reshape(shape))]
    return lit[0], lit[1]


def radiance(
    surface: Surface, points: Float32s, hits: Hits, views: Float32s, lamp: Float32s, sky: Float32s
) -> Float32s:
    """(N, 3) light towards the camera. views: (N, 3) unit directions from the camera."""
    to_lamp = LAMP_M - points
    squared_m2 = dot(to_lamp, to_lamp)
    to_lamp /= np.sqrt(squared_m2)[:, None]
    on_surface = dot(to_lamp, hits.normals).clip(0) * lamp * (LAMP_REACH_M**2 / squared_m2)
    metal = ((surface.gloss - 0.8) / 0.2).clip(0, 1)
    against = -dot(views, hits.normals).clip(-1, 0)
    mirrored = views + (2 * against)[:, None] * hits.normals
    glancing = (1 - against) ** 2
    fresnel = 0.04 + 0.5 * glancing * glancing * (1 - against)  # after Schlick, less at grazing: paper is rough
    highlight = cv2.pow(dot(mirrored, to_lamp).clip(0, 1), 60).ravel() * lamp * surface.gloss * np.float32(0.35)
    from_room = _surroundings(mirrored) * (0.35 + 0.65 * sky)
    up = (0.5 + 0.5 * hits.normals[:, 2]) * sky
    light = np.empty_like(points)
    for c in range(3):  # whole columns: three times as fast as rows of three
        ambient = 0.6 * GROUND_COLOUR[c] * sky + (SKY_COLOUR[c] - 0.6 * GROUND_COLOUR[c]) * up
        diffuse = surface.albedo[:, c] * (ambient + LAMP_COLOUR[c] * on_surface) * (1 - 0.75 * metal)
        mirror = fresnel * surface.gloss * (1 - metal) + 0.7 * metal * surface.albedo[:, c]
        light[:, c] = diffuse + from_room * mirror + LAMP_COLOUR[c] * highlight
    return light


def _surroundings(directions: Float32s) -> Float32s:
    """(N,) what a mirror would show: a pale ceiling, a window to the left, a darker floor."""
    height = directions[:, 2]
    window = (directions[:, 0] < -0.55) & (height > 0.1) & (height < 0.75)
    return 0.17 + 0.51 * (0.5 + 1.5 * height).clip(0, 1) + np.float32(0.9) * window


def _order() -> npt.NDArray[np.intp]:
    """(TILE, TILE) numbers of samples, neighbours far apart in number."""
    return np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])  # Bayer's matrix


def _tiled(tile: npt.NDArray[np.intp], shape: tuple[int, int]) -> npt.NDArray[np.intp]:
    return np.tile(tile, (-(-shape[0] // TILE), -(-shape[1] // TILE)))[: shape[0], : shape[1]].ravel()


def _lamp_offsets() -> Float32s:
    """(16, 3) places on the lamp, a level square."""
    row, column = np.divmod(np.arange(TILE**2), TILE)
    square = (np.stack((column, row, np.full(TILE**2, (TILE - 1) / 2)), axis=1) + 0.5) / TILE - 0.5
    square[:, 2] = 0
    return (square * LAMP_SIZE_M).astype(np.float32)


def _hemisphere() -> Float32s:
    """(16, 3) points spread over the unit sphere (Fibonacci's lattice)."""
    number = np.arange(TILE**2) + 0.5
    height, angle = 1 - 2 * number / TILE**2, np.pi * (1 + 5**0.5) * number
    level = np.sqrt(1 - height**2)
    return np.stack((level * np.cos(angle), level * np.sin(angle), height), axis=1).astype(np.float32)
