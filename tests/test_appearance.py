"""Colours to align by: the object's alone, and smoothed alike in the view and over the model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tracker.appearance import ViewAppearance, model_appearance
from tracker.concept import ConceptModel
from tracker.frame import Frame
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.projection import interpolate, project
from tracker.saliency.attributes import lab_of
from tracker.view import ObjectView, ViewConfig, view_object

ACROSS = 64
SIDE_M, DEPTH_M = 0.1, 0.5
EXTENT_M = SIDE_M * 2**0.5
CAMERA = Intrinsics(ACROSS * DEPTH_M / EXTENT_M, ACROSS * DEPTH_M / EXTENT_M, 47.5, 35.5, 96, 72)


def stripes(x_m: Floats, y_m: Floats) -> Floats:
    """(..., 3) RGB of a place on a square: waves of two to three centimetres, another direction in each channel."""
    waves = np.stack((300 * x_m, 240 * y_m, 200 * (x_m + y_m)), axis=-1)
    return 128 + 100 * np.sin(waves)


def square_view() -> ObjectView:
    """A square that faces the camera, a view pixel a frame pixel, before a far gray wall."""
    rows, columns = np.indices((CAMERA.height, CAMERA.width))
    x_m, y_m = (columns - CAMERA.cx) / CAMERA.fx * DEPTH_M, (rows - CAMERA.cy) / CAMERA.fy * DEPTH_M
    mask = (np.abs(x_m) < SIDE_M / 2) & (np.abs(y_m) < SIDE_M / 2)
    rgb = np.where(mask[:, :, None], stripes(x_m, y_m), 128).round().astype(np.uint8)
    depth_m = np.where(mask, DEPTH_M, 1.5).astype(np.float32)
    view = view_object(Frame(rgb, depth_m, CAMERA, 0, {"square": mask}), mask, EXTENT_M, ViewConfig())
    assert view is not None
    assert view.pixels_across == pytest.approx(ACROSS)
    return view


def square_model() -> ConceptModel:
    """The same square in its own coordinates, which are the camera's but for the depth."""
    steps = np.arange(-SIDE_M / 2, SIDE_M / 2, EXTENT_M / ACROSS)
    x_m, y_m = (axis.ravel() for axis in np.meshgrid(steps, steps))
    points = np.stack((x_m, y_m, np.zeros_like(x_m)), axis=1)
    return model_of(points, np.tile((0.0, 0, -1), (len(points), 1)), stripes(x_m, y_m))


def model_of(points: Floats, normals: Floats, colours: Floats) -> ConceptModel:
    ones = np.ones(len(points), np.float32)
    return ConceptModel(
        "square", points, normals, colours.astype(np.float32), ones[:, None], ones.astype(np.int32), ones,
        np.array([[0.0, 0, -1]]), EXTENT_M, ("concept",), "none", "none",
    )  # fmt: skip


def spread(lab: Floats) -> float:
    return float(np.std(lab, axis=0).sum())


def test_what_surrounds_the_object_does_not_colour_it() -> None:
    view = square_view()
    loud = replace(view, rgb=np.where(view.inside[:, :, None], view.rgb, np.array((255, 0, 0), np.float32)))
    quiet, loud_too = ViewAppearance(view), ViewAppearance(loud)
    for one, other in ((quiet.fine, loud_too.fine), (quiet.coarse, loud_too.coarse)):
        assert np.allclose(one.lab[view.inside], other.lab[view.inside], atol=1e-4)
        assert np.allclose(one.gradient, other.gradient, atol=1e-4)


def test_the_fine_level_is_nearly_the_picture_and_the_coarse_one_is_smoother() -> None:
    view = square_view()
    appearance = ViewAppearance(view)
    fine, coarse = (level.lab[view.inside] for level in (appearance.fine, appearance.coarse))
    plain = lab_of(view.rgb)[view.inside]
    assert np.abs(fine - plain).mean() < 0.3 * np.abs(coarse - plain).mean()
    assert spread(coarse) < 0.8 * spread(fine) < 0.8 * spread(plain)


