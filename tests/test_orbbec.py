"""Orbbec's pictures become frames: paired by stamps, in metres, copied, undistorted; what goes wrong is a sentence.

There is no camera of software in the SDK; `tests/software_orbbec.py` stands in for it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.software_orbbec import (
    HEIGHT,
    PERIOD_US,
    WIDTH,
    Distortions,
    Kinds,
    Shown,
    SoftwareFrame,
    SoftwareFrames,
    SoftwareSDK,
)
from tracker.errors import MissingExtraError, SourceError
from tracker.frame import Frame
from tracker.sources import LiveSource, open_source
from tracker.sources.orbbec import OrbbecCamera, OrbbecRecording


def colour(k: int, kind: Kinds = Kinds.RGB, late_us: int = 0, **changed: Any) -> SoftwareFrame:
    """The k-th is (k, 20, 30)."""
    rgb = np.full((HEIGHT, WIDTH, 3), (k, 20, 30), np.uint8)
    pictures = {
        Kinds.RGB: lambda: rgb,
        Kinds.BGR: lambda: rgb[:, :, ::-1],
        Kinds.BGRA: lambda: cv2.cvtColor(rgb, cv2.COLOR_RGB2BGRA),
        Kinds.MJPG: lambda: cv2.imencode(".jpg", np.ascontiguousarray(rgb[:, :, ::-1]))[1],
        Kinds.H264: lambda: rgb,
    }
    data = np.array(pictures[kind](), np.uint8).ravel()
    return SoftwareFrame(data, kind, k * PERIOD_US + late_us, **changed)


def depth(k: int, late_us: int = 0, kind: Kinds = Kinds.Y16, **changed: Any) -> SoftwareFrame:
    """The k-th is 700 + k units away."""
    data = np.full((HEIGHT, WIDTH), 700 + k, np.uint16).view(np.uint8).ravel()
    return SoftwareFrame(data, kind, k * PERIOD_US + late_us, **changed)


def both(*numbers: int, late_us: int = 0) -> list[Shown]:
    return [SoftwareFrames(colour(k), depth(k, late_us)) for k in numbers]


def recorded(*shown: Shown, **options: Any) -> list[Frame]:
    return list(OrbbecRecording(SoftwareSDK(*shown), Path("a.bag"), "orbbec:a.bag", **options))


def numbers(frames: list[Frame]) -> list[tuple[int, int]]:
    """Which colour and which depth picture each frame is of."""
    return [(int(f.rgb[0, 0, 0]), round(float(f.depth_m[0, 0]) * 1000) - 700) for f in frames]


def test_a_recording_gives_its_frames_in_metres_and_with_the_camera_s_time() -> None:
    sdk = SoftwareSDK(*both(1, 2, 3, late_us=2_000))
    frames = list(OrbbecRecording(sdk, Path("a.bag"), "orbbec:a.bag"))
    assert numbers(frames) == [(1, 1), (2, 2), (3, 3)]
    assert [frame.index for frame in frames] == [0, 1, 2]
    first = frames[0]
    assert first.stamp_ns == PERIOD_US * 1000
    assert first.intrinsics.matrix.tolist() == [[60, 0, 23.5], [0, 61, 17], [0, 0, 1]]
    told = first.provenance
    assert (told.clock, told.colour_depth_skew_ns, told.raw_depth_unit_m) == ("camera", -2_000_000, 0.001)
    assert sdk.log.count("start") == sdk.log.count("stop") == 1
    assert {"align to colour", "enable colour", "enable depth", "mode full"} <= set(sdk.log)


def test_colour_that_comes_with_its_neighbour_s_depth_is_paired_anew() -> None:
    shown = [SoftwareFrames(colour(k), depth(k + 1)) for k in range(1, 5)]
    assert numbers(recorded(*shown)) == [(2, 2), (3, 3), (4, 4)]


def test_frames_that_lack_a_picture_are_passed_over() -> None:
    shown = [SoftwareFrames(None, depth(1)), SoftwareFrames(colour(1), None), *both(2, 3)]
    assert numbers(recorded(*shown)) == [(2, 2), (3, 3)]


def test_a_buffer_that_the_sdk_writes_over_does_not_change_a_frame() -> None:
    first = SoftwareFrames(colour(1), depth(1))

    def write_over() -> None:
        for frame in (first.get_color_frame(), first.get_depth_frame()):
            assert frame is not None
            frame.get_data()[:] = 255

    camera = OrbbecCamera(SoftwareSDK(first, write_over, *both(2)), "", "orbbec")
    seen = []
    with pytest.raises(SourceError, match="no pictures"):
        seen.extend(camera)
    assert numbers(seen) == [(1, 1), (2, 2)]


@pytest.mark.parametrize("kind", [Kinds.RGB, Kinds.BGR, Kinds.BGRA, Kinds.MJPG])
def test_colours_are_rgb_whatever_the_format(kind: Kinds) -> None:
    (frame,) = recorded(SoftwareFrames(colour(9, kind), depth(9)))
    assert np.abs(frame.rgb.astype(int) - [9, 20, 30]).max() <= (4 if kind is Kinds.MJPG else 0)


def test_the_scale_is_of_millimetres_and_may_be_overridden() -> None:
    tenths = SoftwareFrames(colour(1), depth(1, scale=0.1))
    assert recorded(tenths)[0].depth_m == pytest.approx(0.0701)
    assert recorded(tenths, depth_unit_m=0.002)[0].depth_m == pytest.approx(1.402)
    with pytest.raises(SourceError, match="the depth scale must be positive, got 0"):
        recorded(SoftwareFrames(colour(1), depth(1, scale=0.0)))


def test_distortion_is_undone_by_its_model() -> None:
    bent = colour(1, model=Distortions.BROWN_CONRADY_K6, k1=0.5, k4=-0.1)
    (frame,) = recorded(SoftwareFrames(bent, depth(1)))
    assert (frame.depth_m == 0).any() or (frame.rgb == 0).any()
    strange = colour(1, model=Distortions.FOUR_EYES)
    with pytest.raises(SourceError, match="distortion FOUR_EYES is not known; known are NONE, BROWN_CONRADY"):
        recorded(SoftwareFrames(strange, depth(1)))


@pytest.mark.parametrize(
    ("shown", "complaint"),
    [
        (SoftwareFrames(colour(1, Kinds.H264), depth(1)), "colour in H264 is not read; MJPG, RGB"),
        (SoftwareFrames(colour(1), depth(1, kind=Kinds.RLE)), "depth in RLE is not read; Y16, Z16"),
        (
            SoftwareFrames(SoftwareFrame(np.zeros(7, np.uint8), Kinds.RGB, 1), depth(0)),
            "7 bytes are not 48 x 36 pixels",
        ),
        (SoftwareFrames(colour(1, focal=6000.0), depth(1)), "colour camera: focal length fx=6000"),
        (SoftwareSDK.OBError("usb is gone"), "orbbec:a.bag: usb is gone"),
    ],
)
def test_what_cannot_be_read_is_named(shown: Shown, complaint: str) -> None:
    with pytest.raises(SourceError, match=complaint):
        recorded(shown)


def test_a_camera_shows_frames_until_it_is_stopped() -> None:
    camera = OrbbecCamera(sdk := SoftwareSDK(*both(*range(1, 9))), "", "orbbec")
    assert isinstance(camera, LiveSource)
    seen = []
    for frame in camera:
        seen.append(frame)
        if len(seen) == 3:
            camera.stop()
    assert numbers(seen) == [(1, 1), (2, 2), (3, 3)]
    assert sdk.log[-1] == "stop"


def test_a_camera_s_frame_that_cannot_be_right_is_left_out() -> None:
    damaged = SoftwareFrames(colour(2, Kinds.H264), depth(2))
    camera = OrbbecCamera(SoftwareSDK(*both(1), damaged, *both(3)), "", "orbbec")
    seen = []
    with pytest.raises(SourceError, match="orbbec: no pictures for 5 s"):
        seen.extend(camera)
    assert numbers(seen) == [(1, 1), (3, 3)]
    assert dict(camera.left_out) == {"left out: they could not be right": 1}
    assert [frame.index for frame in seen] == [0, 2]


@pytest.mark.parametrize(
    ("serials", "asked", "complaint"),
    [
        ((), "", "orbbec: no such camera; connected are none"),
        (("A1", "B2"), "", "connected are A1, B2; say which: orbbec:SERIAL"),
        (("A1",), "C3", "no such camera; connected are A1"),
    ],
)
def test_a_camera_that_is_not_there_is_answered_with_those_that_are(
    serials: tuple[str, ...], asked: str, complaint: str
) -> None:
    with pytest.raises(SourceError, match=complaint):
        OrbbecCamera(SoftwareSDK(serials=serials), asked, "orbbec")


def test_sources_are_opened_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.bag").write_bytes(b"a recording")
    sdk = SoftwareSDK(*both(1), serials=("A1", "B2"))
    monkeypatch.setitem(sys.modules, "pyorbbecsdk", sdk)
    camera = open_source("orbbec:B2?depth_unit=0.002")
    assert isinstance(camera, OrbbecCamera)
    assert next(iter(camera)).depth_m == pytest.approx(1.402)
    assert {"log none", "device B2"} <= set(sdk.log)
    recording = open_source(f"orbbec:{tmp_path}/a.bag")
    assert isinstance(recording, OrbbecRecording)
    assert not isinstance(recording, LiveSource)
    assert numbers(list(recording)) == numbers(list(recording)) == [(1, 1)]
    with pytest.raises(SourceError, match="say which: orbbec:SERIAL"):
        open_source("orbbec")
    with pytest.raises(SourceError, match=r"b\.bag: no such recording"):
        open_source(f"orbbec:{tmp_path}/b.bag")
    monkeypatch.setitem(sys.modules, "pyorbbecsdk", SoftwareSDK(broken=True))
    with pytest.raises(SourceError, match=r"a\.bag: Error reading version line"):
        open_source(f"orbbec:{tmp_path}/a.bag")


def test_without_the_sdk_the_way_to_install_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyorbbecsdk", None)
    with pytest.raises(MissingExtraError, match="pip install --no-deps pyorbbecsdk2"):
        open_source("orbbec")
