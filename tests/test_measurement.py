"""What measurements share: a table, a file of figures that is not overwritten unasked."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from eval.bench.measurement import Measurement, text_of
from tracker.errors import OutputError


@dataclass
class Lengths(Measurement):
    """Two of them."""

    long_m: float = 2.5

    def title(self) -> str:
        return "lengths"

    def measured(self) -> dict[str, Any]:
        return {"long_m": self.long_m, "short_m": {"of_it": {"ms": 1.0, "mm": 2.0}}}


def test_figures_are_printed_and_written_with_what_they_were_measured_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Lengths(3.25, json=tmp_path / "figures.json")()
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["long_m"] == 3.25
    assert figures["environment"]["processor"]
    told = capsys.readouterr().err
    assert "long m" in told
    assert "3.25" in told


def test_a_file_is_overwritten_where_that_is_asked_for_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "figures.json"
    path.write_text("mine")
    with pytest.raises(OutputError, match=r"figures\.json exists already"):
        Lengths(json=path)()
    assert path.read_text() == "mine"
    Lengths(json=path, overwrite=True, quiet=True)()
    assert json.loads(path.read_text())["long_m"] == 2.5
    assert "2.5" not in capsys.readouterr().err


def test_figures_within_figures_stand_in_one_line() -> None:
    assert text_of({"0.5": {"ours": {"ms": 1.0, "mm": 2.25}, "theirs": None}, "all": 3}) == (
        "0.5: (ours: (ms: 1, mm: 2.25), theirs: None)\nall: 3"
    )
