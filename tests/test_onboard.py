"""From reference frames to a model of the thing itself: its true surface, its size, and nothing of its surroundings."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial import KDTree

from reference.onboard import onboard, read_reference_frames
from tracker.concept import ConceptModel
from tracker.errors import OnboardingError, SourceError
from tracker.frame import Mask, PosedFrame
from tracker.geometry import Floats, Pose
from tracker.saliency import SaliencyBackend
from tracker.sources.bop import BopScene
from tracker.sources.synthetic import SyntheticScene
from tracker.view import ViewConfig

AHEAD = Pose(np.eye(3), np.array([0.0123, -0.0071, 0.3512]))


@pytest.fixture(scope="module")
def balls(globe: Callable[..., PosedFrame]) -> list[PosedFrame]:
    """A ball from its front and from two sides."""
    turns = (Pose.exp([0, angle_rad, 0, 0, 0, 0]) for angle_rad in (0.0, 0.9, -0.9))
    return [globe(AHEAD @ turn, index=k) for k, turn in enumerate(turns)]


@pytest.fixture(scope="module")
def ball_model(balls: list[PosedFrame], attributes: SaliencyBackend) -> ConceptModel:
    return onboard(balls, attributes)


def with_depth(frame: PosedFrame, depth_m: Floats) -> PosedFrame:
    return replace(frame, frame=replace(frame.frame, depth_m=depth_m.astype(np.float32)))


def with_mask(frame: PosedFrame, mask: Mask) -> PosedFrame:
    return replace(frame, mask=mask)


def farther(frame: PosedFrame, by_m: float) -> PosedFrame:
    """The same picture, said to show the object farther away than it does."""
    return replace(frame, T_cam_obj=Pose(np.eye(3), np.array([0, 0, by_m])) @ frame.T_cam_obj)


def same(a: ConceptModel, b: ConceptModel) -> bool:
    names = ("points", "normals", "colours", "saliency", "view_count", "agreement", "view_directions")
    return a.notes == b.notes and all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)


def test_the_model_of_a_ball_is_the_ball(ball_model: ConceptModel) -> None:
    outwards = ball_model.points / 0.05
    assert ball_model.diameter_m == pytest.approx(0.1, rel=0.02)
    assert np.linalg.norm(outwards, axis=1) == pytest.approx(1, abs=0.02)
    assert (ball_model.normals * outwards).sum(axis=1).min() > np.cos(np.radians(15))
    to_camera = -AHEAD.translation_m / np.linalg.norm(AHEAD.translation_m)
    assert np.allclose(ball_model.view_directions[0], to_camera)
    assert np.allclose(ball_model.view_directions[1], Pose.exp([0, -0.9, 0, 0, 0, 0]).rotation @ to_camera)
    assert set(np.unique(ball_model.view_count)) == {1, 2, 3}
    assert len(ball_model) > 1500


def test_the_model_knows_where_it_is_from_and_how_good_it_is(
    ball_model: ConceptModel, attributes: SaliencyBackend
) -> None:
    ball_model.require_backend(attributes)
    assert (ball_model.object_id, ball_model.labels) == ("globe", attributes.labels_for(None))
    assert ball_model.notes["reference_frames"] == [f"frame {k} of globe {k}" for k in range(3)]
    assert ball_model.notes["quality"]["points"] == len(ball_model)
    assert ball_model.notes["quality"]["problems"] == []
    assert ball_model.notes == json.loads(json.dumps(ball_model.notes))


def test_onboarding_again_gives_the_same_model_to_the_bit(
    balls: list[PosedFrame], ball_model: ConceptModel, attributes: SaliencyBackend
) -> None:
    assert same(onboard(balls, attributes), ball_model)


def test_the_model_moves_with_the_object_s_axes(
    balls: list[PosedFrame], ball_model: ConceptModel, attributes: SaliencyBackend
) -> None:
    G = Pose.exp([0.5, -1.2, 2.0, 0.3, -0.1, 0.2])
    moved = onboard([replace(ball, T_cam_obj=ball.T_cam_obj @ G.inverse()) for ball in balls], attributes)
    assert moved.diameter_m == pytest.approx(ball_model.diameter_m, abs=1e-9)
    assert np.allclose(moved.points, G @ ball_model.points, atol=1e-8)
    assert np.allclose(moved.normals, ball_model.normals @ G.rotation.T, atol=1e-6)
    assert np.allclose(moved.saliency, ball_model.saliency, atol=1e-4)
    assert np.array_equal(moved.view_count, ball_model.view_count)


def test_another_first_frame_gives_the_same_surface_with_the_same_concepts(
    balls: list[PosedFrame], ball_model: ConceptModel, attributes: SaliencyBackend
) -> None:
    other = onboard(balls[::-1], attributes)
    assert other.diameter_m == pytest.approx(ball_model.diameter_m, abs=1e-9)
    distances_m, nearest = KDTree(other.points).query(ball_model.points)
    assert distances_m.max() < 3 * 0.1 / 64
    assert np.abs(other.saliency[nearest] - ball_model.saliency).mean() < 0.02


def test_the_model_of_a_rendered_mug_lies_on_the_mug_and_covers_what_was_seen(
    table_scene: SyntheticScene, table_models: dict[str, ConceptModel]
) -> None:
    for object_id, model in table_models.items():
        shape = table_scene.shape(object_id)
        distances_m, _ = KDTree(shape.points_m).query(model.points)
        assert np.median(distances_m) < 0.002, object_id
        assert np.quantile(distances_m, 0.99) < 0.006, object_id
        assert 0.8 * shape.diameter_m < model.diameter_m < 1.05 * shape.diameter_m, object_id
        covered_m, _ = KDTree(model.points).query(shape.points_m)
        assert (covered_m < 0.006).mean() > 0.35, object_id


def test_a_piece_of_the_wall_in_one_frame_s_mask_does_no_harm(
    balls: list[PosedFrame], ball_model: ConceptModel, attributes: SaliencyBackend
) -> None:
    dirty = balls[0].mask.copy()
    dirty[100:140, 200:260] = True
    wall = with_depth(balls[0], np.where(balls[0].mask, balls[0].frame.depth_m, 0.40))
    model = onboard([with_mask(wall, dirty), *balls[1:]], attributes)
    assert model.diameter_m == pytest.approx(ball_model.diameter_m, rel=0.03)
    assert np.linalg.norm(model.points, axis=1).max() < 0.053


def test_a_ragged_mask_and_holes_in_the_depth_make_the_same_ball(
    balls: list[PosedFrame], attributes: SaliencyBackend
) -> None:
    rng = np.random.default_rng(0)
    ragged = []
    for ball in balls:
        kernel = np.ones((3, 3), np.uint8)
        wide, narrow = (change(ball.mask.astype(np.uint8), kernel) > 0 for change in (cv2.dilate, cv2.erode))
        mask = np.where(rng.random(ball.mask.shape) < 0.5, wide, narrow)
        depth_m = np.where(rng.random(ball.mask.shape) < 0.2, 0, ball.frame.depth_m)
        ragged.append(with_mask(with_depth(ball, depth_m), mask))
    model = onboard(ragged, attributes)
    assert model.diameter_m == pytest.approx(0.1, rel=0.06)
    radius_m = np.linalg.norm(model.points, axis=1)
    assert np.quantile(np.abs(radius_m - 0.05), 0.99) < 0.003


def test_a_finer_view_makes_a_denser_model(globe: Callable[..., PosedFrame], attributes: SaliencyBackend) -> None:
    near = [globe(Pose(np.eye(3), np.array([0, 0, 0.2])))]
    coarse, fine = (onboard(near, attributes, ViewConfig(pixels_across=pixels)) for pixels in (24, 72))
    assert len(fine) > 4 * len(coarse)
    assert fine.diameter_m == pytest.approx(coarse.diameter_m, rel=0.03)


def test_one_view_makes_a_model_and_a_warning(
    balls: list[PosedFrame], attributes: SaliencyBackend, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        model = onboard(balls[:1], attributes)
    assert "model of object 'globe': one reference view" in caplog.text
    assert "one reference view" in model.notes["quality"]["problems"][0]
    assert (model.points[:, 2] < 0.01).all()


def test_poses_that_contradict_each_other_are_told(
    balls: list[PosedFrame], attributes: SaliencyBackend, caplog: pytest.LogCaptureFixture
) -> None:
    onboard([balls[0], farther(balls[1], 0.03)], attributes)
    assert "their poses or masks contradict each other" in caplog.text


def test_poses_that_are_metres_apart_make_no_model(balls: list[PosedFrame], attributes: SaliencyBackend) -> None:
    with pytest.raises(OnboardingError, match=r"no usable model of object 'globe': only \d+ surface points"):
        onboard([balls[0], farther(balls[1], 3.0)], attributes)


def test_without_frames_there_is_no_model(attributes: SaliencyBackend) -> None:
    with pytest.raises(OnboardingError, match="at least one reference frame"):
        onboard([], attributes)


def small(mask: Mask, pixels: int) -> Mask:
    kept = np.zeros_like(mask)
    kept.ravel()[np.flatnonzero(mask)[1000 : 1000 + pixels]] = True
    return kept


def test_a_frame_that_shows_too_little_is_refused_by_its_name(
    balls: list[PosedFrame], attributes: SaliencyBackend
) -> None:
    good, bad = balls[0], balls[1]
    hidden = with_depth(bad, np.where(bad.mask, 0, bad.frame.depth_m))
    cases = {
        "the mask is empty": with_mask(bad, np.zeros_like(bad.mask)),
        "49 masked pixels have depth, 50 are needed": with_mask(bad, small(bad.mask, 49)),
        "0 masked pixels have depth, 50 are needed": hidden,
    }
    for complaint, frame in cases.items():
        with pytest.raises(OnboardingError, match=f"reference frame globe 1, object 'globe': {complaint}"):
            onboard([good, frame], attributes)


def test_reference_frames_are_the_chosen_ones_with_their_masks_and_poses(table_scene: SyntheticScene) -> None:
    frames = read_reference_frames(table_scene, "mug", 3)
    assert len(frames) == 3
    for frame in frames:
        sighting = table_scene.sightings("mug")[frame.frame.index]
        assert np.array_equal(frame.T_cam_obj.matrix, sighting.T_cam_obj.matrix)
        assert np.array_equal(frame.mask, frame.frame.masks["mug"])
    with pytest.raises(SourceError, match="no poses of object 'spoon'"):
        read_reference_frames(table_scene, "spoon", 2)


def test_a_recording_without_masks_is_refused(bop_dataset: Path) -> None:
    info = bop_dataset / "test" / "000003" / "scene_gt_info.json"
    info.write_text(info.read_text().replace("180", "900").replace("360", "900"))
    with pytest.raises(OnboardingError, match="image 2 has no mask of object '4'"):
        read_reference_frames(BopScene(bop_dataset, 3, masks="none"), "4", 1)


@pytest.mark.shared_data
def test_a_cube_of_a_real_recording_has_the_cube_s_size(shared_data: Path, attributes: SaliencyBackend) -> None:
    model = onboard(read_reference_frames(BopScene(shared_data / "rbt", 1), "1", 2), attributes)
    assert model.diameter_m == pytest.approx(0.085 * np.sqrt(3), rel=0.08)
    assert np.quantile(np.abs(model.points).max(axis=1), 0.95) < 0.085 / 2 + 0.008
