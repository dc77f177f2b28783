"""Videos: sent to ffmpeg where it is, whole and in order; what it says when it fails is told."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tracker.errors import OutputError
from tracker.video import VideoFile, h264_program

STAND_IN = """#!{python}
import sys
if "-encoders" in sys.argv:
    print(" V..... {encoder} some encoder")
    sys.exit()
{work}
"""
KEEPS = (
    "open(sys.argv[-1], 'wb').write(sys.stdin.buffer.read()); open(sys.argv[-1] + '.asked', 'w').write(repr(sys.argv))"
)
FAILS = "sys.stdin.buffer.read(10); print('first line', file=sys.stderr); sys.exit('no space left')"


@pytest.fixture(autouse=True)
def asked_anew() -> Iterator[None]:
    h264_program.cache_clear()
    yield
    h264_program.cache_clear()


def stand_in(folder: Path, monkeypatch: pytest.MonkeyPatch, work: str, encoder: str = "libx264") -> None:
    """A program called ffmpeg, the only one on the PATH."""
    folder.mkdir()
    program = folder / "ffmpeg"
    program.write_text(STAND_IN.format(python=sys.executable, encoder=encoder, work=work))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))


def pictures() -> list[np.ndarray]:
    return [np.random.default_rng(k).integers(0, 255, (31, 42, 3), np.uint8) for k in range(4)]


def test_ffmpeg_gets_every_picture_whole_and_is_told_their_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(tmp_path / "bin", monkeypatch, KEEPS)
    video = VideoFile(tmp_path / "a.mp4", 15)
    for picture in pictures():
        video.write(picture)
    video.close()
    assert (tmp_path / "a.mp4").read_bytes() == b"".join(picture[:30].tobytes() for picture in pictures())
    asked = (tmp_path / "a.mp4.asked").read_text()
    assert all(word in asked for word in ("'42x30'", "'bgr24'", "'15'", "'libx264'", "'yuv420p'"))


def test_an_ffmpeg_that_fails_is_an_error_with_its_last_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(tmp_path / "bin", monkeypatch, FAILS)
    video = VideoFile(tmp_path / "a.mp4", 15)
    video.write(pictures()[0])
    with pytest.raises(OutputError, match=r"a\.mp4.*no space left"):
        video.close()


def test_an_ffmpeg_that_ends_in_the_middle_is_one_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(tmp_path / "bin", monkeypatch, FAILS)
    video = VideoFile(tmp_path / "a.mp4", 15)
    large = np.zeros((1000, 2000, 3), np.uint8)  # more than a pipe holds
    with pytest.raises(OutputError, match=r"a\.mp4.*no space left"):
        video.write(large)
    video.close()


@pytest.mark.parametrize("there", [True, False])
def test_without_h264_the_video_is_another_one_and_that_is_said_once(
    there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    if there:
        stand_in(tmp_path / "bin", monkeypatch, FAILS, encoder="mpeg4")
    for name in ("a.mp4", "b.mp4"):
        video = VideoFile(tmp_path / name, 15)
        for picture in pictures():
            video.write(picture)
        video.close()
        assert b"mp4v" in (tmp_path / name).read_bytes()
    assert len(caplog.messages) == 1
    assert ("libx264" if there else "program ffmpeg") in caplog.text
