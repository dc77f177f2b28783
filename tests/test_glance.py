"""Many poses are judged at a glance about as each is when it is looked at closely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from tracker.appearance import ViewAppearance
from tracker.concept import ConceptModel
from tracker.geometry import Pose
from tracker.glance import Glance
from tracker.verification import VerificationConfig, Verifier
from tracker.view import ObjectView, ViewConfig

CONFIG, ACROSS, CPU = VerificationConfig(), ViewConfig().pixels_across, torch.device("cpu")


@pytest.fixture(scope="module")
def glance(can_model: ConceptModel) -> Glance:
    return Glance(can_model, Verifier(can_model, CONFIG, ACROSS).surface, CONFIG, CPU)


def nudges(count: int, most_rad: float, most_m: float) -> list[np.ndarray]:
    """From none to the most, in any direction."""
    rng = np.random.default_rng(5)
    six = rng.normal(size=(count, 6))
    six[:, :3] *= most_rad / np.linalg.norm(six[:, :3], axis=1, keepdims=True)
    six[:, 3:] *= most_m / np.linalg.norm(six[:, 3:], axis=1, keepdims=True)
    return list(six * np.linspace(0, 1, count)[:, None])


def judged(glance: Glance, poses: list[Pose], view: ObjectView, *, masked: bool = True) -> np.ndarray:
    return glance(glance.motions(poses), view, ViewAppearance(view), masked=masked).numpy()


def test_scores_are_about_those_of_a_closer_look(
    glance: Glance, can_model: ConceptModel, can_view: ObjectView, can_truth: Pose
) -> None:
    poses = [can_truth.nudged(nudge) for nudge in nudges(40, 1.0, 0.05)]
    verify, appearance = Verifier(can_model, CONFIG, ACROSS), ViewAppearance(can_view)
    close = [verify(pose, can_view, appearance) for pose in poses]
    for masked in (True, False):
        rough = judged(glance, poses, can_view, masked=masked)
        exact = np.array([evidence.score if masked else evidence.of_itself for evidence in close])
        assert np.abs(rough - exact).mean() < 0.06
        assert np.corrcoef(rough, exact)[0, 1] > 0.95
        assert rough.argmax() < 4


def test_fewer_points_say_about_the_same(glance: Glance, can_view: ObjectView, can_truth: Pose) -> None:
    motions = glance.motions([can_truth.nudged(nudge) for nudge in nudges(40, 1.0, 0.05)])
    appearance = ViewAppearance(can_view)
    all_of_them, few = (glance(motions, can_view, appearance, masked=True, points=n).numpy() for n in (256, 48))
    assert np.corrcoef(all_of_them, few)[0, 1] > 0.9


def test_each_pose_is_judged_as_if_it_were_the_only_one(
    glance: Glance, can_view: ObjectView, can_truth: Pose, monkeypatch: pytest.MonkeyPatch
) -> None:
    poses = [can_truth.nudged(nudge) for nudge in nudges(7, 1.0, 0.05)]
    together = judged(glance, poses, can_view)
    assert together == pytest.approx([judged(glance, [pose], can_view)[0] for pose in poses], abs=1e-6)
    monkeypatch.setattr("tracker.glance.BLOCK", 2 * 256)  # block by block
    assert judged(glance, poses, can_view) == pytest.approx(together, abs=1e-6)
    assert judged(glance, [], can_view).shape == (0,)


def test_what_is_hidden_does_not_count_and_what_is_seen_through_does(
    glance: Glance, can_view: ObjectView, can_truth: Pose
) -> None:
    half = can_view.mask & (np.arange(can_view.mask.shape[1]) < np.median(np.nonzero(can_view.mask)[1]))
    columns = np.arange(can_view.inside.shape[1]) < can_view.inside.shape[1] / 2
    scores = {}
    for name, factor in (("hidden", 0.7), ("seen through", 1.5)):
        depth_m = np.where(half, can_view.frame.depth_m * np.float32(factor), can_view.frame.depth_m)
        view = replace(can_view, inside=can_view.inside & ~columns, frame=replace(can_view.frame, depth_m=depth_m))
        scores[name] = judged(glance, [can_truth], view)[0]
    (whole,) = judged(glance, [can_truth], can_view)
    assert scores["hidden"] > 0.9 * whole
    assert scores["seen through"] < 0.7 * whole


def test_brighter_light_makes_no_difference_and_another_colour_does(
    glance: Glance, can_view: ObjectView, can_truth: Pose
) -> None:
    as_it_is, brighter, inverted = (
        judged(glance, [can_truth], replace(can_view, rgb=rgb))[0]
        for rgb in (can_view.rgb, np.minimum(can_view.rgb * 1.15, 255), 255 - can_view.rgb)
    )
    assert brighter > 0.9 * as_it_is
    assert inverted < 0.5 * as_it_is


def test_what_the_camera_cannot_see_is_worth_nothing(glance: Glance, can_view: ObjectView, can_truth: Pose) -> None:
    behind = Pose(can_truth.rotation, can_truth.translation_m * (1, 1, -1))
    beside = can_truth.nudged(np.array((0, 0, 0, 5.0, 0, 0)))
    assert judged(glance, [behind, beside], can_view) == pytest.approx([0, 0], abs=1e-6)
