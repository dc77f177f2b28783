"""How well a pose explains the picture: the true one best, and for the right reasons."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracker.appearance import ViewAppearance
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.sources.synthetic import SyntheticScene
from tracker.verification import Evidence, VerificationConfig, Verifier, evenly, worth
from tracker.view import ObjectView, ViewConfig, view_object

CONFIG = VerificationConfig()
ACROSS = ViewConfig().pixels_across


def judged(model: ConceptModel, T_cam_obj: Pose, view: ObjectView, config: VerificationConfig = CONFIG) -> Evidence:
    return Verifier(model, config, ACROSS)(T_cam_obj, view, ViewAppearance(view))


def seen(frame: Frame, model: ConceptModel) -> ObjectView:
    view = view_object(frame, frame.masks[model.object_id], model.diameter_m, ViewConfig())
    assert view is not None
    return view


def shifted(T_cam_obj: Pose, x_m: float, y_m: float, z_m: float) -> Pose:
    return T_cam_obj.nudged(np.array((0, 0, 0, x_m, y_m, z_m)))


def turned(T_cam_obj: Pose, axes: str, *angles_deg: float) -> Pose:
    """On the spot, about the object's own axes."""
    return T_cam_obj @ Pose(Rotation.from_euler(axes, angles_deg, degrees=True).as_matrix(), np.zeros(3))


def wrong_poses(T_cam_obj: Pose) -> list[Pose]:
    """Clearly off in every direction, and upside down; but not turned about z, which is the can's axis."""
    shifts = [shifted(T_cam_obj, *(sign * 0.02 * np.eye(3)[axis])) for axis in range(3) for sign in (-1, 1)]
    return [*shifts, *(turned(T_cam_obj, axis, angle) for axis in "xy" for angle in (-35, 35, 180))]


