"""Without libusb and its like: a sentence with the command that installs it, not a traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tracker.errors import MissingLibraryError
from tracker.sources.realsense.devices import load_sdk
from tracker.system_libraries import DEBIAN, system_libraries_of

ROOT = Path(__file__).resolve().parents[1]
WITHOUT_LIBUSB = "libusb-1.0.so.0: cannot open shared object file: No such file or directory"  # the loader's words


def lacking(package: str, folder: Path) -> Path:
    """A folder for the path in which the package is there, and a library that it loads is not."""
    (folder / f"{package}.py").write_text(f"raise ImportError({WITHOUT_LIBUSB!r})\n")
    return folder


@pytest.mark.parametrize("library", DEBIAN)
def test_a_known_library_is_told_with_the_package_that_has_it(library: str) -> None:
    told = f"(/venv/open3d/libOpen3D.so.0.20) {library}: cannot open shared object file: No such file or directory"
    with (
        pytest.raises(MissingLibraryError, match=rf"open3d .* {library}, .*apt-get install -y {DEBIAN[library]} "),
        system_libraries_of("open3d"),
    ):
        raise ImportError(told)


def test_an_unknown_library_is_named_all_the_same() -> None:
    with pytest.raises(MissingLibraryError, match=r"libfoo\.so\.2"), system_libraries_of("open3d"):
        raise ImportError("libfoo.so.2: cannot open shared object file: No such file or directory")


def test_the_set_up_installs_the_same_libraries() -> None:
    listed = (ROOT / ".ci" / "system").read_text().partition("<<LIBRARIES\n")[2].partition("LIBRARIES\n")[0]
    assert dict(line.split() for line in listed.splitlines()) == DEBIAN


def test_what_fails_for_another_reason_goes_on_as_it_is() -> None:
    with pytest.raises(ImportError, match="No module named 'open3d'"), system_libraries_of("open3d"):
        raise ImportError("No module named 'open3d'")


def test_the_sdk_of_a_camera_is_not_told_to_be_missing_where_a_library_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(lacking("pyrealsense2", tmp_path))
    monkeypatch.delitem(sys.modules, "pyrealsense2", raising=False)
    with pytest.raises(MissingLibraryError, match=r"pyrealsense2 needs .* apt-get install -y libusb-1\.0-0"):
        load_sdk()


@pytest.mark.parametrize(
    "line",
    [
        ("reference", "synthetic:turn?frames=2&size=64x64", "--object", "mug", "--out", "a.concept"),
        ("eval", "track", "--dataset", "synthetic:turn?frames=2&size=64x64", "--method", "sift"),
    ],
)
def test_a_program_ends_with_the_sentence(line: tuple[str, ...], tmp_path: Path) -> None:
    path = os.pathsep.join((str(lacking("open3d", tmp_path)), str(ROOT)))
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-m", *line],
        env=os.environ | {"PYTHONPATH": path},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (1, ""), done.stderr
    assert done.stderr.startswith("error: open3d needs the system library libusb-1.0.so.0")
    assert "sudo apt-get install -y libusb-1.0-0" in done.stderr
    assert len(done.stderr.splitlines()) == 1
