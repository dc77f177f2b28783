"""From a few degrees and millimetres off to the pose: by depth where there is shape, by colour where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracker.appearance import ViewAppearance
from tracker.concept import ConceptModel
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.refinement import Refined, RefinementConfig, Refiner
from tracker.sources.synthetic import SyntheticScene
from tracker.view import ObjectView, ViewConfig, view_object

CONFIG = RefinementConfig()
SHAPE_ALONE = RefinementConfig(colour_weight=0)
ACROSS = ViewConfig().pixels_across


def about_its_axis(angle_deg: float) -> Pose:
    """The can turned on the spot: its axis is z."""
    return Pose(Rotation.from_euler("z", angle_deg, degrees=True).as_matrix(), np.zeros(3))


def off(seed: int, angle_deg: float, distance_m: float) -> np.ndarray:
    """A small motion about any axis and in any direction."""
    turn, shift = np.random.default_rng([seed, 7]).normal(size=(2, 3))
    turn *= np.radians(angle_deg) / np.linalg.norm(turn)
    return np.r_[turn, distance_m * shift / np.linalg.norm(shift)]


def refined(model: ConceptModel, start: Pose, view: ObjectView, config: RefinementConfig = CONFIG) -> Refined | None:
    return Refiner(model, config, ACROSS)(start, view, ViewAppearance(view))


def errors(found: Refined | None, truth: Pose) -> tuple[float, float]:
    """Millimetres and degrees."""
    assert found is not None
    return 1000 * found.T_cam_obj.distance_to_m(truth), float(np.degrees(found.T_cam_obj.angle_to_rad(truth)))


def seen(frame: Frame, model: ConceptModel) -> ObjectView:
    view = view_object(frame, frame.masks[model.object_id], model.diameter_m, ViewConfig())
    assert view is not None
    return view


@pytest.mark.parametrize("seed", range(6))
def test_a_can_some_degrees_and_millimetres_off_is_brought_back(
    seed: int, can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    found = refined(can_model, can_truth.nudged(off(seed, 5, 0.005)), can_view)
    millimetres, degrees = errors(found, can_truth)
    assert millimetres < 0.5
    assert degrees < 1.5


@pytest.mark.parametrize("angle_deg", [-8, 8])
def test_colour_brings_back_a_can_turned_about_its_axis_and_shape_does_not(
    angle_deg: float, can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    start = can_truth @ about_its_axis(angle_deg)
    assert errors(refined(can_model, start, can_view), can_truth)[1] < 1.5
    without_colour = errors(refined(can_model, start, can_view, SHAPE_ALONE), can_truth)
    assert without_colour[0] < 0.5
    assert without_colour[1] > 4


def test_the_truth_is_a_fixed_point_in_every_frame(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    sightings = can_scene.sightings("soup_can")
    for frame in can_frames[::4]:
        truth = sightings[frame.index].T_cam_obj
        millimetres, degrees = errors(refined(can_model, truth, seen(frame, can_model)), truth)
        assert millimetres < 0.3
        assert degrees < 1.5


def test_where_refinement_ends_hardly_depends_on_where_it_began(
    can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    ends = [refined(can_model, can_truth.nudged(off(seed, 3, 0.003)), can_view) for seed in range(6)]
    for end in ends[1:]:
        assert ends[0] is not None
        millimetres, degrees = errors(end, ends[0].T_cam_obj)
        assert millimetres < 0.1
        assert degrees < 0.5


def test_where_it_is_settled_does_not_depend_on_where_it_began(
    can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    refiner, appearance = Refiner(can_model, CONFIG, ACROSS), ViewAppearance(can_view)
    ends = []
    for seed in range(6):
        nearly = refiner(can_truth.nudged(off(seed, 3, 0.003)), can_view, appearance)
        assert nearly is not None
        ends.append(refiner.settled(nearly.T_cam_obj, can_view, appearance))
    for end in ends[1:]:
        assert ends[0] is not None
        millimetres, degrees = errors(end, ends[0].T_cam_obj)
        assert millimetres < 0.02
        assert degrees < 0.1


@pytest.mark.parametrize("name", ["mug", "tea_box"])
def test_objects_among_clutter_are_brought_back(
    name: str, table_scene: SyntheticScene, table_models: dict[str, ConceptModel]
) -> None:
    model, truth = table_models[name], table_scene.sightings(name)[3].T_cam_obj
    view = seen(table_scene[3], model)
    for seed in range(4):
        millimetres, degrees = errors(refined(model, truth.nudged(off(seed, 4, 0.004)), view), truth)
        assert millimetres < 2
        assert degrees < 2


def test_exposure_and_white_balance_do_not_turn_the_can(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    start = can_truth @ about_its_axis(5)
    plain = refined(can_model, start, seen(can_frames[0], can_model))
    assert plain is not None
    for gains in ((0.75, 0.75, 0.75), (0.9, 1.0, 0.8)):
        rgb = (can_frames[0].rgb * np.array(gains)).round().astype(np.uint8)
        found = refined(can_model, start, seen(replace(can_frames[0], rgb=rgb), can_model))
        assert errors(found, plain.T_cam_obj)[1] < 0.5
        assert errors(found, can_truth)[1] < 1.5


def test_a_colour_picture_that_is_beside_the_depth_picture_moves_the_pose_less_if_that_is_allowed_for(
    table_scene: SyntheticScene, table_models: dict[str, ConceptModel]
) -> None:
    model, truth = table_models["tea_box"], table_scene.sightings("tea_box")[3].T_cam_obj
    frame = table_scene[3]
    ends = {}
    for information in (0.1, 1e6):
        config = RefinementConfig(offset_information=information)
        both = [
            refined(model, truth, seen(f, model), config)
            for f in (frame, replace(frame, rgb=np.roll(frame.rgb, (1, 2), axis=(0, 1))))
        ]
        assert both[0] is not None
        ends[information] = errors(both[1], both[0].T_cam_obj)
    assert ends[0.1][0] < 0.6 * ends[1e6][0]


def test_something_in_front_of_a_part_of_the_mask_does_not_draw_the_pose(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    """A ragged mask: a third of it is of a thing ten centimetres nearer."""
    frame = can_frames[0]
    rows, columns = np.nonzero(frame.masks["soup_can"])
    part = columns < np.quantile(columns, 0.33)
    depth_m, rgb = frame.depth_m.copy(), frame.rgb.copy()
    depth_m[rows[part], columns[part]] = can_truth.translation_m[2] - 0.1
    rgb[rows[part], columns[part]] = (30, 160, 40)
    view = seen(replace(frame, depth_m=depth_m, rgb=rgb), can_model)
    millimetres, degrees = errors(refined(can_model, can_truth.nudged(off(1, 3, 0.003)), view), can_truth)
    assert millimetres < 1
    assert degrees < 3


def test_a_patch_of_depth_that_is_wrong_does_not_draw_the_pose(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    """A tenth of the can measured twelve millimetres too near, as by a reflection."""
    frame = can_frames[0]
    rows, columns = np.nonzero(frame.masks["soup_can"] & (frame.depth_m > 0))
    part = rows > np.quantile(rows, 0.9)
    depth_m = frame.depth_m.copy()
    depth_m[rows[part], columns[part]] -= 0.012
    found = refined(can_model, can_truth, seen(replace(frame, depth_m=depth_m), can_model))
    assert errors(found, can_truth)[0] < 0.7
    assert errors(found, can_truth)[1] < 2


def test_what_shape_leaves_free_has_the_least_information(
    can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    """Of the six directions, at the scale of the object, it is the turn about the can's axis."""
    scale = np.array([1.0] * 3 + [can_model.diameter_m / 2] * 3)
    sigmas_rad = {}
    for config in (CONFIG, SHAPE_ALONE):
        found = refined(can_model, can_truth, can_view, config)
        assert found is not None
        assert np.allclose(found.information, found.information.T)
        values, vectors = np.linalg.eigh(found.information * np.outer(scale, scale))
        assert values.min() > 0
        sigmas_rad[config.colour_weight] = values[0] ** -0.5
        if config is SHAPE_ALONE:
            axis_cam = found.T_cam_obj.rotation[:, 2]
            assert abs(vectors[:3, 0] @ axis_cam) > 0.9
            assert values[0] < 0.1 * values[1]
            assert len(found.free) == 1
            assert abs(found.free[0, :3] @ axis_cam) * can_model.diameter_m / 2 > 0.9
        else:
            assert len(found.free) == 0
    assert sigmas_rad[1.0] < 0.5 * sigmas_rad[0]


