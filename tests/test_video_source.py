"""A video with a folder of depth: frame by frame, with the video's times, and as many of the one as of the other."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from tracker.errors import FrameError, SourceError
from tracker.sources import length_of, open_source
from tracker.sources.video import VideoWithDepth

K = "?K=60,61,31.5,23.5"


def write(path: Path, frames: int, depths: int, fps: float = 29.97) -> str:
    """`VIDEO+FOLDER`: the k-th frame is about 30 k red, the k-th depth 700 + k mm; names are numbers by value."""
    writer = cv2.VideoWriter(str(path / "rgb.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), fps, (64, 48))
    for k in range(frames):
        writer.write(np.full((48, 64, 3), (60, 30, 30 * k), np.uint8))
    writer.release()
    (path / "depth").mkdir()
    for k in range(depths):
        cv2.imwrite(str(path / "depth" / f"{8 + k}.png"), np.full((48, 64), 700 + k, np.uint16))
    return f"{path}/rgb.mp4+{path}/depth/"


def test_every_frame_has_its_depth_and_the_time_of_the_video(tmp_path: Path) -> None:
    source = open_source(f"video:{write(tmp_path, 5, 5)}{K}")
    assert isinstance(source, VideoWithDepth)
    assert length_of(source) == 5
    for _ in range(2):
        frames = list(source)
        assert [frame.index for frame in frames] == list(range(5))
        for k, frame in enumerate(frames):
            assert np.abs(frame.rgb.astype(int) - [30 * k, 30, 60]).max() < 8
            assert frame.depth_m == pytest.approx((700 + k) / 1000)
            assert frame.stamp_ns == pytest.approx(k * 1e9 / 29.97, abs=1e3)
            assert (frame.provenance.name, frame.provenance.raw_depth_unit_m) == (str(8 + k), 0.001)
            assert frame.intrinsics.matrix.ravel().tolist() == [60, 0, 31.5, 0, 61, 23.5, 0, 0, 1]


def test_the_camera_may_be_in_a_file_beside_the_video_and_the_unit_may_be_given(tmp_path: Path) -> None:
    argument = write(tmp_path, 2, 2)
    with pytest.raises(SourceError, match=rf"a video does not tell the camera; .* cam_K\.txt into {tmp_path}"):
        VideoWithDepth(argument)
    (tmp_path / "cam_K.txt").write_text("60 0 31.5 0 61 23.5 0 0 1")
    frame = next(iter(VideoWithDepth(f"{argument}?depth_unit=0.0001")))
    assert frame.intrinsics.fx == 60
    assert frame.depth_m == pytest.approx(0.07)


@pytest.mark.parametrize(("frames", "depths"), [(5, 4), (4, 5)])
def test_counts_that_differ_are_refused(tmp_path: Path, frames: int, depths: int) -> None:
    argument = write(tmp_path, frames, depths)
    with pytest.raises(SourceError, match=rf"rgb\.mp4 has {frames} frames and .*depth {depths} depth pictures"):
        VideoWithDepth(f"{argument}{K}")


def test_parts_that_are_missing_or_of_another_kind_are_named(tmp_path: Path) -> None:
    argument = write(tmp_path, 2, 2)
    with pytest.raises(SourceError, match=r"expected video:VIDEO\+FOLDER"):
        VideoWithDepth(f"{tmp_path}/rgb.mp4{K}")
    with pytest.raises(SourceError, match=r"nothing\.mp4: no such video"):
        VideoWithDepth(f"{tmp_path}/nothing.mp4+{tmp_path}/depth{K}")
    with pytest.raises(SourceError, match=f"{tmp_path} has no png pictures"):
        VideoWithDepth(f"{tmp_path}/rgb.mp4+{tmp_path}{K}")
    (tmp_path / "rgb.mp4").write_bytes(b"no video")
    with pytest.raises(SourceError, match=r"rgb\.mp4: not a video that can be read"):
        VideoWithDepth(f"{argument}{K}")


def test_depth_of_another_size_or_depth_is_named(tmp_path: Path) -> None:
    source = VideoWithDepth(f"{write(tmp_path, 2, 2)}{K}")
    cv2.imwrite(str(tmp_path / "depth" / "9.png"), np.full((24, 32), 700, np.uint16))
    with pytest.raises(FrameError, match=r"depth_m has shape \(24, 32\)"):
        list(source)
    cv2.imwrite(str(tmp_path / "depth" / "9.png"), np.full((48, 64, 3), 70, np.uint8))
    with pytest.raises(SourceError, match="a depth picture has one channel"):
        list(source)
