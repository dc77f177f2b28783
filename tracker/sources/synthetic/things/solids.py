"""The solids that things are built of: boxes, solids of revolution, tubes along a curve. Closed, with texture.

Metres. What a texture coordinate means is said for each; `Mesh.in_window` moves it to its place in a texture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from tracker.geometry import Floats
from tracker.sources.synthetic.things.mesh import Mesh, joined, patch
from tracker.sources.synthetic.things.texture import Window

# side -> the corner at the top left of its picture, the way to its right, the way down; in half extents.
BOX_SIDES: Mapping[str, tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, int, int]]] = {
    "front": ((-1, -1, 1), (1, 0, 0), (0, 0, -1)),
    "right": ((1, -1, 1), (0, 1, 0), (0, 0, -1)),
    "back": ((1, 1, 1), (-1, 0, 0), (0, 0, -1)),
    "left": ((-1, 1, 1), (0, -1, 0), (0, 0, -1)),
    "top": ((-1, 1, 1), (1, 0, 0), (0, -1, 0)),
    "bottom": ((-1, -1, -1), (1, 0, 0), (0, 1, 0)),
}


@dataclass(frozen=True, slots=True)
class Strip:
    """A smooth stretch of a profile: (radius, height) points in metres, and its window in the texture.

    Points go so that the solid is to the right of the walk when radius points right and height up, which is down on
    the outside. Texture rows follow the length of the strip, columns the azimuth.
    """

    points_m: Sequence[tuple[float, float]]
    window: Window


def grid(points_m: Floats, uv: Floats) -> Mesh:
    """A sheet of (R, C, 3) points with (R, C, 2) texture coordinates; seen from outside rows go down, columns right."""
    rows, columns = points_m.shape[:2]
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate((np.stack((a, b, c), -1).reshape(-1, 3), np.stack((a, c, d), -1).reshape(-1, 3)))
    return patch(points_m.reshape(-1, 3), faces, uv.reshape(-1, 2))


def box(size_m: Sequence[float], windows: Mapping[str, Window]) -> Mesh:
    """A box of (x, y, z) metres around the origin; front is -y, right is +x. Each side fills its window."""
    sides: list[Mesh] = []
    half_m = np.asarray(size_m, float) / 2
    uv = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0]), -1)
    for name, (corner, right, down) in BOX_SIDES.items():
        points = np.asarray(corner) + 2 * (uv[..., :1] * np.asarray(right) + uv[..., 1:] * np.asarray(down))
        sides.append(grid(points * half_m, uv).in_window(*windows[name]))
    return joined(sides)


def revolved(strips: Sequence[Strip], sections: int = 96) -> Mesh:
    """A solid of revolution about z from a profile that begins and ends on the axis (or closes on itself)."""
    angles_rad = np.arange(sections + 1) % sections * (2 * np.pi / sections)  # the seam is one place, bit by bit
    circle = np.stack((np.cos(angles_rad), np.sin(angles_rad), np.zeros(sections + 1)), axis=1)
    parts: list[Mesh] = []
    for strip in strips:
        profile = np.asarray(strip.points_m, float)
        along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))))
        points = profile[:, None, :1] * circle + profile[:, None, 1:] * [0.0, 0.0, 1.0]
        columns = np.linspace(0, 1, sections + 1)
        uv = np.stack(np.meshgrid(columns, along / along[-1]), axis=-1)
        parts.append(grid(points, uv).in_window(*strip.window))
    return joined(parts)


def swept(
    path_m: Floats, half_widths_m: Floats, half_depths_m: Floats, roundness: float = 1.0, sections: int = 32
) -> Mesh:
    """A closed tube along a curve in the x-z plane: path (N, 3); half widths in the plane, half depths along y, (N,).

    roundness: 1 is an ellipse, towards 0 a rectangle (a superellipse of exponent 2 / roundness).
    Texture rows follow the path, columns go around; the flat ends take the colour of the first and the last row.
    """
    tangents = np.gradient(path_m, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    normals = np.cross(tangents, [0.0, 1.0, 0.0])
    angles_rad = np.arange(sections + 1) % sections * (2 * np.pi / sections)
    across = np.sign(np.cos(angles_rad)) * np.abs(np.cos(angles_rad)) ** roundness
    deep = np.sign(np.sin(angles_rad)) * np.abs(np.sin(angles_rad)) ** roundness
    ring = (across * half_widths_m[:, None])[..., None] * normals[:, None]
    ring = ring + (deep * half_depths_m[:, None])[..., None] * np.array([0.0, 1.0, 0.0])
    points = path_m[:, None] + ring
    along = np.linspace(0, 1, len(path_m))
    uv = np.stack(np.meshgrid(np.linspace(0, 1, sections + 1), along), axis=-1)
    first, last = (np.broadcast_to(path_m[end], points[0].shape) for end in (0, -1))
    return joined(
        [
            grid(points, uv),
            grid(np.stack((first, points[0])), uv[[0, 0]]),
            grid(np.stack((points[-1], last)), uv[[-1, -1]]),
        ]
    )


def curve(points_m: Sequence[tuple[float, float]]) -> Floats:
    """A smooth curve (64, 3) in the x-z plane through (x, z) points."""
    knots = np.array(points_m)
    lengths = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))))
    x, z = CubicSpline(lengths, knots)(np.linspace(0, lengths[-1], 64)).T
    return np.stack((x, np.zeros(64), z), axis=1)
