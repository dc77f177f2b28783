"""A real recording as a bag: the same frames, and tracked to the same poses, as from where it came."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reference.onboard import onboard, read_reference_frames
from tests.ros_bags import (
    CAMERA_INFO,
    COLOUR,
    DEPTH,
    IMAGE,
    INFO,
    START_NS,
    Recorded,
    camera_info,
    image,
    write_bag,
)
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult
from tracker.saliency import SaliencyBackend
from tracker.sources.bop import BopScene
from tracker.sources.rosbag import RosBag

FRAMES = 10


def messages(frames: Sequence[Frame]) -> Iterator[Recorded]:
    """Raw encodings; depth in the recording's own unit, which is a millimetre."""
    camera = frames[0].intrinsics
    k = tuple(map(float, camera.matrix.ravel()))
    yield Recorded(INFO, CAMERA_INFO, camera_info(width=camera.width, height=camera.height, k=k), START_NS)
    for frame in frames:
        stamp_ns, depth = START_NS + frame.stamp_ns, (frame.depth_m * 1000).round().astype(np.uint16)
        yield Recorded(COLOUR, IMAGE, image(frame.rgb, "rgb8", stamp_ns), stamp_ns + 1)
        yield Recorded(DEPTH, IMAGE, image(depth, "16UC1", stamp_ns), stamp_ns + 2)


def track(models: Sequence[ConceptModel], backend: SaliencyBackend, frames: Sequence[Frame]) -> list[TrackResult]:
    tracker = ObjectTracker(models, TrackerConfig(masks="carried"), backend)
    return [result for frame in frames for result in tracker.step(frame)]


@pytest.mark.shared_data
@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_a_recording_is_tracked_alike_from_a_bag(
    kind: str, shared_data: Path, attributes: SaliencyBackend, tmp_path: Path
) -> None:
    scene = BopScene(shared_data / "rbt", 1)
    given = [scene[index] for index in range(FRAMES)]
    given = [given[0], *(replace(frame, masks={}) for frame in given[1:])]  # the first alone points the objects out
    played = list(RosBag(str(write_bag(tmp_path, kind, messages(given)))))
    for frame, bagged in zip(given, played, strict=True):
        assert (bagged.rgb == frame.rgb).all()
        assert (bagged.depth_m == frame.depth_m).all()
        assert bagged.intrinsics == frame.intrinsics
        assert bagged.stamp_ns == START_NS + frame.stamp_ns
    played[0] = replace(played[0], masks=given[0].masks)
    models = [onboard(read_reference_frames(scene, object_id, 2), attributes) for object_id in scene.object_ids]
    expected, found = (track(models, attributes, frames) for frames in (given, played))
    assert sum(result.pose is not None for result in expected) == 2 * FRAMES
    for one, other in zip(expected, found, strict=True):
        assert one.state is other.state
        assert one.pose is not None
        assert other.pose is not None
        assert one.pose.distance_to_m(other.pose) < 0.001
        assert np.degrees(one.pose.angle_to_rad(other.pose)) < 0.1
