"""The README's own lines run, and what it names exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()


def python_block() -> str:
    """All of it, as one program."""
    return "\n".join(re.findall(r"```python\n(.*?)```", README, re.DOTALL))


def test_its_ten_lines_of_python_track_the_sequence(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {}
    exec(compile(python_block(), "README.md", "exec"), names)  # noqa: S102 - that they run is what is tested
    lines = capsys.readouterr().out.splitlines()
    assert sum("tracking" in line for line in lines) == 20


def test_its_python_tells_the_shapes_of_what_it_makes() -> None:
    code = [line for line in python_block().splitlines() if line and not line.startswith(("from", "tracker ="))]
    assert all("#" in line for line in code)


def test_its_links_and_pictures_are_there() -> None:
    targets = [target for target in re.findall(r"\]\(([^)]+)\)", README) if "://" not in target]
    assert targets
    assert not [target for target in targets if not (ROOT / target).exists()]


@pytest.mark.parametrize("program", ["reference", "tracker", "eval"])
def test_every_option_that_it_shows_is_an_option_of_the_program(program: str) -> None:
    shown = {
        option for line in re.findall(rf"python -m {program} .*", README) for option in re.findall(r"--[a-z]+", line)
    }
    source = "\n".join(path.read_text() for path in (ROOT / program).rglob("*.py"))
    assert shown
    named = {f"--{name}" for name in re.findall(r'tyro\.conf\.arg\(name="([a-z]+)"', source)}
    assert {o for o in shown - named if not re.search(rf"^    {o[2:]}: .*\n    \"\"\"", source, re.MULTILINE)} == set()