def test_the_evidence_says_how_far_and_how_many(can_model: ConceptModel, can_view: ObjectView, can_truth: Pose) -> None:
    near = refined(can_model, can_truth, can_view)
    assert near is not None
    assert near.residual_m < 0.001
    assert 300 < near.aligned <= CONFIG.model_points
    once = RefinementConfig(coarse_steps=0, fine_steps=1)
    shifted = can_truth.nudged(np.array((0, 0, 0, 0, 0, 0.003)))
    far = refined(can_model, shifted, can_view, once)
    assert far is not None
    assert far.residual_m > 3 * near.residual_m


def test_what_has_settled_takes_no_more_steps_and_what_has_not_takes_all(
    can_model: ConceptModel, can_view: ObjectView, can_truth: Pose, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = []
    linearise = Refiner._linearise
    monkeypatch.setattr(Refiner, "_linearise", lambda *given: steps.append(1) or linearise(*given))
    patient = RefinementConfig(coarse_settled_px=0, fine_settled_px=0)
    assert errors(refined(can_model, can_truth, can_view, patient), can_truth)[0] < 0.5
    assert len(steps) == patient.coarse_steps + patient.fine_steps
    steps.clear()
    assert errors(refined(can_model, can_truth, can_view), can_truth)[0] < 0.5
    assert len(steps) < 6


def test_a_model_that_meets_too_few_of_the_objects_pixels_is_not_refined(
    can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    for shift_m in ((0.2, 0, 0), (0, 0, 0.1), (0, 0, -0.1), (0, 0, -2)):
        away = can_truth.nudged(np.array((0, 0, 0, *shift_m)))
        assert refined(can_model, away, can_view) is None
    rows, columns = np.nonzero(can_view.has_depth)
    few = np.zeros_like(can_view.depth_m)
    few[rows[::100], columns[::100]] = can_view.depth_m[rows[::100], columns[::100]]
    assert refined(can_model, can_truth, replace(can_view, depth_m=few)) is None


def test_the_same_is_refined_to_the_same(can_model: ConceptModel, can_view: ObjectView, can_truth: Pose) -> None:
    start = can_truth.nudged(off(0, 4, 0.004))
    one, two = (refined(can_model, start, can_view) for _ in range(2))
    assert one is not None
    assert two is not None
    assert np.array_equal(one.T_cam_obj.matrix, two.T_cam_obj.matrix)
    assert np.array_equal(one.information, two.information)
