"""What a user installs is whole: the wheel and the sdist hold every file that the programs read."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from hatchling.builders.sdist import SdistBuilder
from hatchling.builders.wheel import WheelBuilder

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = ("tracker", "reference", "eval")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def sources(*folders: str) -> set[str]:
    """Every file of these folders, as the tree has it."""
    files = (path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file())
    return {path.relative_to(ROOT).as_posix() for path in files if "__pycache__" not in path.parts}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built by the backend itself, in this environment: nothing is fetched."""
    return Path(next(WheelBuilder(str(ROOT)).build(directory=str(tmp_path_factory.mktemp("wheel")))))


def test_the_wheel_holds_the_three_programs_and_all_their_data(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert held == sources(*PROGRAMS)
    for kind in ("tracker/web/page.html", "reference/vocabularies/ycbv.yaml", "eval/presets/measure.yaml"):
        assert kind in held
    assert {f"{program}/py.typed" for program in PROGRAMS} < held


def test_the_wheel_declares_its_programs_and_extras(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        texts = {Path(name).name: archive.read(name).decode() for name in archive.namelist() if ".dist-info/" in name}
    extras = {line.split()[1] for line in texts["METADATA"].splitlines() if line.startswith("Provides-Extra:")}
    assert extras == set(PROJECT["optional-dependencies"])
    for program in PROGRAMS:
        assert f"conceptrack-{program} = {program}.__main__:main" in texts["entry_points.txt"]
    assert "LICENSE" in texts


def test_the_sdist_holds_what_it_takes_to_build_and_to_test(tmp_path: Path) -> None:
    with tarfile.open(next(SdistBuilder(str(ROOT)).build(directory=str(tmp_path)))) as archive:
        held = {member.name.partition("/")[2] for member in archive.getmembers() if member.isfile()}
    assert sources(*PROGRAMS, "configs", "docs", "tests", ".ci") <= held
    assert {"pyproject.toml", "constraints.txt", "Makefile", "README.md", "LICENSE", "CHANGELOG.md"} < held


def test_the_wheel_by_itself_finds_its_data_from_any_folder(wheel: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)  # noqa: S202 - the test has built it
    asked = """
import json, tracker
from importlib import resources
from eval.preset import read_preset, shipped_presets
from reference.vocabulary import read_vocabulary, shipped_vocabularies
presets = [read_preset(name).title for name in shipped_presets()]
vocabularies = [len(read_vocabulary(name).vocabularies) for name in shipped_vocabularies()]
page = resources.files("tracker.web").joinpath("page.html").read_text("utf-8")
print(json.dumps([tracker.__file__, presets, vocabularies, page]))
"""
    where = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": str(site)}}
    done = subprocess.run([sys.executable, "-c", asked], **where, capture_output=True, text=True)  # noqa: S603
    assert done.returncode == 0, done.stderr
    home, presets, vocabularies, page = json.loads(done.stdout)
    assert home == str(site / "tracker" / "__init__.py")
    assert (len(presets), len(vocabularies)) == (12, 5)
    assert all(presets)
    assert all(vocabularies)
    assert "</html>" in page
