"""RealSense cameras and recordings, by the SDK itself: its software device, its recorder, its playback."""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from reference.onboard import onboard, read_reference_frames
from tests.software_camera import SoftwareCamera, rs
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import FrameError, MissingExtraError, SourceError
from tracker.first_masks import FirstMasks
from tracker.frame import Frame
from tracker.geometry import Intrinsics
from tracker.pipeline import ObjectTracker
from tracker.result import TrackState
from tracker.saliency import SaliencyBackend
from tracker.sources import LiveSource, length_of, open_source, require_recordable
from tracker.sources.bop import BopScene
from tracker.sources.lens import MODELS, Lens
from tracker.sources.realsense import RealSenseCamera, RealSenseFile, open_realsense
from tracker.sources.realsense.camera import Patience
from tracker.sources.realsense.devices import Finder
from tracker.sources.realsense.request import Options, read_request

CAMERA = Intrinsics(150.0, 151.0, 80.5, 59.0, 160, 120)
LONG_S = 20.0
QUICK, CALM = Patience(stall_s=0.8, wait_s=0.02), Patience(stall_s=LONG_S)


class Watching:
    """A thread that takes all frames of a source, and what ended it."""

    def __init__(self, source: RealSenseCamera) -> None:
        self.source, self.frames = source, list[Frame]()
        self.error: Exception | None = None
        self._thread = threading.Thread(target=self._take)
        self._thread.start()

    def _take(self) -> None:
        try:
            for frame in self.source:
                self.frames.append(frame)
        except Exception as error:
            self.error = error

    def until(self, count: int) -> list[Frame]:
        for _ in range(4000):
            if len(self.frames) >= count or not self._thread.is_alive():
                break
            time.sleep(0.005)
        assert len(self.frames) >= count, (len(self.frames), self.error)
        return self.frames

    def end(self) -> list[Frame]:
        self.source.stop()
        return self.wait()

    def wait(self) -> list[Frame]:
        self._thread.join(LONG_S)
        assert not self._thread.is_alive()
        return self.frames


@pytest.fixture
def watch() -> Iterator[Callable[..., Watching]]:
    started: list[Watching] = []

    def start(camera: SoftwareCamera | Callable[[], Any], record: Path | None = None, **options: Any) -> Watching:
        one = isinstance(camera, SoftwareCamera)
        find = (lambda: camera.device) if isinstance(camera, SoftwareCamera) else camera
        source = RealSenseCamera(rs, find, Options(**options), "realsense:soft-1", CALM if one else QUICK)
        if record is not None:
            source.record(record)
        started.append(Watching(source))
        if isinstance(camera, SoftwareCamera):
            camera.wait_until_open()
        return started[-1]

    yield start
    for each in started:
        each.end()


def gray(k: int) -> np.ndarray:
    return np.full((CAMERA.height, CAMERA.width, 3), k, np.uint8)


def plane(z_m: float = 0.7) -> np.ndarray:
    return np.full((CAMERA.height, CAMERA.width), z_m)


def show(camera: SoftwareCamera, watching: Watching, count: int, z_m: float = 0.7) -> None:
    """Picture k is of gray k; each is waited for, so that none is dropped."""
    for _ in range(count):
        seen = len(watching.frames)
        camera.show(gray(camera.shown), plane(z_m))
        watching.until(seen + 1)


# A camera


def test_everything_that_the_camera_knows_is_in_the_frame(watch: Callable[..., Watching]) -> None:
    camera = SoftwareCamera(CAMERA, clock=rs.timestamp_domain.global_time)
    watching = watch(camera)
    camera.show(np.broadcast_to(np.array([200, 90, 30], np.uint8), (120, 160, 3)), plane(), 2000.5, 1998.25)
    (frame,) = watching.until(1)
    assert (frame.rgb == [200, 90, 30]).all()
    assert frame.depth_m == pytest.approx(0.7)
    assert frame.intrinsics == CAMERA
    assert (frame.stamp_ns, frame.provenance.clock) == (2_000_500_000, "global_time")
    assert frame.provenance.colour_depth_skew_ns == 2_250_000
    assert frame.provenance.raw_depth_unit_m == pytest.approx(0.0001)
    assert frame.provenance.source == "realsense:soft-1 frame 0"
    assert isinstance(watching.source, LiveSource)
    assert length_of(watching.source) is None


