"""A file is what was to be written, or what it was before."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tracker.errors import OutputError
from tracker.whole_file import write_whole


@pytest.mark.parametrize(("content", "stored"), [("5°\n", "5°\n".encode()), (b"\r\n\x00", b"\r\n\x00"), ("", b"")])
def test_it_holds_what_was_written_to_the_byte_and_nothing_is_left_beside_it(
    content: str | bytes, stored: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "deep" / "down" / "file.txt"
    for _ in range(2):
        write_whole(path, content)
    assert path.read_bytes() == stored
    assert list(path.parent.iterdir()) == [path]


def test_what_was_there_stays_until_the_new_one_is_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file.txt"
    write_whole(path, "before")

    def fails(source: Path, target: Path) -> None:
        assert Path(source).read_bytes() == b"after"
        assert Path(target).read_bytes() == b"before"
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fails)
    with pytest.raises(OutputError, match=r"file\.txt: cannot be written \(No space left"):
        write_whole(path, "after")
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_in_the_way_of_its_folder_is_said(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(OutputError, match=r"taken/file\.txt: cannot be written"):
        write_whole(tmp_path / "taken" / "file.txt", "x")


def test_killed_at_any_moment_it_is_what_one_of_the_writings_was(tmp_path: Path) -> None:
    path, size = tmp_path / "file.bin", 20_000_000
    code = f"""
import sys
from itertools import count
from pathlib import Path
from tracker.whole_file import write_whole
for k in count():
    write_whole(Path(sys.argv[1]), bytes([k % 250]) * {size})
"""
    for after_s in np.random.default_rng(0).uniform(0, 0.1, 3):
        running = subprocess.Popen([sys.executable, "-c", code, str(path)])  # noqa: S603
        while not path.exists():
            time.sleep(0.005)
        time.sleep(after_s)
        running.kill()
        running.wait()
        content = path.read_bytes()
        assert content == content[:1] * size
        path.unlink()
