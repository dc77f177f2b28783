"""A picture of a world: radiance, depth and who is seen where, from one ray a pixel and four along edges."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from tracker.geometry import Intrinsics, Pose
from tracker.sources.synthetic.rendering.lighting import lamp_and_sky, radiance, surface
from tracker.sources.synthetic.rendering.raycast import NOTHING, Float32s, Hits, dot
from tracker.sources.synthetic.rendering.world import World

SUBPIXELS = ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25))


@dataclass(frozen=True, slots=True, eq=False)
class Rendering:
    """What an ideal camera measures, (H, W) each.

    radiance: (H, W, 3) linear, 1 is white. depth_m: along the optical axis, 0 for nothing. owner: number of the thing,
    -1 for nothing. returned: share of a light beside the camera that comes back before distance is counted (albedo
    times the cosine to the surface). mirror: gloss where the surface faces the camera.
    """

    radiance: Float32s
    depth_m: Float32s
    owner: npt.NDArray[np.int16]
    returned: Float32s
    mirror: Float32s


def render(world: World, T_world_cam: Pose, camera: Intrinsics, time_s: float) -> Rendering:
    shape = (camera.height, camera.width)
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    origins, directions = pixel_rays(T_world_cam, camera, columns.ravel(), rows.ravel())
    hits = world.trace(origins, directions, time_s)
    hits.distance[hits.owner == NOTHING] = 0
    points = origins + directions * hits.distance[:, None]
    views = directions / np.sqrt(dot(directions, directions))[:, None]
    facing = np.abs(dot(views, hits.normals))
    footprint_m = hits.distance / np.float32(camera.fx) / np.sqrt(facing.clip(0.05))
    material = surface(world, hits, footprint_m / hits.texel_m)
    lamp, sky = lamp_and_sky(world, points, hits, time_s, shape)
    light = radiance(material, points, hits, views, lamp, sky) * (hits.owner != NOTHING)[:, None]
    smooth = _smooth_edges(light.reshape(*shape, 3), hits, world, T_world_cam, camera, time_s)
    return Rendering(
        smooth,
        hits.distance.reshape(shape),
        hits.owner.reshape(shape),
        (material.albedo.mean(axis=1) * facing).reshape(shape),
        (material.gloss * cv2.pow(facing, 40).ravel()).reshape(shape),
    )


def pixel_rays(
    T_world_cam: Pose, camera: Intrinsics, columns: npt.NDArray[np.number], rows: npt.NDArray[np.number]
) -> tuple[Float32s, Float32s]:
    """World rays (N, 3) through pixels (N,); directions reach one metre along the optical axis, so distance is z."""
    turn = T_world_cam.rotation.astype(np.float32)
    x_m = (columns.astype(np.float32) - np.float32(camera.cx)) / np.float32(camera.fx)
    y_m = (rows.astype(np.float32) - np.float32(camera.cy)) / np.float32(camera.fy)
    directions = np.stack([x_m * turn[k, 0] + y_m * turn[k, 1] + turn[k, 2] for k in range(3)], axis=1)
    return np.broadcast_to(T_world_cam.translation_m.astype(np.float32), directions.shape), directions


def _smooth_edges(
    light: Float32s, hits: Hits, world: World, T_world_cam: Pose, camera: Intrinsics, time_s: float
) -> Float32s:
    """Pixels on an edge take the colours of the neighbours that four rays inside the pixel meet."""
    shape = (camera.height, camera.width)
    owner, depth = hits.owner.reshape(shape), hits.distance.reshape(shape)
    normals = hits.normals.reshape(*shape, 3)
    rows, columns = np.nonzero(_edges(owner, depth, normals))
    total = np.zeros((len(rows), 3), np.float32)
    for dx, dy in SUBPIXELS:
        inner = world.trace(*pixel_rays(T_world_cam, camera, columns + dx, rows + dy), time_s)
        colour, open_ = light[rows, columns], np.ones(len(rows), bool)
        for step_x, step_y in ((0, 0), (1, 0), (0, 1), (1, 1)):
            r = (rows + step_y * int(np.sign(dy))).clip(0, shape[0] - 1)
            c = (columns + step_x * int(np.sign(dx))).clip(0, shape[1] - 1)
            same = open_ & (owner[r, c] == inner.owner) & (np.abs(depth[r, c] - inner.distance) < 0.02 * depth[r, c])
            same &= dot(normals[r, c], inner.normals) > 0.9
            colour[same] = light[r[same], c[same]]
            open_ &= ~same
        total += colour / len(SUBPIXELS)
    light[rows, columns] = total
    return light


def _edges(owner: npt.NDArray[np.int16], depth: Float32s, normals: Float32s) -> npt.NDArray[np.bool_]:
    """(H, W) pixels whose right or lower neighbour, or whose left or upper one, is another surface."""
    edges = np.zeros(owner.shape, bool)
    for one, other in (
        ((slice(None), slice(1, None)), (slice(None), slice(None, -1))),
        ((slice(1, None),), (slice(None, -1),)),
    ):
        differ = (owner[one] != owner[other]) | (np.abs(depth[one] - depth[other]) > 0.03 * depth[one])
        differ |= np.einsum("rck,rck->rc", normals[one], normals[other]) < 0.85
        edges[one] |= differ
        edges[other] |= differ
    return edges