@pytest.mark.parametrize("unit_m", [0.001, 0.0001, 0.00025])
def test_depth_is_metres_whatever_the_unit_of_the_camera(unit_m: float, watch: Callable[..., Watching]) -> None:
    camera = SoftwareCamera(CAMERA, unit_m=unit_m)
    watching = watch(camera)
    show(camera, watching, 1, z_m=0.75)
    assert watching.frames[0].depth_m == pytest.approx(0.75, abs=unit_m)


def test_the_unit_that_the_user_says_counts(watch: Callable[..., Watching]) -> None:
    camera = SoftwareCamera(CAMERA, unit_m=0.001)
    watching = watch(camera, depth_unit_m=0.0005)
    show(camera, watching, 1, z_m=0.8)
    assert watching.frames[0].depth_m == pytest.approx(0.4, abs=0.001)


def test_colours_are_rgb_whatever_the_format_of_the_stream(watch: Callable[..., Watching]) -> None:
    camera = SoftwareCamera(CAMERA, colour_format=rs.format.bgr8)
    watching = watch(camera)
    camera.show(np.broadcast_to(np.array([30, 90, 200], np.uint8), (120, 160, 3)), plane())
    assert (watching.until(1)[0].rgb == [200, 90, 30]).all()


def test_depth_of_another_camera_is_registered_to_the_colour(watch: Callable[..., Watching]) -> None:
    """A square of 10 cm in 0.5 m, before a wall: seen by a depth camera of another size that is 5 cm to the left."""
    depth = Intrinsics(210.0, 210.0, 120.0, 68.0, 240, 136)
    camera = SoftwareCamera(CAMERA, depth, baseline_m=0.05)
    watching = watch(camera)
    seen = {}
    for name, k, x_m in (("depth", depth, 0.0), ("colour", CAMERA, 0.05)):
        rows, columns = np.indices((k.height, k.width))
        x, y = (columns - k.cx) / k.fx * 0.5 - x_m, (rows - k.cy) / k.fy * 0.5
        seen[name] = np.where((np.abs(x) < 0.05) & (np.abs(y) < 0.05), 0.5, 1.0)
    camera.show(np.where(seen["colour"][:, :, None] < 0.7, 255, 0).astype(np.uint8).repeat(3, axis=2), seen["depth"])
    (frame,) = watching.until(1)
    near, white = (frame.depth_m > 0) & (frame.depth_m < 0.7), frame.rgb[:, :, 0] > 127
    assert white.sum() == (seen["colour"] < 0.7).sum() > 500
    assert (near & white).sum() / (near | white).sum() > 0.9
    assert frame.depth_m[white & near] == pytest.approx(0.5, abs=1e-3)


def test_depth_that_is_registered_already_is_not_touched(watch: Callable[..., Watching]) -> None:
    camera = SoftwareCamera(CAMERA)
    watching = watch(camera)
    depth_m = np.random.default_rng(0).integers(3_000, 9_000, (120, 160)) / 10_000
    camera.show(gray(1), depth_m)
    assert np.abs(watching.until(1)[0].depth_m - depth_m).max() < 1e-6


@pytest.mark.parametrize(
    "model", ["brown_conrady", "inverse_brown_conrady", "modified_brown_conrady", "kannala_brandt4"]
)
def test_a_lens_bends_as_the_sdk_says(model: str) -> None:
    """Where a pixel of the straight picture is taken from, for each by the SDK's own projection."""
    coefficients = [-0.2, 0.08, 0.004, -0.003, 0.0 if model == "kannala_brandt4" else -0.02]
    of_sdk = rs.intrinsics()
    of_sdk.width, of_sdk.height, of_sdk.fx, of_sdk.fy = CAMERA.width, CAMERA.height, CAMERA.fx, CAMERA.fy
    of_sdk.ppx, of_sdk.ppy, of_sdk.model, of_sdk.coeffs = (
        CAMERA.cx,
        CAMERA.cy,
        getattr(rs.distortion, model),
        coefficients,
    )
    columns, rows = MODELS[model][1](CAMERA, np.array(coefficients))
    for row, column in ((5, 9), (100, 140), (60, 30), (59, 80)):
        ray = [(column - CAMERA.cx) / CAMERA.fx, (row - CAMERA.cy) / CAMERA.fy, 1.0]
        assert [columns[row, column], rows[row, column]] == pytest.approx(
            rs.rs2_project_point_to_pixel(of_sdk, ray), abs=0.01
        )


