"""The README's ten lines of Python; `tests/test_documents.py` has its commands and links."""

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
