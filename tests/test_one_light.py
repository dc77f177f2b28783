"""Views of one surface in different light: what differs is the light, and is taken off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from reference.group_means import GroupMeans
from reference.one_light import in_one_light
from tracker.geometry import Floats

VOXELS = 1500


@dataclass
class Painted:
    """A ball with print in every voxel, seen by several views; colours as each view's light makes them."""

    colours: Floats
    normals: Floats
    voxel: npt.NDArray[np.intp]
    views: npt.NDArray[np.intp]
    print: Floats

    def evened(self) -> Floats:
        return in_one_light(self.colours, self.normals, self.voxel, self.views, np.ones(len(self.views)))

    def apart(self, colours: Floats) -> float:
        """How far the views are apart where they show the same, in log, in the median."""
        ratio, place = np.log(colours / self.print[self.voxel]), np.unique(self.voxel, return_inverse=True)[1]
        return float(np.median(np.abs(ratio - GroupMeans(place, np.ones(len(ratio)))(ratio)[place])))


def painted(views: int, *, gain: float = 0.15, slope: float = 0.15, seed: int = 0) -> Painted:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(VOXELS, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    directions = np.array([(np.cos(t), np.sin(t), 0.3) for t in 2 * np.pi * np.arange(views) / views])
    view, voxel = np.nonzero(directions @ normals.T > 0)
    gains, slopes = rng.normal(0, gain, (views, 3)), rng.normal(0, slope, (views, 3))
    paint = rng.uniform(40, 150, (VOXELS, 3))
    lit = gains[view] + (slopes[view] * normals[voxel]).sum(axis=1, keepdims=True)
    return Painted(paint[voxel] * np.exp(lit), normals[voxel], voxel, view, paint)


@pytest.mark.parametrize("views", [3, 4, 9])
def test_what_light_makes_of_the_views_is_taken_off(views: int) -> None:
    ball = painted(views)
    assert ball.apart(ball.colours) > 0.05
    assert ball.apart(ball.evened()) < 0.2 * ball.apart(ball.colours)


def test_views_in_one_light_stay_as_they_are() -> None:
    ball = painted(4, gain=0.0, slope=0.0)
    assert np.allclose(ball.evened(), ball.colours)


def test_what_gloss_or_a_shadow_does_to_some_of_a_view_is_not_taken_for_its_light() -> None:
    ball = painted(4)
    glossy = (ball.views == 0) & (ball.normals @ (0.9, 0.3, 0.3) > 0.85)
    assert np.count_nonzero(glossy) > 10
    expected = ball.evened()
    ball.colours[glossy] = 255.0
    assert np.median(np.abs(ball.evened()[~glossy] / expected[~glossy] - 1)) < 0.02


def test_without_a_surface_that_two_views_show_nothing_is_known_of_the_light() -> None:
    ball = painted(4)
    one = ball.views == 1
    alone = Painted(ball.colours[one], ball.normals[one], ball.voxel[one], 0 * ball.views[one], ball.print)
    assert np.allclose(alone.evened(), alone.colours)
    ball.voxel = np.arange(len(ball.voxel))
    assert np.allclose(ball.evened(), ball.colours)


def test_neither_the_axes_nor_the_order_of_the_views_matter() -> None:
    ball = painted(4)
    expected = ball.evened()
    turned = Painted(
        ball.colours,
        ball.normals @ Rotation.from_rotvec((0.3, 0.9, 0.3)).as_matrix(),
        ball.voxel,
        ball.views,
        ball.print,
    )
    assert np.allclose(turned.evened(), expected)
    ball.views = np.array((2, 0, 3, 1))[ball.views]
    assert np.allclose(ball.evened(), expected)


def test_colours_stay_colours() -> None:
    ball = painted(3, gain=0.6)
    ball.colours = np.clip(ball.colours, 0, 255)
    evened = ball.evened()
    assert evened.min() >= 0
    assert evened.max() <= 255