def test_a_picture_of_a_bent_lens_is_straight_and_an_unknown_lens_is_refused(watch: Callable[..., Watching]) -> None:
    coefficients = (-0.3, 0.1, 0.0, 0.0, 0.0)
    camera = SoftwareCamera(CAMERA, distortion=(rs.distortion.inverse_brown_conrady, coefficients))
    watching = watch(camera)
    rgb = np.tile(np.arange(160, dtype=np.uint8)[None, :, None], (120, 1, 3))
    camera.show(rgb, plane())
    expected, _ = Lens(CAMERA, "inverse_brown_conrady", coefficients).undistort(rgb, plane().astype(np.float32))
    assert np.array_equal(watching.until(1)[0].rgb, expected)
    assert not np.array_equal(expected, rgb)
    unknown = SoftwareCamera(CAMERA, distortion=(rs.distortion.ftheta, coefficients))
    with pytest.raises(SourceError, match="colour camera: pictures with distortion 'ftheta'"):
        list(RealSenseCamera(rs, lambda: unknown.device))


@pytest.mark.parametrize(("filters", "holes"), [((), True), (("spatial", "temporal", "hole"), False)])
def test_holes_stay_unless_filters_are_asked_for(
    filters: Sequence[str], holes: bool, watch: Callable[..., Watching]
) -> None:
    camera = SoftwareCamera(CAMERA)
    watching = watch(camera, filters=tuple(filters))
    depth_m = plane()
    depth_m[50:56, 70:76] = 0
    camera.show(gray(1), depth_m)
    assert (watching.until(1)[0].depth_m[52, 72] == 0) == holes


def test_first_pictures_without_colour_are_skipped_and_counted(watch: Callable[..., Watching]) -> None:
    camera = SoftwareCamera(CAMERA)
    watching = watch(camera)
    for _ in range(3):
        camera.show(None, plane())
        time.sleep(0.02)
    show(camera, watching, 2)
    assert [frame.rgb[0, 0, 0] for frame in watching.end()] == [3, 4]
    assert [count for what, count in watching.source.left_out.items() if "at the start" in what] == [3]


