"""What every measurement is asked beside its own, and what becomes of its figures."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.table import Table

from tracker.terminal import STDERR, hush


@dataclass(kw_only=True)
class Measurement(ABC):
    """A command that prints its figures as a table and writes them as JSON, with what they were measured on."""

    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """File for the figures."""
    overwrite: bool = False
    """Replace the file if it exists."""
    quiet: bool = False
    """Nothing on the terminal but warnings and errors."""

    def __call__(self) -> None:
        """Raises OutputError where the file exists or cannot be written, ConfigError as `measured` does."""
        from eval.environment import write_figures
        from tracker.output import require_free

        hush(self.quiet)
        if self.json:
            require_free(self.json, self.overwrite)
        figures = self.measured()
        table = Table("", "", title=self.title(), show_header=False)
        for name, text in self.rows(figures):
            table.add_row(name.replace("_", " "), text)
        STDERR.print(table)
        if self.json:
            write_figures(self.json, figures)

    @abstractmethod
    def title(self) -> str:
        """Of the table."""

    @abstractmethod
    def measured(self) -> dict[str, Any]:
        """Figures by their names. Raises ConfigError where what is asked for cannot be measured."""

    def rows(self, figures: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Of the table: a name and a text."""
        for name, value in figures.items():
            yield name, text_of(value)


def text_of(value: object, between: str = "\n") -> str:
    """A line a figure of a mapping; what is in those, in one line. between: the figures."""
    if isinstance(value, dict):
        figures = (f"({text_of(v, ', ')})" if isinstance(v, dict) else text_of(v) for v in value.values())
        return between.join(f"{k}: {figure}" for k, figure in zip(value, figures, strict=True))
    return f"{value:.4g}" if isinstance(value, float) else str(value)
