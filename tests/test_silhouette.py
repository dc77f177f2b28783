"""Where an object shows at a pose: its visible pixels where the pose is right, and a reason where it cannot be seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from reference.onboard import onboard
from tracker.concept import ConceptModel
from tracker.frame import Frame, Mask, PosedFrame
from tracker.geometry import Pose
from tracker.saliency import SaliencyBackend
from tracker.silhouette import Silhouette, SilhouetteConfig
from tracker.sources.synthetic import SyntheticScene
from tracker.view import ViewConfig

CONFIG = SilhouetteConfig(around=0, loose=4)
Depth = npt.NDArray[np.float32]


def off(seed: int, angle_deg: float, distance_m: float) -> np.ndarray:
    """A small motion about any axis and in any direction."""
    turn, shift = np.random.default_rng([seed, 7]).normal(size=(2, 3))
    turn *= np.radians(angle_deg) / np.linalg.norm(turn)
    return np.r_[turn, distance_m * shift / np.linalg.norm(shift)]


def outlined(model: ConceptModel, T_cam_obj: Pose, frame: Frame, *, known: bool = True) -> Mask | str:
    return Silhouette(model, CONFIG, ViewConfig().pixels_across)(T_cam_obj, frame, known=known)


def mask_of(model: ConceptModel, T_cam_obj: Pose, frame: Frame, *, known: bool = True) -> Mask:
    mask = outlined(model, T_cam_obj, frame, known=known)
    assert not isinstance(mask, str), mask
    assert mask.shape == frame.depth_m.shape
    assert mask.dtype == np.bool_
    return mask


def overlap(mask: Mask, visible: Mask) -> float:
    """Intersection over union."""
    return np.count_nonzero(mask & visible) / np.count_nonzero(mask | visible)


def covered(mask: Mask, visible: Mask) -> float:
    """The share of what is visible that the mask has."""
    return np.count_nonzero(mask & visible) / np.count_nonzero(visible)


def with_depth(frame: Frame, part: Mask, depth_m: float | Depth) -> Frame:
    return replace(frame, depth_m=np.where(part, np.float32(depth_m), frame.depth_m))


def left_third(visible: Mask) -> Mask:
    columns = np.nonzero(visible)[1]
    return visible & (np.arange(visible.shape[1]) < np.quantile(columns, 0.33))


def facing(turn_deg: float, centre_m: tuple[float, float, float]) -> Pose:
    return Pose(Rotation.from_euler("y", turn_deg, degrees=True).as_matrix(), np.array(centre_m))


@pytest.fixture(scope="module")
def globe_model(globe: Callable[..., PosedFrame], attributes: SaliencyBackend) -> ConceptModel:
    return onboard([globe(facing(turn_deg, (0, 0, 0.5)), index=turn_deg) for turn_deg in (0, 90, 180, 270)], attributes)


def test_at_the_true_pose_it_is_what_is_seen_of_the_can(
    can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    for frame in (can_scene[0], *can_frames[::5], can_scene[60]):
        truth, visible = can_scene.sightings("soup_can")[frame.index].T_cam_obj, frame.masks["soup_can"]
        mask = mask_of(can_model, truth, frame)
        assert overlap(mask, visible) > 0.85
        assert covered(mask, visible) > 0.95


@pytest.mark.parametrize("name", ["mug", "tea_box"])
def test_among_clutter_it_is_what_others_leave_to_be_seen(
    name: str, table_scene: SyntheticScene, table_models: dict[str, ConceptModel]
) -> None:
    """The tea box is hidden by four tenths in one of these frames; two reference frames do not show all of the mug."""
    for index in (3, 20, 80):
        mask = mask_of(table_models[name], table_scene.sightings(name)[index].T_cam_obj, table_scene[index])
        assert overlap(mask, table_scene[index].masks[name]) > 0.8


@pytest.mark.parametrize("seed", range(4))
def test_a_guess_a_little_off_covers_nearly_all_of_what_is_seen(
    seed: int, can_scene: SyntheticScene, can_model: ConceptModel, can_frames: list[Frame]
) -> None:
    for frame in can_frames[::5]:
        truth = can_scene.sightings("soup_can")[frame.index].T_cam_obj
        guess = truth.nudged(off(seed, 5, 0.004))
        assert covered(mask_of(can_model, guess, frame, known=False), frame.masks["soup_can"]) > 0.94


def test_a_guess_far_off_covers_more_than_the_same_pose_taken_for_known(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    visible = can_frames[0].masks["soup_can"]
    for shift_m in ((0.012, 0, 0), (-0.012, 0, 0), (0, 0.012, 0), (0, -0.012, 0), (0, 0, 0.012), (0, 0, -0.012)):
        away = can_truth.nudged(np.array((0, 0, 0, *shift_m)))
        loose = mask_of(can_model, away, can_frames[0], known=False)
        tight = mask_of(can_model, away, can_frames[0])
        assert covered(loose, visible) > 0.85
        assert np.count_nonzero(loose & visible) > np.count_nonzero(tight & visible)


@pytest.mark.parametrize("known", [True, False])
def test_what_is_in_front_of_a_part_is_cut_out(
    known: bool, can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    visible = can_frames[0].masks["soup_can"]
    hidden = left_third(visible)
    frame = with_depth(can_frames[0], hidden, can_truth.translation_m[2] - 0.1)
    mask = mask_of(can_model, can_truth, frame, known=known)
    assert covered(mask, hidden) < 0.1  # a cell may reach over its edge
    assert covered(mask, visible & ~hidden) > 0.9


@pytest.mark.parametrize("known", [True, False])
def test_holes_in_depth_within_the_outline_belong_to_the_object(
    known: bool, can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    visible = can_frames[0].masks["soup_can"]
    rows, columns = np.nonzero(visible)
    hole = np.zeros_like(visible)
    hole[int(rows.mean()) - 6 : int(rows.mean()) + 7, int(columns.mean()) - 6 : int(columns.mean()) + 7] = True
    mask = mask_of(can_model, can_truth, with_depth(can_frames[0], hole, 0), known=known)
    assert mask[hole].all()


def test_an_object_that_was_taken_away_is_gone(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    away = with_depth(can_frames[0], np.ones_like(can_frames[0].depth_m, bool), can_truth.translation_m[2] + 0.3)
    for known in (True, False):
        assert str(outlined(can_model, can_truth, away, known=known)).startswith("gone")


def test_an_object_behind_a_screen_is_hidden(can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose) -> None:
    screen = with_depth(can_frames[0], np.ones_like(can_frames[0].depth_m, bool), can_truth.translation_m[2] - 0.2)
    for known in (True, False):
        assert str(outlined(can_model, can_truth, screen, known=known)).startswith("hidden")


def test_without_depth_neither_is_said(can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose) -> None:
    nothing = with_depth(can_frames[0], np.ones_like(can_frames[0].depth_m, bool), 0)
    assert str(outlined(can_model, can_truth, nothing)).startswith("no depth")


def test_beside_and_behind_the_camera_it_is_out_of_view(
    can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose
) -> None:
    for shift_m in ((2, 0, 0), (-2, 0, 0), (0, 2, 0), (0, -2, 0), (0, 0, -3)):
        away = can_truth.nudged(np.array((0, 0, 0, *shift_m)))
        assert outlined(can_model, away, can_frames[0]) == "out of view"


def test_before_the_lens_it_is_too_near(can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose) -> None:
    """Its cells would be many pixels wide and reach far beyond the picture; no array of that size is made."""
    for distance_m in (0.05, 0.062, 0.08):
        near = Pose(can_truth.rotation, np.array((0, 0, distance_m)))
        found = outlined(can_model, near, can_frames[0])
        assert isinstance(found, str), distance_m
        assert found.startswith(("too near", "gone", "out of view"))


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("centre_px", [(0, 120), (160, 0), (319, 120), (160, 239), (0, 0), (319, 239), (-12, 250)])
def test_an_object_partly_outside_the_picture_is_what_is_inside(
    centre_px: tuple[int, int], known: bool, globe: Callable[..., PosedFrame], globe_model: ConceptModel
) -> None:
    column, row = centre_px
    x, y = (column - 159.5) * 0.5 / 300, (row - 119.5) * 0.5 / 300
    drawn = globe(facing(30, (x, y, 0.5)))
    mask = mask_of(globe_model, drawn.T_cam_obj, drawn.frame, known=known)
    assert overlap(mask, drawn.mask) > 0.8
    touches = (mask[:, 0].any(), mask[0].any(), mask[:, -1].any(), mask[-1].any())
    assert touches == (column <= 0, row <= 0, column >= 319, row >= 239)


def test_the_frame_is_left_as_it_was(can_model: ConceptModel, can_frames: list[Frame], can_truth: Pose) -> None:
    """It is not written to: arrays that cannot be written are no obstacle."""
    frame = replace(can_frames[0], rgb=can_frames[0].rgb.copy(), depth_m=can_frames[0].depth_m.copy())
    frame.rgb.setflags(write=False)
    frame.depth_m.setflags(write=False)
    for known in (True, False):
        expected = mask_of(can_model, can_truth, can_frames[0], known=known)
        assert np.array_equal(mask_of(can_model, can_truth, frame, known=known), expected)
    assert np.array_equal(frame.depth_m, can_frames[0].depth_m)


def test_it_scales_with_the_picture(can_model: ConceptModel, can_scene: SyntheticScene, can_truth: Pose) -> None:
    """Every pixel made two by two: the same mask, as cells are a share of the object and not of the picture."""
    frame = can_scene[20]
    twice = np.ones((2, 2))
    camera = frame.intrinsics
    larger = replace(
        camera,
        fx=2 * camera.fx,
        fy=2 * camera.fy,
        cx=2 * camera.cx + 0.5,
        cy=2 * camera.cy + 0.5,
        width=2 * camera.width,
        height=2 * camera.height,
    )
    enlarged = replace(
        frame,
        rgb=np.kron(frame.rgb, twice[:, :, None]).astype(np.uint8),
        depth_m=np.kron(frame.depth_m, twice).astype(np.float32),
        intrinsics=larger,
        masks={object_id: np.kron(mask, twice).astype(bool) for object_id, mask in frame.masks.items()},
    )
    visible = enlarged.masks["soup_can"]
    assert overlap(mask_of(can_model, can_truth, enlarged), visible) > 0.85