@pytest.mark.parametrize("index", [0, 5, 11])
def test_the_true_pose_of_the_can_scores_far_above_wrong_ones(
    index: int, can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    frame = can_frames[index]
    truth, view = can_scene.sightings("soup_can")[frame.index].T_cam_obj, seen(frame, can_model)
    right = judged(can_model, truth, view)
    assert right.score > TrackerConfig().trust
    assert all(judged(can_model, wrong, view).score < right.score - 0.15 for wrong in wrong_poses(truth))


@pytest.mark.parametrize("angle_deg", [-120, -90, -20, 20, 40, 90])
def test_the_true_pose_of_the_can_scores_above_one_turned_about_its_axis(
    angle_deg: float, can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    frame = can_frames[11]
    truth, view = can_scene.sightings("soup_can")[frame.index].T_cam_obj, seen(frame, can_model)
    margin = 0.1 if abs(angle_deg) > 45 else 0.005
    turned_score = judged(can_model, turned(truth, "z", angle_deg), view).score
    assert turned_score < judged(can_model, truth, view).score - margin


@pytest.mark.parametrize("name", ["mug", "tea_box"])
def test_so_do_the_true_poses_among_clutter(
    name: str, table_scene: SyntheticScene, table_models: dict[str, ConceptModel]
) -> None:
    model, truth = table_models[name], table_scene.sightings(name)[3].T_cam_obj
    view = seen(table_scene[3], model)
    right = judged(model, truth, view).score
    about_z = [turned(truth, "z", angle) for angle in (-120, -35, 35, 120)]
    assert all(judged(model, wrong, view).score < right - 0.15 for wrong in (*wrong_poses(truth), *about_z))


def test_the_score_falls_the_farther_a_pose_is_off(
    can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    along = [judged(can_model, shifted(can_truth, 0, 0, z_m), can_view).score for z_m in (0, 0.003, 0.006, 0.012)]
    about = [judged(can_model, turned(can_truth, "z", angle), can_view).score for angle in (0, 6, 12, 24)]
    for scores in (along, about):
        assert scores == sorted(scores, reverse=True)
        assert scores[-1] < 0.9 * scores[0]


def test_a_model_in_front_of_what_the_camera_sees_is_seen_through(
    can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    """The air before the object is empty: the camera looked through it. Behind the object it did not look."""
    in_front = judged(can_model, shifted(can_truth, 0, 0, -0.03), can_view)
    behind = judged(can_model, shifted(can_truth, 0, 0, 0.03), can_view)
    assert judged(can_model, can_truth, can_view).seen_through < 0.02
    assert in_front.seen_through > 0.7
    assert behind.seen_through < 0.02
    assert in_front.score < 0.05
    assert behind.score < 0.05


def without_lower_half(frame: Frame, depth_m: float) -> Frame:
    """The lower half of the can is neither masked nor to be seen: something is there at another depth."""
    rows, columns = np.nonzero(frame.masks["soup_can"])
    lower = rows > np.median(rows)
    mask, depth = frame.masks["soup_can"].copy(), frame.depth_m.copy()
    mask[rows[lower], columns[lower]] = False
    depth[rows[lower], columns[lower]] = depth_m
    return replace(frame, masks={"soup_can": mask}, depth_m=depth)


def test_surface_that_should_be_seen_and_is_empty_counts_against_a_pose(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    """The lower half of the mask and of the depth is the wall behind."""
    whole = judged(can_model, can_truth, seen(can_frames[0], can_model))
    half = judged(can_model, can_truth, seen(without_lower_half(can_frames[0], 1.2), can_model))
    assert half.score < 0.65 * whole.score
    assert half.outside > 0.3
    assert half.hidden < 0.05


def test_what_something_in_front_hides_does_not_count_against_a_pose(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    """The lower half is hidden by something ten centimetres nearer."""
    whole = judged(can_model, can_truth, seen(can_frames[0], can_model))
    half = judged(
        can_model, can_truth, seen(without_lower_half(can_frames[0], can_truth.translation_m[2] - 0.1), can_model)
    )
    assert half.hidden == pytest.approx(0.5, abs=0.15)
    assert half.score > 0.9 * whole.score
    assert half.outside < 0.1


def test_a_pose_that_is_wholly_hidden_proves_nothing(
    can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    """An object half a metre farther away would be behind the one that is there."""
    beyond = judged(can_model, shifted(can_truth, 0, 0, 0.5), can_view)
    beside = judged(can_model, shifted(can_truth, 0.25, 0, 0), can_view)
    assert beyond.score < 0.05
    assert beside.score < 0.05
    assert beside.outside > 0.5


@pytest.mark.parametrize("depth_m", [-0.6, 0.0])
def test_a_pose_behind_the_camera_scores_nothing(
    depth_m: float, can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    evidence = judged(can_model, Pose(can_truth.rotation, np.array([0, 0, depth_m])), can_view)
    assert evidence.score < 0.01
    assert all(np.isfinite(getattr(evidence, name)) for name in Evidence.__slots__)


def test_colour_tells_the_can_from_the_can_turned_about_its_axis(
    can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    around = turned(can_truth, "z", 40)
    right, wrong = judged(can_model, can_truth, can_view), judged(can_model, around, can_view)
    assert wrong.surface > 0.7 * right.surface
    assert wrong.colour < 0.85 * right.colour
    shape_alone = VerificationConfig(colour_share=0)
    assert judged(can_model, around, can_view, shape_alone).score == pytest.approx(
        wrong.surface * worth(wrong.explained)
    )
    assert wrong.score < 0.85 * right.score
    assert wrong.contradicted > 5 * right.contradicted


def test_exposure_and_white_balance_cost_little(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    plain = judged(can_model, can_truth, seen(can_frames[0], can_model)).score
    for gains in ((0.8, 0.8, 0.8), (0.9, 1.0, 0.85)):
        rgb = (can_frames[0].rgb * np.array(gains)).round().astype(np.uint8)
        assert judged(can_model, can_truth, seen(replace(can_frames[0], rgb=rgb), can_model)).score > 0.8 * plain


def test_another_object_in_the_same_place_is_not_taken_for_the_can(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    """The same shape, but its colours are of a plain thing."""
    rgb = can_frames[0].rgb.copy()
    rgb[can_frames[0].masks["soup_can"]] = (40, 90, 180)
    other = judged(can_model, can_truth, seen(replace(can_frames[0], rgb=rgb), can_model))
    right = judged(can_model, can_truth, seen(can_frames[0], can_model))
    assert other.surface == pytest.approx(right.surface)
    assert other.score < 0.6 * right.score


def test_every_share_lies_between_nothing_and_all(
    can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    for pose in (can_truth, *wrong_poses(can_truth)):
        evidence = judged(can_model, pose, can_view)
        values = [getattr(evidence, name) for name in Evidence.__slots__]
        assert all(0 <= value <= 1 + 1e-9 for value in values)
        assert evidence.score <= evidence.surface
        assert evidence.surface + evidence.seen_through + evidence.outside <= 1 + 1e-9


def test_a_pose_is_worth_more_the_more_it_explains_and_next_to_nothing_where_it_explains_little() -> None:
    values = [worth(explained) for explained in np.linspace(0, 1, 21)]
    assert values == sorted(values)
    assert (values[0], values[-1]) == (0, 1)
    assert worth(0.15) < 0.1
    assert worth(0.5) > 0.5  # half of what is seen may be a side that the model does not know


def test_a_finer_view_explains_as_much(can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose) -> None:
    """The model's points do not lie closer because the pixels do."""
    frame = can_frames[0]
    mask = frame.masks["soup_can"]
    views = [
        view_object(frame, mask, can_model.diameter_m, ViewConfig(pixels_across=n, least_pixels=0)) for n in (32, 64)
    ]
    coarse, fine = (Verifier(can_model, CONFIG, 32)(can_truth, v, ViewAppearance(v)) for v in views if v is not None)
    assert fine.explained > 0.9 * coarse.explained > 0.8


def test_points_are_spread_evenly_however_densely_a_side_was_seen() -> None:
    rng = np.random.default_rng(3)
    dense, sparse = rng.random((20_000, 3)) * (1, 1, 0), rng.random((2000, 3)) * (1, 1, 0) + (1, 0, 0)
    points = np.concatenate((dense, sparse))
    chosen = evenly(points, 400)
    assert len(set(chosen)) == 400
    assert np.count_nonzero(chosen >= len(dense)) == pytest.approx(200, abs=20)
    assert sorted(evenly(points[:50], 400)) == list(range(50))


def test_points_that_lie_on_one_another_are_all_taken_where_so_many_are_wanted() -> None:
    assert len(evenly(np.zeros((5, 3)), 5)) == 5
