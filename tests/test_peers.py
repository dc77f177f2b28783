"""The methods that stand beside the tracker: near the truth where they can be, and a reason where they cannot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from eval.peers import METHODS, Method, method_kind, open_method
from eval.peers.colored_icp import ColoredIcp, ColoredIcpConfig
from eval.peers.icp import IcpConfig, LastPoseIcp
from eval.peers.surfaces import Fit, SeenSurface, see_surface
from reference.onboard import onboard, read_reference_frames
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, FrameError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.result import TrackResult, TrackState
from tracker.saliency import SaliencyBackend
from tracker.sources.synthetic import SyntheticScene, open_scene
from tracker.stopwatch import Stopwatch

BOX = "tea_box"
PEERS = [name for name in METHODS if name != "ours"]
WITH_A_START = [name for name in PEERS if method_kind(name).start == "needed"]
CONFIG = TrackerConfig()


@dataclass(frozen=True)
class Shown:
    """An object that turns and travels before the camera, a model of five frames, and four other frames."""

    object_id: str
    scene: SyntheticScene
    model: ConceptModel
    frames: list[Frame]

    def truth(self, frame: Frame) -> Pose:
        return self.scene.sightings(self.object_id)[frame.index].T_cam_obj


def show(object_id: str, backend: SaliencyBackend) -> Shown:
    scene = open_scene(f"turn?size=320x240&object={object_id}")
    model = onboard(read_reference_frames(scene, object_id, 5), backend)
    return Shown(object_id, scene, model, [scene[index] for index in range(40, 44)])


@pytest.fixture(scope="module")
def box(attributes: SaliencyBackend) -> Shown:
    return show(BOX, attributes)


@pytest.fixture(scope="module")
def shown(box: Shown, attributes: SaliencyBackend) -> dict[str, Shown]:
    """By method. By geometry alone, which is all that fpfh has, a box is the same after half a turn."""
    return {**dict.fromkeys(PEERS, box), "fpfh": show("clamp", attributes)}


def opened(name: str, model: ConceptModel, backend: SaliencyBackend) -> Method:
    return open_method(name, [model], CONFIG, backend)


def followed(method: Method, frames: Sequence[Frame]) -> list[TrackResult]:
    return [method.step(frame)[0] for frame in frames]


def assert_near(result: TrackResult, T_cam_obj: Pose) -> None:
    assert result.pose is not None, result.reason
    assert result.pose.distance_to_m(T_cam_obj) < 0.003
    assert np.degrees(result.pose.angle_to_rad(T_cam_obj)) < 3


def unmasked(frame: Frame) -> Frame:
    return replace(frame, masks={object_id: np.zeros_like(mask) for object_id, mask in frame.masks.items()})


def painted_grey(frame: Frame) -> Frame:
    return replace(frame, rgb=np.full_like(frame.rgb, 128))


@pytest.mark.parametrize("name", PEERS)
def test_an_object_is_followed_to_millimetres_and_degrees(
    name: str, shown: dict[str, Shown], attributes: SaliencyBackend
) -> None:
    it = shown[name]
    method = opened(name, it.model, attributes)
    method.place(it.object_id, it.truth(it.frames[0]), it.frames[0].stamp_ns)
    for frame, result in zip(it.frames, followed(method, it.frames), strict=True):
        assert_near(result, it.truth(frame))
        assert result.state is TrackState.TRACKING
        assert 0.1 < result.confidence <= 1
        assert (result.stamp_ns, result.object_id) == (frame.stamp_ns, it.object_id)
        assert result.raw_pose is result.pose
        assert (result.covariance, result.grounds) == (None, None)
        assert result.timings_ms["total"] > 0


@pytest.mark.parametrize("name", [name for name in PEERS if name not in WITH_A_START])
def test_what_searches_every_frame_anew_heeds_no_start_and_gives_the_same_twice(
    name: str, shown: dict[str, Shown], attributes: SaliencyBackend
) -> None:
    it = shown[name]
    told, untold = (opened(name, it.model, attributes) for _ in range(2))
    told.place(it.object_id, Pose(np.diag([1.0, -1.0, -1.0]), np.array([0, 0, 2.0])), 0)
    one, other = (followed(method, it.frames[1:2])[0] for method in (told, untold))
    assert_near(one, it.truth(it.frames[1]))
    assert one.pose is not None
    assert other.pose is not None
    assert np.array_equal(one.pose.matrix, other.pose.matrix)


@pytest.mark.parametrize("name", PEERS)
def test_a_frame_that_does_not_show_the_object_has_no_pose_but_a_reason(
    name: str, shown: dict[str, Shown], attributes: SaliencyBackend
) -> None:
    it = shown[name]
    method = opened(name, it.model, attributes)
    method.place(it.object_id, it.truth(it.frames[0]), 0)
    no_depth = replace(it.frames[2], depth_m=np.zeros_like(it.frames[2].depth_m))
    spoiled = [unmasked(it.frames[0]), it.frames[1], no_depth, replace(it.frames[3], masks={})]
    results = followed(method, spoiled)
    states = [TrackState.INITIALISING, TrackState.TRACKING, TrackState.LOST, TrackState.LOST]
    assert [result.state for result in results] == states
    for k, reason in ((0, "the mask is empty"), (2, "no depth"), (3, f"no mask of object '{it.object_id}'")):
        assert reason in results[k].reason
        assert (results[k].pose, results[k].raw_pose, results[k].confidence) == (None, None, 0)


def test_an_object_without_print_gives_sift_no_pose(box: Shown, attributes: SaliencyBackend) -> None:
    grey = [replace(view, frame=painted_grey(view.frame)) for view in box.model.references]
    method = opened("sift", replace(box.model, references=tuple(grey)), attributes)
    for result in followed(method, [painted_grey(frame) for frame in box.frames[:2]]):
        assert result.pose is None
        assert "too few features" in result.reason


@pytest.mark.parametrize("name", WITH_A_START)
def test_what_goes_on_from_a_pose_has_none_before_it_is_told(
    name: str, box: Shown, attributes: SaliencyBackend
) -> None:
    (result,) = followed(opened(name, box.model, attributes), box.frames[:1])
    assert result.pose is None
    assert result.state is TrackState.INITIALISING
    assert "no pose to start from" in result.reason


@pytest.mark.parametrize("name", PEERS)
def test_depth_that_is_no_surface_of_the_object_gives_no_pose_and_the_next_frame_does(
    name: str, shown: dict[str, Shown], attributes: SaliencyBackend
) -> None:
    """What goes on from the last pose goes on from the last good one."""
    it = shown[name]
    method = opened(name, it.model, attributes)
    method.place(it.object_id, it.truth(it.frames[0]), it.frames[0].stamp_ns)
    noise_m = np.random.default_rng(0).uniform(-0.06, 0.06, it.frames[1].depth_m.shape).astype(np.float32)
    noisy = replace(it.frames[1], depth_m=np.maximum(it.frames[1].depth_m + noise_m, 0))
    first, lost, found = followed(method, [it.frames[0], noisy, it.frames[2]])
    assert_near(first, it.truth(it.frames[0]))
    assert (lost.pose, lost.state) == (None, TrackState.LOST)
    assert "poor fit" in lost.reason or "too few features" in lost.reason
    assert_near(found, it.truth(it.frames[2]))


def test_icp_reaches_an_object_that_is_most_of_its_size_away(box: Shown) -> None:
    T_true = box.truth(box.frames[0])
    seen = see_surface(box.frames[0], box.model, CONFIG)
    assert isinstance(seen, SeenSurface)
    away = Pose(np.eye(3), np.array([0.6, 0.3, 0.0]) * box.model.diameter_m) @ T_true
    fit = LastPoseIcp(box.model, IcpConfig()).best(away, seen)
    assert fit is not None
    assert fit.fitness > 0.9
    assert fit.T_cam_obj.distance_to_m(T_true) < 0.003


def test_where_colored_icp_loses_every_pair_the_pose_before_it_stands(box: Shown) -> None:
    seen = see_surface(box.frames[0], box.model, CONFIG)
    assert isinstance(seen, SeenSurface)
    T_true = box.truth(box.frames[0])
    without_reach = ColoredIcp(box.model, ColoredIcpConfig(reaches=(1e-12,) * 3))
    fit = without_reach(seen, T_true, Stopwatch())
    assert isinstance(fit, Fit)
    approach = LastPoseIcp(box.model, IcpConfig()).best(T_true, seen)
    assert approach is not None
    assert np.array_equal(fit.T_cam_obj.matrix, approach.T_cam_obj.matrix)


@pytest.mark.parametrize("name", PEERS)
def test_whom_and_when_it_is_told_of_is_checked(name: str, box: Shown, attributes: SaliencyBackend) -> None:
    method = opened(name, box.model, attributes)
    with pytest.raises(ConfigError, match=f"no model of object 'spoon'.* {BOX}"):
        method.place("spoon", Pose.identity(), 0)
    method.step(unmasked(box.frames[1]))
    with pytest.raises(FrameError, match="before the last frame"):
        method.place(BOX, Pose.identity(), box.frames[0].stamp_ns)
    with pytest.raises(FrameError, match="not after the last one"):
        method.step(unmasked(box.frames[1]))


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
