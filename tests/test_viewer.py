"""Where pictures of what the tracker does go: a video and files that can be read back, or nowhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracker.concept import ConceptModel
from tracker.errors import OutputError
from tracker.frame import Frame
from tracker.geometry import Intrinsics, Pose
from tracker.result import TrackResult, TrackState
from tracker.viewer import FRAMES, RECORDING, VIDEO, NullViewer, OverlayFiles, Several, Viewer, file_viewer

CAMERA = Intrinsics(300.0, 310.0, 158.0, 121.5, 320, 240)
T_CAM_OBJ = Pose.exp((0.4, -0.5, 0.3, 0.0, 0.0, 0.0)).nudged(np.array([0, 0, 0, 0.02, 0.04, 0.6]))
TEXT_ROWS = 30


def plain(index: int = 0, camera: Intrinsics = CAMERA) -> Frame:
    size = (camera.height, camera.width)
    picture = np.full((*size, 3), (200, 30 * index, 20), np.uint8)  # what is red here must not be blue there
    return Frame(picture, np.ones(size, np.float32), camera, index, {}, index)


def result() -> TrackResult:
    return TrackResult(
        0, "thing", T_CAM_OBJ, TrackState.TRACKING, 0.87, None, "", T_CAM_OBJ, None, {"total": 1.0}
    )  # fmt: skip


def model() -> ConceptModel:
    points = np.random.default_rng(0).uniform(-0.05, 0.05, (200, 3))
    ones, nothing = np.ones(len(points), np.float32), np.zeros((len(points), 3), np.float32)
    return ConceptModel(
        "thing", points, points, nothing, nothing[:, :1], ones.astype(np.int32), ones, np.eye(3)[:1], 0.2, ("c",),
        "none", "none",
    )  # fmt: skip


@pytest.mark.parametrize("camera", [CAMERA, Intrinsics(150.0, 150.0, 80.0, 60.5, 161, 122)])
def test_the_video_can_be_read_back_frame_by_frame(camera: Intrinsics, tmp_path: Path) -> None:
    viewer = OverlayFiles([model()], tmp_path / "a.mp4", rate_hz=15)
    for index in range(6):
        viewer.show(plain(index, camera), [result()], {})
    viewer.close()
    reader = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    assert reader.get(cv2.CAP_PROP_FPS) == pytest.approx(15)
    pictures = []
    while True:
        alive, bgr = reader.read()
        if not alive:
            break
        pictures.append(bgr[:, :, ::-1].astype(int))
    assert len(pictures) == 6
    for index, picture in enumerate(pictures):
        assert picture.shape == (camera.height // 2 * 2, camera.width // 2 * 2, 3)  # the codec knows no odd sizes
        assert np.median(picture[TEXT_ROWS:], axis=(0, 1)) == pytest.approx((200, 30 * index, 20), abs=12)
    assert len(np.unique((np.abs(pictures[0] - (200, 0, 20)) > 40).any(axis=2))) == 2  # and the box is in it


def test_pictures_are_named_by_the_frame_and_hold_it_exactly(tmp_path: Path) -> None:
    viewer = file_viewer(("frames",), tmp_path, [model()])
    for index in (3, 12):
        viewer.show(plain(index % 8), [], {})
        viewer.show(plain(index % 8), [result()], {})
    viewer.close()
    assert sorted(path.name for path in (tmp_path / FRAMES).iterdir()) == ["000003.png", "000004.png"]
    picture = cv2.imread(str(tmp_path / FRAMES / "000003.png"))
    assert picture is not None
    assert picture[-1, -1, ::-1].tolist() == [200, 90, 20]
    assert (picture[60:200, 60:260, ::-1] != (200, 90, 20)).any()


@pytest.mark.parametrize("views", [(), ("overlay",), ("frames",), ("rrd",), ("overlay", "frames", "rrd")])
def test_what_is_asked_for_is_made_and_nothing_else(views: tuple[str, ...], tmp_path: Path) -> None:
    if "rrd" in views:
        pytest.importorskip("rerun")
    viewer = file_viewer(views, tmp_path, [model()])
    viewer.show(plain(), [result()], {"thing": T_CAM_OBJ})
    viewer.close()
    made = {"overlay": VIDEO, "frames": FRAMES, "rrd": RECORDING}
    assert {path.name for path in tmp_path.iterdir()} == {made[view] for view in views}


def test_pictures_of_no_frames_are_no_files(tmp_path: Path) -> None:
    file_viewer(("overlay", "frames"), tmp_path, [model()]).close()
    assert list(tmp_path.iterdir()) == []


def show_and_close(viewer: Viewer) -> None:
    for index in range(30):
        viewer.show(plain(index % 8), [], {})
    viewer.close()


@pytest.mark.parametrize("view", ["overlay", "frames"])
def test_what_cannot_be_written_is_an_error(view: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("no folder")
    viewer = file_viewer((view,), tmp_path / "file", [model()])
    with pytest.raises(OutputError, match="cannot"):
        show_and_close(viewer)
    viewer.close()
    capfd.readouterr()  # what the codec says of it


def test_no_viewer_is_a_viewer() -> None:
    viewer = NullViewer()
    viewer.show(plain(), [result()], {})
    viewer.close()


class Noting:
    """Takes down what it is told, and cannot be closed when it is told so."""

    def __init__(self, told: list[str], name: str, fails: bool = False) -> None:
        self._told, self._name, self._fails = told, name, fails

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        self._told.append(f"{self._name} {frame.index} {len(results)} {len(truth)}")

    def close(self) -> None:
        self._told.append(f"{self._name} closed")
        if self._fails:
            raise OutputError(self._name)


def test_several_viewers_are_shown_the_same_and_closed_all_whatever_one_raises() -> None:
    told: list[str] = []
    several = Several([Noting(told, "a"), Noting(told, "b", fails=True)])
    several.show(plain(index=3), [result()], {"thing": T_CAM_OBJ})
    with pytest.raises(OutputError, match="b"):
        several.close()
    assert told[:2] == ["a 3 1 1", "b 3 1 1"]
    assert sorted(told[2:]) == ["a closed", "b closed"]
