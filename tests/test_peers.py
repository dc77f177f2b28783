"""The methods that stand beside the tracker: near the truth where they can be, and a reason where they cannot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from eval.peers import METHODS, Method, method_kind, open_method
from eval.peers.icp import IcpConfig, LastPoseIcp
from eval.peers.surfaces import SeenSurface, see_surface
from reference.onboard import onboard, read_reference_frames
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, FrameError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.result import TrackResult, TrackState
from tracker.saliency import SaliencyBackend
from tracker.sources.synthetic import SyntheticScene, open_scene

BOX = "tea_box"
PEERS = [name for name in METHODS if name != "ours"]
WITH_A_START = [name for name in PEERS if method_kind(name).start == "needed"]
CONFIG = TrackerConfig()


@pytest.fixture(scope="module")
def scene() -> SyntheticScene:
    return open_scene(f"turn?size=320x240&object={BOX}")


@pytest.fixture(scope="module")
def model(scene: SyntheticScene, attributes: SaliencyBackend) -> ConceptModel:
    return onboard(read_reference_frames(scene, BOX, 2), attributes)


@pytest.fixture(scope="module")
def frames(scene: SyntheticScene) -> list[Frame]:
    return [scene[index] for index in range(40, 44)]


def truth(scene: SyntheticScene, frame: Frame) -> Pose:
    return scene.sightings(BOX)[frame.index].T_cam_obj


def opened(name: str, model: ConceptModel, backend: SaliencyBackend) -> Method:
    return open_method(name, [model], CONFIG, backend)


def followed(method: Method, frames: Sequence[Frame]) -> list[TrackResult]:
    return [method.step(frame)[0] for frame in frames]


def assert_near(result: TrackResult, T_cam_obj: Pose) -> None:
    assert result.pose is not None, result.reason
    assert result.pose.distance_to_m(T_cam_obj) < 0.003
    assert np.degrees(result.pose.angle_to_rad(T_cam_obj)) < 3


def unmasked(frame: Frame) -> Frame:
    return replace(frame, masks={BOX: np.zeros_like(frame.masks[BOX])})


def painted_grey(frame: Frame) -> Frame:
    return replace(frame, rgb=np.full_like(frame.rgb, 128))


def seen_in(frame: Frame, model: ConceptModel) -> SeenSurface:
    seen = see_surface(frame, model, CONFIG)
    assert isinstance(seen, SeenSurface)
    return seen


@pytest.mark.parametrize("name", PEERS)
def test_a_printed_box_is_followed_to_millimetres_and_degrees(
    name: str, scene: SyntheticScene, model: ConceptModel, frames: list[Frame], attributes: SaliencyBackend
) -> None:
    method = opened(name, model, attributes)
    method.place(BOX, truth(scene, frames[0]), frames[0].stamp_ns)
    for frame, result in zip(frames, followed(method, frames), strict=True):
        assert_near(result, truth(scene, frame))
        assert result.state is TrackState.TRACKING
        assert 0.1 < result.confidence <= 1
        assert (result.stamp_ns, result.object_id) == (frame.stamp_ns, BOX)
        assert result.raw_pose is result.pose
        assert (result.covariance, result.evidence) == (None, None)
        assert result.timings_ms["total"] > 0


@pytest.mark.parametrize("name", [name for name in PEERS if name not in WITH_A_START])
def test_what_searches_every_frame_anew_needs_no_start_and_gives_the_same_twice(
    name: str, scene: SyntheticScene, model: ConceptModel, frames: list[Frame], attributes: SaliencyBackend
) -> None:
    told = opened(name, model, attributes)
    told.place(BOX, Pose(np.diag([1.0, -1.0, -1.0]), np.array([0, 0, 2.0])), 0)
    for method in (told, opened(name, model, attributes)):
        (result,) = followed(method, frames[1:2])
        assert_near(result, truth(scene, frames[1]))
    (again,) = followed(opened(name, model, attributes), frames[1:2])
    assert again.pose is not None
    assert result.pose is not None
    assert np.array_equal(again.pose.matrix, result.pose.matrix)


@pytest.mark.parametrize("name", PEERS)
def test_a_frame_that_does_not_show_the_object_has_no_pose_but_a_reason(
    name: str, scene: SyntheticScene, model: ConceptModel, frames: list[Frame], attributes: SaliencyBackend
) -> None:
    method = opened(name, model, attributes)
    method.place(BOX, truth(scene, frames[0]), 0)
    no_depth = replace(frames[2], depth_m=np.zeros_like(frames[2].depth_m))
    results = followed(method, [unmasked(frames[0]), frames[1], no_depth, replace(frames[3], masks={})])
    states = [TrackState.INITIALISING, TrackState.TRACKING, TrackState.LOST, TrackState.LOST]
    assert [result.state for result in results] == states
    for k, reason in ((0, "the mask is empty"), (2, "no depth"), (3, f"no mask of object '{BOX}'")):
        assert reason in results[k].reason
        assert (results[k].pose, results[k].raw_pose, results[k].confidence) == (None, None, 0)


def test_an_object_without_print_gives_sift_no_pose(
    scene: SyntheticScene, frames: list[Frame], attributes: SaliencyBackend
) -> None:
    grey = [replace(f, frame=painted_grey(f.frame)) for f in read_reference_frames(scene, BOX, 2)]
    method = opened("sift", onboard(grey, attributes), attributes)
    for result in followed(method, [painted_grey(frame) for frame in frames[:2]]):
        assert result.pose is None
        assert "too few features" in result.reason


@pytest.mark.parametrize("name", WITH_A_START)
def test_what_goes_on_from_a_pose_has_none_before_it_is_told(
    name: str, model: ConceptModel, frames: list[Frame], attributes: SaliencyBackend
) -> None:
    (result,) = followed(opened(name, model, attributes), frames[:1])
    assert result.pose is None
    assert result.state is TrackState.INITIALISING
    assert "no pose to start from" in result.reason


@pytest.mark.parametrize("name", WITH_A_START)
def test_after_a_loss_the_last_good_pose_is_gone_on_from(
    name: str, scene: SyntheticScene, model: ConceptModel, frames: list[Frame], attributes: SaliencyBackend
) -> None:
    method = opened(name, model, attributes)
    method.place(BOX, truth(scene, frames[0]), frames[0].stamp_ns)
    noise_m = np.random.default_rng(0).uniform(-0.06, 0.06, frames[1].depth_m.shape).astype(np.float32)
    noisy = replace(frames[1], depth_m=np.maximum(frames[1].depth_m + noise_m, 0))
    first, lost, found = followed(method, [frames[0], noisy, frames[2]])
    assert_near(first, truth(scene, frames[0]))
    assert (lost.pose, lost.state) == (None, TrackState.LOST)
    assert "poor fit" in lost.reason
    assert_near(found, truth(scene, frames[2]))


def test_icp_reaches_an_object_that_is_most_of_its_size_away(
    scene: SyntheticScene, model: ConceptModel, frames: list[Frame]
) -> None:
    away = Pose(np.eye(3), np.array([0.6, 0.3, 0.0]) * model.diameter_m) @ truth(scene, frames[0])
    fit = LastPoseIcp(model, IcpConfig()).best(away, seen_in(frames[0], model))
    assert fit is not None
    assert fit.fitness > 0.9
    assert fit.T_cam_obj.distance_to_m(truth(scene, frames[0])) < 0.003


@pytest.mark.parametrize("name", PEERS)
def test_whom_and_when_it_is_told_of_is_checked(
    name: str, model: ConceptModel, frames: list[Frame], attributes: SaliencyBackend
) -> None:
    method = opened(name, model, attributes)
    with pytest.raises(ConfigError, match=f"no model of object 'spoon'.* {BOX}"):
        method.place("spoon", Pose.identity(), 0)
    method.step(unmasked(frames[1]))
    with pytest.raises(FrameError, match="before the last frame"):
        method.place(BOX, Pose.identity(), frames[0].stamp_ns)
    with pytest.raises(FrameError, match="not after the last one"):
        method.step(unmasked(frames[1]))


def test_a_method_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(ConfigError, match="no method 'best'; expected one of ours, sift, fpfh, icp, colored-icp"):
        method_kind("best")


def test_a_protocol_says_of_every_method_what_it_is_run_with(attributes: SaliencyBackend) -> None:
    for name in METHODS:
        kind = method_kind(name)
        stated = kind.stated(CONFIG, attributes, None, "gt")
        assert stated["method_settings"]
        assert str(stated["initialisation"]).startswith("gt")
        assert ("ignores" in str(stated["initialisation"])) == (name in ("sift", "fpfh"))
        assert (stated["backend"] == "not used by the method") == (name != "ours")
        assert stated["prior"] == ("off" if name in ("sift", "fpfh") else "on")
    without_prior = method_kind("ours").stated(TrackerConfig(prior=False), attributes, None, "estimated")
    assert without_prior["prior"] == "off"
    assert str(without_prior["initialisation"]).startswith("estimated")