def test_colour_without_depth_is_a_frame_without_depth_and_is_told(
    watch: Callable[..., Watching], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    camera = SoftwareCamera(CAMERA)
    watching = watch(camera)
    show(camera, watching, 2)
    for _ in range(6):
        camera.show(gray(camera.shown), None)
        time.sleep(0.02)
    camera.show(gray(camera.shown), plane())
    frames = watching.until(9)
    assert [bool(frame.depth_m.any()) for frame in frames] == [True] * 2 + [False] * 6 + [True]
    assert [record.message.split(": ")[1] for record in caplog.records] == [
        "colour comes without depth",
        "colour comes again with depth",
    ]


def test_a_camera_that_is_lost_and_comes_back_goes_on(
    watch: Callable[..., Watching], caplog: pytest.LogCaptureFixture
) -> None:
    """A stalled stream and an unplugged camera look alike: nothing comes. Twice it is not there when looked for."""
    caplog.set_level(logging.WARNING)
    first, second = SoftwareCamera(CAMERA), SoftwareCamera(CAMERA)
    answers = iter([first.device, SourceError("no camera"), RuntimeError("busy"), second.device])

    def find() -> Any:
        answer = next(answers)
        if isinstance(answer, Exception):
            raise answer
        return answer

    watching = watch(find)
    first.wait_until_open()
    show(first, watching, 3)
    second.wait_until_open()
    show(second, watching, 3)
    frames = watching.end()
    assert [frame.index for frame in frames] == list(range(6))
    assert [frame.rgb[0, 0, 0] for frame in frames] == [0, 1, 2] * 2
    told = [record.message for record in caplog.records]
    assert "realsense:soft-1 is lost (no pictures for 0.8 s); it is looked for again" in told
    assert any(message.startswith("realsense:soft-1 is back after") for message in told)


def test_a_camera_that_does_not_come_back_ends_with_an_error_after_what_was_seen(
    watch: Callable[..., Watching],
) -> None:
    camera = SoftwareCamera(CAMERA)
    devices = iter([camera.device])

    def find() -> Any:
        for device in devices:
            return device
        raise SourceError("there is no camera 'soft-1'")

    watching = watch(find, reconnect_s=1.5)
    camera.wait_until_open()
    show(camera, watching, 2)
    assert len(watching.wait()) == 2
    assert isinstance(watching.error, SourceError)
    assert "the camera is gone for" in str(watching.error)
    assert "there is no camera 'soft-1'" in str(watching.error)


def test_a_matrix_of_another_resolution_ends_it_with_a_sentence() -> None:
    camera = SoftwareCamera(replace(CAMERA, cx=CAMERA.cx / 2, cy=CAMERA.cy / 2))
    with pytest.raises(FrameError, match=r"the colour camera: principal point .* does K belong to another resolution"):
        list(RealSenseCamera(rs, lambda: camera.device))


def test_a_camera_without_the_stream_that_is_asked_for_lists_those_it_has() -> None:
    camera = SoftwareCamera(CAMERA)
    source = RealSenseCamera(rs, lambda: camera.device, Options(width=640), "realsense:soft-1")
    with pytest.raises(SourceError, match=r"no depth stream with width=640 height=any .* it has 160x120 at 30 in z16"):
        list(source)


def test_a_stop_ends_a_camera_that_says_nothing(watch: Callable[..., Watching]) -> None:
    assert watch(SoftwareCamera(CAMERA)).end() == []


class Listing:
    """The part of the SDK that lists cameras, with these."""

    camera_info = rs.camera_info

    def __init__(self, *serials: str) -> None:
        self._cameras = [SoftwareCamera(CAMERA, serial=serial) for serial in serials]

    def context(self) -> Listing:
        return self

    def query_devices(self) -> list[Any]:
        return [camera.device for camera in self._cameras]


def test_a_camera_is_found_by_its_serial_number_or_as_the_only_one() -> None:
    for listing, serial, expected in ((Listing("a"), None, "a"), (Listing("a", "b"), "b", "b")):
        device = Finder(listing, serial, "realsense")()
        assert device.get_info(rs.camera_info.serial_number) == expected


@pytest.mark.parametrize(
    ("listing", "serial", "complaint"),
    [
        (Listing(), None, "realsense: there is no camera; connected: none"),
        (Listing("a", "b"), None, "realsense: there are several cameras, name one of them: a, b"),
        (Listing("a", "b"), "c", "realsense: there is no camera 'c'; connected: a, b"),
    ],
)
def test_a_camera_that_is_not_there_is_answered_with_those_that_are(
    listing: Listing, serial: str | None, complaint: str
) -> None:
    with pytest.raises(SourceError, match=complaint):
        Finder(listing, serial, "realsense")()


# A recording


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty pictures of gray 0 to 39, in 0.7 m, with noise so that the file has many pages."""
    path = tmp_path_factory.mktemp("recordings") / "gray.db3"
    camera, rng = SoftwareCamera(CAMERA), np.random.default_rng(0)
    source = RealSenseCamera(rs, lambda: camera.device, name="realsense:soft-1")
    source.record(path)
    watching = Watching(source)
    camera.wait_until_open()
    for k in range(40):
        camera.show(gray(k), plane() + rng.integers(0, 9, (120, 160)) / 1000)
        watching.until(k + 1)
    watching.end()
    return path


def test_a_recording_is_played_back_whole_and_again(recording: Path) -> None:
    source = open_source(f"realsense:{recording}")
    for _ in range(5):
        frames = list(source)
        assert [frame.rgb[0, 0, 0] for frame in frames] == list(range(40))
        assert [frame.index for frame in frames] == list(range(40))
        assert frames[5].stamp_ns == 1_166_666_667
        assert frames[5].provenance.clock == "hardware_clock"
        assert frames[5].provenance.raw_depth_unit_m == pytest.approx(0.0001)
        assert (np.abs(frames[5].depth_m - 0.704) < 0.0041).all()
        assert frames[5].intrinsics == CAMERA
    assert not isinstance(source, LiveSource)


def test_a_file_waits_for_a_slow_reader_and_can_be_left_early(recording: Path) -> None:
    grays = []
    for frame in RealSenseFile(rs, recording):
        grays.append(int(frame.rgb[0, 0, 0]))
        time.sleep(0.03 if frame.index < 10 else 0)
    assert grays == list(range(40))
    assert next(iter(RealSenseFile(rs, recording))).index == 0


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_a_truncated_recording_is_named(recording: Path, share: float, tmp_path: Path) -> None:
    whole = recording.read_bytes()
    (tmp_path / "cut.db3").write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(SourceError, match=r"cut\.db3: .*(truncated|no SQLite database)"):
        open_realsense(str(tmp_path / "cut.db3"))


def test_a_damaged_recording_another_kind_of_file_and_no_file_are_named(recording: Path, tmp_path: Path) -> None:
    damaged = bytearray(recording.read_bytes())
    damaged[len(damaged) // 2 : len(damaged) // 2 + 100_000] = bytes(100_000)
    for name, content in (("damaged.db3", bytes(damaged)), ("text.db3", b"hello" * 99), ("text.bag", b"hello" * 99)):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(SourceError, match=name):
            list(open_realsense(str(tmp_path / name)))
    with pytest.raises(SourceError, match=r"none\.db3: cannot be read \(No such file"):
        open_realsense(str(tmp_path / "none.db3"))
    with pytest.raises(SourceError, match=r"film\.mp4 is not a RealSense recording; expected FILE\.db3 or FILE\.bag"):
        open_realsense("film.mp4")


def test_a_recording_goes_on_beside_the_first_after_a_loss(watch: Callable[..., Watching], tmp_path: Path) -> None:
    cameras = [SoftwareCamera(CAMERA), SoftwareCamera(CAMERA)]
    devices = iter([camera.device for camera in cameras])
    watching = watch(lambda: next(devices), record=tmp_path / "gray.db3")
    for camera in cameras:
        camera.wait_until_open()
        show(camera, watching, 3)
    watching.end()
    for name in ("gray.db3", "gray-2.db3"):
        assert [frame.rgb[0, 0, 0] for frame in RealSenseFile(rs, tmp_path / name)] == [0, 1, 2]


def test_only_a_camera_is_recorded_and_only_as_the_sdk_can(recording: Path, tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"gray\.db3 cannot be recorded; expected a camera: realsense"):
        require_recordable(open_source(f"realsense:{recording}"))
    camera = RealSenseCamera(rs, lambda: None)
    assert require_recordable(camera) is camera
    with pytest.raises(SourceError, match=r"a\.bag: a RealSense camera is recorded as \.db3"):
        camera.record(tmp_path / "a.bag")


# What is asked for


def test_a_name_is_a_camera_or_a_recording_and_its_options() -> None:
    assert read_request("") == read_request("?")
    request = read_request("f123?width=640&height=480&fps=60&filters=temporal,hole&depth_unit=0.0001&reconnect=5")
    assert (request.serial, request.file) == ("f123", None)
    assert request.options == Options(640, 480, 60, ("temporal", "hole"), 0.0001, 5.0)
    assert read_request("dir/a.db3?filters=hole").options.filters == ("hole",)
    assert read_request("a.BAG").file == Path("a.BAG")


@pytest.mark.parametrize(
    ("argument", "complaint"),
    [
        ("?size=640x480", "there is no option 'size'; there is width, height, fps, filters, depth_unit, reconnect"),
        ("a.db3?fps=30", "there is no option 'fps'; there is filters, depth_unit"),
        ("?filters=median", "expected one or several of spatial, temporal, hole"),
        ("?filters=hole,hole", "each once"),
        ("?depth_unit=0", "expected a number from 1e-06 to 1, metres per unit"),
    ],
)
def test_an_option_that_is_not_known_is_refused(argument: str, complaint: str) -> None:
    with pytest.raises(SourceError, match=f"realsense:.*{complaint}"):
        read_request(argument)


def test_without_the_sdk_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    for name in ("realsense", "realsense:123", "realsense:a.db3", "realsense?fps=30"):
        with pytest.raises(MissingExtraError, match=r"pip install 'conceptrack\[realsense\]'"):
            open_source(name)


# Through the tracker


def test_a_recorded_scene_is_tracked_as_the_scene_itself(
    can_frames: list[Frame],
    can_model: ConceptModel,
    attributes: SaliencyBackend,
    watch: Callable[..., Watching],
    tmp_path: Path,
) -> None:
    camera = SoftwareCamera(can_frames[0].intrinsics)
    watching = watch(camera, record=tmp_path / "can.db3")
    for k, frame in enumerate(can_frames):
        camera.show_frame(frame, frame.stamp_ns / 1e6)
        watching.until(k + 1)
    watching.end()
    poses = []
    for frames in (can_frames, list(open_source(f"realsense:{tmp_path / 'can.db3'}"))):
        tracker = ObjectTracker(can_model, TrackerConfig(masks="carried"), attributes)
        first = [replace(frames[0], masks=can_frames[0].masks)] + [replace(frame, masks={}) for frame in frames[1:]]
        results = [tracker.step(frame)[0] for frame in first]
        assert {result.state for result in results} == {TrackState.TRACKING}
        poses.append([result.pose for result in results])
    assert len(poses[1]) == len(can_frames)
    for direct, played in zip(*poses, strict=True):
        assert direct is not None
        assert played is not None
        assert direct.distance_to_m(played) < 0.0001
        assert np.degrees(direct.angle_to_rad(played)) < 0.1


def test_colours_of_half_the_resolution_are_rgb_too(watch: Callable[..., Watching]) -> None:
    camera = SoftwareCamera(CAMERA, colour_format=rs.format.yuyv)
    watching = watch(camera)
    yuyv = cv2.cvtColor(np.full((120, 160, 3), (200, 90, 30), np.uint8), cv2.COLOR_RGB2YUV_YUYV)
    camera.show(np.asarray(yuyv, np.uint8), plane())
    assert np.abs(watching.until(1)[0].rgb.astype(int) - [200, 90, 30]).max() <= 3


@pytest.mark.shared_data
def test_a_real_recording_that_goes_through_a_camera_and_its_file_is_tracked_to_the_same_poses(
    shared_data: Path, attributes: SaliencyBackend, watch: Callable[..., Watching], tmp_path: Path
) -> None:
    scene = BopScene(shared_data / "rbt", 1)
    models = [onboard(read_reference_frames(scene, object_id, 2), attributes) for object_id in scene.object_ids]
    given = [scene[index] for index in range(15)]
    camera = SoftwareCamera(given[0].intrinsics, unit_m=0.001)
    watching = watch(camera, record=tmp_path / "rbt.db3")
    for k, frame in enumerate(given):
        camera.show_frame(frame)
        watching.until(k + 1)
    watching.end()
    played = list(open_source(f"realsense:{tmp_path / 'rbt.db3'}"))
    assert len(played) == len(given)
    trackers = [ObjectTracker(models, TrackerConfig(masks="carried"), attributes) for _ in range(2)]
    first = [FirstMasks(), FirstMasks()]
    for before, after in zip(given, played, strict=True):
        results = [trackers[0].step(first[0](before)), trackers[1].step(first[1](replace(after, masks=before.masks)))]
        for direct, of_camera in zip(*results, strict=True):
            assert direct.state is of_camera.state is TrackState.TRACKING
            assert direct.pose is not None
            assert of_camera.pose is not None
            assert direct.pose.distance_to_m(of_camera.pose) < 0.001
            assert np.degrees(direct.pose.angle_to_rad(of_camera.pose)) < 0.1
