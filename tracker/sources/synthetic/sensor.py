"""What a cheap structured-light camera makes of an ideal picture.

Depth after Handa et al., A benchmark for RGB-D visual odometry, 3D reconstruction and SLAM, ICRA 2014, section III-B:
the ray is jittered by half a pixel, the disparity gets noise and is cut to eighths of a pixel. To that come the holes:
the projector's shadow, jumps in depth, surfaces that send too little or too much light back, the limits of range.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from tracker.frame import Mask
from tracker.sources.synthetic.rendering.picture import Rendering
from tracker.sources.synthetic.rendering.raycast import Float32s
from tracker.sources.synthetic.things.drawing import Picture

DISPARITY_M = 351.30  # disparity in eighths of a pixel times depth in metres (Handa: 35130 cm)
DISPARITY_SD = 1 / 6  # eighths of a pixel (Handa)
SHIFT_SD_PX = 0.5  # at a width of 640 (Handa)
WIDTH_PX = 640  # of the sensor; pictures of another size are resampled
RANGE_M = (0.35, 3.5)
JUMP = 0.03  # a step in depth of this share is an edge
WEAK_RETURN = 0.015  # share of the projected light at 1 m that gets lost with probability 1/e
RANDOM_HOLES = 0.002
FULL_WELL = 5000.0  # electrons in a white pixel
READ_NOISE = 0.0022  # of white
JUMP_EVERY = 37  # frames between steps of the automatic exposure
BRIGHTEST = 2.0  # beyond this everything is white


def _tones() -> Picture:
    """sRGB of linear light from 0 to BRIGHTEST; highlights fade to white."""
    light = (np.arange(16384) + 0.5) / 16384 * BRIGHTEST
    shoulder = np.where(light > 0.8, 1 - 0.2 * np.exp(-(light - 0.8) / 0.2), light)
    return (255 * shoulder ** (1 / 2.2) + 0.5).astype(np.uint8)


_TONES = _tones()


def measured_depth_m(ideal: Rendering, noise: float, rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """(H, W) metres, 0 where the sensor says nothing. noise: 1 is the sensor above, 0 measures perfectly."""
    if noise == 0:
        return ideal.depth_m.astype(np.float32)
    jittered = _jittered(ideal.depth_m, SHIFT_SD_PX * noise * ideal.depth_m.shape[1] / WIDTH_PX, rng)
    constant = DISPARITY_M / noise
    disparity = constant / np.maximum(jittered, 1e-3) + rng.normal(0, DISPARITY_SD, jittered.shape)
    depth_m = (constant / np.maximum(np.round(disparity), 1)).astype(np.float32)
    lost = _projector_shadow(ideal.depth_m) | _at_jumps(jittered, noise, rng) | _unanswered(ideal, noise, rng)
    lost |= (depth_m < RANGE_M[0]) | (depth_m > RANGE_M[1]) | (ideal.depth_m <= 0)
    depth_m[lost] = 0
    return depth_m


def _jittered(depth_m: Float32s, sd_px: float, rng: np.random.Generator) -> Float32s:
    """Each pixel measures a place somewhat beside its own."""
    rows, columns = np.indices(depth_m.shape, np.float32)
    x, y = (rng.standard_normal((2, *depth_m.shape), np.float32) * sd_px) + (columns, rows)
    return np.asarray(cv2.remap(depth_m, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)


def _projector_shadow(depth_m: Float32s) -> Mask:
    """Pixels that the projector, to the right of the camera, does not see: something nearer reaches past them."""
    shift_px = DISPARITY_M / 8 / np.maximum(depth_m, 0.2) * depth_m.shape[1] / WIDTH_PX
    column = np.arange(depth_m.shape[1], dtype=np.float32) - shift_px  # in the projector's picture
    nearest_to_the_right = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
    return column > nearest_to_the_right + 0.5


def _at_jumps(depth_m: Float32s, noise: float, rng: np.random.Generator) -> Mask:
    """Most pixels whose neighbourhood holds two surfaces."""
    window = np.ones((3, 3), np.uint8)
    spread = cv2.dilate(depth_m, window) - cv2.erode(depth_m, window)
    return (spread > JUMP * depth_m) & (rng.random(depth_m.shape) < min(0.8 * noise, 1))


def _unanswered(ideal: Rendering, noise: float, rng: np.random.Generator) -> Mask:
    """Dark or grazing surfaces send too little back, glossy ones that face the camera blind it; some are bad luck.

    Holes come in blotches: the field that decides is smooth, its quantiles are those of a normal distribution.
    """
    answer = ideal.returned / np.maximum(ideal.depth_m, 0.1) ** 2
    chance = np.exp(-answer / (WEAK_RETURN * noise)) + 0.25 * noise * ideal.mirror**2 + RANDOM_HOLES * noise
    field = cv2.GaussianBlur(rng.standard_normal(answer.shape, np.float32), (0, 0), 1.5)
    return np.asarray(field / field.std() < ndtri(chance.clip(0, 1)), bool)


def exposure(seed: int, index: int, noise: float) -> Float32s:
    """(3,) gain of red, green, blue: slow waves, and small steps as an automatic exposure takes them."""
    rng = np.random.default_rng([seed, 30])
    periods, phases = rng.uniform(45, 160, (2, 3)), rng.uniform(0, 2 * np.pi, (2, 3))
    brightness, *tint = np.sin(2 * np.pi * index / periods + phases).mean(axis=0)
    step = np.random.default_rng([seed, 31, index // JUMP_EVERY]).uniform(-1, 1)
    gains = 0.10 * brightness + 0.06 * step + 0.03 * np.array([tint[0], 0.0, tint[1]])
    return np.exp(noise * gains).astype(np.float32)


def developed(
    radiance: Float32s, gains: Float32s, motion_px: tuple[float, float], noise: float, rng: np.random.Generator
) -> Picture:
    """(H, W, 3) sRGB of linear radiance. motion_px: by how much the picture moves while the shutter is open."""
    light = radiance * gains
    if noise > 0:
        light = _blurred(light, motion_px, noise)
        sd = np.sqrt(light.clip(0) / FULL_WELL + READ_NOISE**2).astype(np.float32)
        light = light + noise * sd * rng.standard_normal(light.shape, np.float32)
    return np.take(_TONES, (light * (len(_TONES) / BRIGHTEST)).clip(0, len(_TONES) - 1).astype(np.uint16))


def _blurred(light: Float32s, motion_px: tuple[float, float], noise: float) -> Float32s:
    """By the lens, and along the motion."""
    blurred = cv2.GaussianBlur(light, (0, 0), 0.45 * noise * max(light.shape[1] / WIDTH_PX, 0.5))
    length = float(np.hypot(*motion_px)) * noise
    if length < 0.5:
        return np.asarray(blurred, np.float32)
    reach = int(np.ceil(length / 2)) + 1
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), np.uint8)
    half = np.array(motion_px) * noise / 2
    ends = [np.round((reach + side * half) * 16).astype(int).tolist() for side in (-1, 1)]  # sixteenths of a pixel
    cv2.line(kernel, ends[0], ends[1], (255,), 1, cv2.LINE_AA, shift=4)
    streak = kernel.astype(np.float32) / kernel.sum()
    return np.asarray(cv2.filter2D(blurred, -1, streak, borderType=cv2.BORDER_REPLICATE), np.float32)