def test_gradients_are_the_change_of_lab_a_pixel_along_columns_then_rows() -> None:
    view = square_view()
    appearance = ViewAppearance(view)
    inner = np.zeros_like(view.inside)
    inner[8:-8, 8:-8] = view.inside[8:-8, 8:-8]
    for level in (appearance.fine, appearance.coarse):
        lab, gradient = level.lab, level.gradient
        assert np.allclose(gradient[inner][:, :3], np.gradient(lab, axis=1)[inner], atol=1e-4)
        assert np.allclose(gradient[inner][:, 3:], np.gradient(lab, axis=0)[inner], atol=1e-4)
        assert np.abs(gradient[inner]).max() > 1


def test_there_is_no_gradient_across_the_border_of_the_object() -> None:
    view = square_view()
    appearance = ViewAppearance(view)
    left = view.inside & ~np.roll(view.inside, 1, axis=1)
    top = view.inside & ~np.roll(view.inside, 1, axis=0)
    for gradient in (appearance.fine.gradient, appearance.coarse.gradient):
        assert (gradient[~view.inside & ~np.roll(view.inside, -1, 1) & ~np.roll(view.inside, 1, 1)][:, :3] == 0).all()
        assert (gradient[left][:, :3] == 0).all()
        assert (gradient[top][:, 3:] == 0).all()


def test_the_fine_level_of_a_model_is_its_own_colours() -> None:
    model = square_model()
    assert np.allclose(model_appearance(model, ACROSS).fine, lab_of(model.colours[None])[0], atol=1e-5)


def test_a_model_of_one_colour_keeps_it() -> None:
    model = square_model()
    plain = replace(model, colours=np.full_like(model.colours, 90))
    appearance = model_appearance(plain, ACROSS)
    for lab in (appearance.fine, appearance.coarse):
        assert np.allclose(lab, lab[0], atol=1e-4)


def test_view_and_model_are_smoothed_alike() -> None:
    view, model = square_view(), square_model()
    of_view, of_model = ViewAppearance(view), model_appearance(model, ACROSS)
    at = project(model.points, model.normals, Pose(np.eye(3), np.array([0, 0, DEPTH_M])), view.camera)
    inner = np.abs(model.points[:, :2]).max(axis=1) < 0.35 * SIDE_M  # at a border the neighbourhoods differ
    levels = of_view.fine, of_view.coarse
    seen = [interpolate(level.lab, at.columns[inner], at.rows[inner]) for level in levels]
    known = [lab[inner] for lab in (of_model.fine, of_model.coarse)]
    difference = [[float(np.abs(s - k).mean()) for k in known] for s in seen]
    assert difference[0][0] < 0.4 * difference[0][1]
    assert difference[1][1] < 0.3 * difference[1][0]


def test_a_model_of_which_a_view_has_more_pixels_is_smoothed_less() -> None:
    model = square_model()
    appearance = model_appearance(model, ACROSS)
    fine, coarse = appearance.fine, appearance.coarse
    sharper = model_appearance(model, 2 * ACROSS).coarse
    sharpest = model_appearance(model, 20 * ACROSS).coarse
    assert np.abs(sharper - fine).mean() < 0.7 * np.abs(coarse - fine).mean()
    assert np.allclose(sharpest, fine, atol=1e-3)


def test_colours_do_not_mix_through_a_thin_wall() -> None:
    """A sheet of a millimetre, red before and green behind."""
    front = square_model()
    points = np.vstack((front.points, front.points + np.array((0, 0, 0.001))))
    normals = np.vstack((front.normals, -front.normals))
    colours = np.repeat([(200.0, 20, 20), (20, 160, 60)], len(front), axis=0)
    appearance = model_appearance(model_of(points, normals, colours), ACROSS)
    assert np.allclose(appearance.fine, appearance.coarse, atol=1e-3)


def test_a_model_of_fewer_points_than_a_neighbourhood_is_smoothed_over_all_of_them() -> None:
    model = square_model()
    few = model_of(model.points[:5] * 1e-6, model.normals[:5], model.colours[:5])
    appearance = model_appearance(few, ACROSS)
    assert np.allclose(appearance.coarse, appearance.fine.mean(axis=0), atol=1e-3)
