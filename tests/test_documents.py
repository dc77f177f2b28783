"""The README and the pages under docs/: their Python runs, their commands are commands, their links lead somewhere."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import eval.__main__
import reference.__main__
import tracker.__main__
from tracker.errors import ConfigError, SourceError
from tracker.saliency import BACKENDS
from tracker.sources import SOURCES

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = {path.stem: path.read_text() for path in sorted(DOCS.glob("*.md"))}
ALL = {"README": (ROOT / "README.md").read_text(), **PAGES}
MAINS = {"reference": reference.__main__, "tracker": tracker.__main__, "eval": eval.__main__}


def blocks(text: str, info: str) -> list[str]:
    """What stands between fences of this kind."""
    return re.findall(rf"^```{info}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def commands(text: str, info: str = "sh(?: run)?") -> list[list[str]]:
    """The words of every line of a shell block that runs one of the three programs, from its name on."""
    lines = [line for block in blocks(text, info) for line in block.splitlines()]
    words = [shlex.split(line, comments=True) for line in lines]
    return [found[2:] for found in words if found[:2] == ["python", "-m"] and found[2] in MAINS]


def with_python(pages: dict[str, str]) -> list[str]:
    return [name for name, text in pages.items() if blocks(text, "python")]


class Page:
    """All Python of a page, run as one program. names: that it leaves. said: the lines that it prints."""

    def __init__(self, name: str, capsys: pytest.CaptureFixture[str]) -> None:
        self.names: dict[str, Any] = {}
        code = "\n".join(blocks(PAGES[name], "python"))
        exec(compile(code, f"docs/{name}.md", "exec"), self.names)  # noqa: S102 - that they run is what is tested
        self.said = capsys.readouterr().out.splitlines()


@pytest.fixture
def run_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Callable[[str], Page]]:
    """In an empty folder; the tables of plug-ins, into which a page puts its own, are as they were afterwards."""
    monkeypatch.chdir(tmp_path)
    backends, sources = dict(BACKENDS), dict(SOURCES)
    yield lambda name: Page(name, capsys)
    for table, before in ((BACKENDS, backends), (SOURCES, sources)):
        for name in table.keys() - before.keys():
            del table[name]


def test_there_is_python_on_the_pages_that_need_it() -> None:
    assert set(with_python(PAGES)) >= {"add-a-backend", "add-a-camera", "conventions", "evaluation", "tracking"}


@pytest.mark.parametrize("page", sorted({*with_python(PAGES)} - {"add-a-backend", "add-a-camera", "evaluation"}))
def test_its_python_runs_and_says_something(page: str, run_page: Callable[[str], Page]) -> None:
    said = run_page(page).said
    assert said
    assert not [line for line in said if " lost " in line]


def test_the_areas_of_the_page_on_evaluation_are_those_that_it_names(run_page: Callable[[str], Page]) -> None:
    said = run_page("evaluation").said
    assert said == re.findall(r"print\(.*\)  # ([\d.]+):", PAGES["evaluation"])


def test_the_backend_of_its_page_tracks_and_refuses_what_it_does_not_know(run_page: Callable[[str], Page]) -> None:
    page = run_page("add-a-backend")
    assert page.said[-1] == "20 of 20 frames tracked"
    with pytest.raises(ConfigError, match=r"does not know .*pink.*; it knows red, yellow"):
        page.names["Hues"]().labels_for(["red", "pink"])


def test_the_camera_of_its_page_is_tracked_and_refuses_what_is_none(
    run_page: Callable[[str], Page], tmp_path: Path
) -> None:
    page = run_page("add-a-camera")
    assert [line for line in page.said if "tracking" in line]
    assert "dropped" in page.said[-1]
    camera = page.names["Dropped"]
    with pytest.raises(SourceError, match="there is no such folder"):
        camera("absent")
    with pytest.raises(SourceError, match="there is no option 'fps'; there is depth_unit"):
        camera(f"{tmp_path}?fps=3")
    for damaged in ("12.npz", "noon.npz"):
        (tmp_path / damaged).write_bytes(b"PK\3\4 this is no picture")
        with pytest.raises(SourceError, match=f"{damaged}: not a picture of this camera"):
            next(iter(camera(str(tmp_path))))
        (tmp_path / damaged).unlink()


@pytest.mark.parametrize("page", [name for name, text in ALL.items() if commands(text)])
def test_its_commands_are_understood_by_the_programs(page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By their own parsers, with every option and value; nothing is run."""
    for program in MAINS.values():
        monkeypatch.setattr(program, "run", lambda _: None)
    for program, *arguments in commands(ALL[page]):
        monkeypatch.setattr(sys, "argv", [program, *arguments])
        try:
            MAINS[program].main()
        except SystemExit as ending:
            raise AssertionError(f"{page}: {program} {shlex.join(arguments)}") from ending


@pytest.mark.parametrize("page", [name for name, text in ALL.items() if blocks(text, "sh run")])
def test_the_commands_that_need_nothing_run_one_after_the_other(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = "".join(blocks(ALL[page], "sh run")).splitlines()
    for program, *arguments in commands(ALL[page], "sh run"):
        monkeypatch.setattr(sys, "argv", [program, *arguments])
        MAINS[program].main()
        lines.pop(0)
    assert not lines  # each was one of these
    assert list(tmp_path.iterdir())


def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """A link to a page, a heading or a picture that is not there is a warning, and so is a page that no menu has."""
    line = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "--keep-going",
        "-q",
        "-d",
        tmp_path / "cache",
        DOCS,
        tmp_path / "site",
    ]
    done = subprocess.run(list(map(str, line)), capture_output=True, text=True, check=False)  # noqa: S603
    assert (done.returncode, done.stderr) == (0, "")
    built = {path.stem for path in (tmp_path / "site").glob("*.html")}
    assert set(PAGES) <= built


def anchors(text: str) -> set[str]:
    """Of a page's headings, as hosting sites make them."""
    headings = re.findall(r"^#+ (.*)", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", ALL)
def test_its_links_lead_somewhere(page: str) -> None:
    home = ROOT if page == "README" else DOCS
    for target in re.findall(r"\]\(([^)\s]+)\)", ALL[page]):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        there = home / file if file else home / f"{page}.md"
        assert there.exists(), f"{page}: {target}"
        assert not anchor or anchor in anchors(there.read_text()), f"{page}: {target}"
