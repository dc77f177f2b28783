"""What an ablation varies: a YAML file whose format `eval/presets/measure.yaml` describes in its header."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from tracker.errors import ConfigError
from tracker.yaml_files import read_yaml

SHIPPED = Path(__file__).with_name("presets")

# Name in scores.json, or "ms" (median time of an object's step) -> heading, digits.
COLUMNS: dict[str, tuple[str, int]] = {
    "add_auc": ("ADD", 1),
    "adds_auc": ("ADD-S", 1),
    "add_auc_2cm": ("ADD 2cm", 1),
    "adds_auc_2cm": ("ADD-S 2cm", 1),
    "add_or_adds_auc": ("ADD(-S)", 1),
    "add_or_adds_recall_0.1d": ("ADD(-S) 0.1d", 1),
    "ar": ("AR", 3),
    "ar_vsd": ("VSD", 3),
    "ar_mssd": ("MSSD", 3),
    "ar_mspd": ("MSPD", 3),
    "recall_5deg_2cm": ("5° 2cm", 1),
    "recall_10deg_5cm": ("10° 5cm", 1),
    "iou_mean": ("IoU", 1),
    "iou_recall_50": ("IoU > 50%", 1),
    "iou_recall_75": ("IoU > 75%", 1),
    "over_1cm": ("> 1cm", 1),
    "instances": ("n", 0),
    "missing": ("missing", 0),
    "ms": ("ms", 1),
}


class Options(BaseModel):
    """Options of `eval track`, by their names there."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    method: str | None = None
    init: Literal["estimated", "gt"] | None = None
    backend: str | None = None
    weights: str | None = None
    vocabulary: str | None = None
    concepts: int | None = Field(default=None, ge=1)
    views: int | None = Field(default=None, ge=1)
    masks: Literal["visib", "full", "carried"] | None = None
    poses: Literal["filtered", "raw"] | None = None


class Variation(BaseModel):
    """One row of a table. config: differences of the tracker's settings. paper: what the paper has, by column."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(min_length=1)
    options: Options = Options()
    config: dict[str, Any] = {}
    paper: dict[str, float] = {}


class Preset(BaseModel):
    """title, about: of the table. paper_data: what the paper's numbers were measured on. columns: of `COLUMNS`.
    options, config: of all cells, over which a variation's prevail. axes: lists of variations; a cell is one of each.
    analysis: "occlusion" adds the regression of error on occlusion."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: str = Field(min_length=1)
    about: str = ""
    paper_data: str = ""
    columns: tuple[str, ...] = Field(min_length=1)
    options: Options = Options()
    config: dict[str, Any] = {}
    axes: tuple[tuple[Variation, ...], ...] = Field(min_length=1)
    analysis: Literal["occlusion"] | None = None

    @model_validator(mode="after")
    def _is_whole(self) -> Preset:
        for place, axis in enumerate(self.axes):
            names = [variation.name for variation in axis]
            if not names or len(set(names)) < len(names):
                raise ValueError(f"axes.{place}: expected variations whose names all differ, got {names}")
            if len(self.axes) > 1 and any(variation.paper for variation in axis):
                raise ValueError(
                    f"axes.{place}: the paper's numbers are of a row, which a variation of several axes is not"
                )
        told = {column for axis in self.axes for variation in axis for column in variation.paper}
        if unknown := [name for name in (*self.columns, *told) if name not in COLUMNS]:
            raise ValueError(f"there is no column {', '.join(unknown)}; there are {', '.join(COLUMNS)}")
        return self

    def cells(self) -> list[Variation]:
        """One of each axis together, the last axis fastest; the preset's own options and settings are in them."""
        return [self._cell(chosen) for chosen in product(*self.axes)]

    def _cell(self, chosen: tuple[Variation, ...]) -> Variation:
        layers = [self.options, *(variation.options for variation in chosen)]
        options = {name: value for layer in layers for name, value in layer.model_dump(exclude_unset=True).items()}
        config = self.config
        for variation in chosen:
            config = over(config, variation.config)
        paper = chosen[0].paper if len(chosen) == 1 else {}
        return Variation(name=", ".join(v.name for v in chosen), options=Options(**options), config=config, paper=paper)


def over(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Settings with differences laid over them, stage by stage."""
    both = {name: over(below[name], above[name]) for name in below.keys() & above.keys() if _stages(below, above, name)}
    return {**below, **above, **both}


def _stages(below: Mapping[str, Any], above: Mapping[str, Any], name: str) -> bool:
    return isinstance(below[name], Mapping) and isinstance(above[name], Mapping)


def shipped_presets() -> tuple[str, ...]:
    """Names of the presets that come with the project."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.yaml")))


def preset_path(name_or_path: str) -> Path:
    """Raises ConfigError that lists the shipped presets where there is no such file."""
    path = SHIPPED / f"{name_or_path}.yaml" if name_or_path in shipped_presets() else Path(name_or_path)
    if not path.is_file():
        known = ", ".join(shipped_presets())
        raise ConfigError(f"there is no preset {name_or_path!r}; expected a YAML file, or one of {known}")
    return path


def read_preset(name_or_path: str) -> Preset:
    """A shipped preset by its name, or one from a file. Raises ConfigError that names the file and the key in it."""
    path = preset_path(name_or_path)
    try:
        return Preset.model_validate(read_yaml(path))
    except UnicodeEncodeError as error:  # half of a pair of surrogates, as an escape
        raise ConfigError(f"{path}: holds characters that no text has ({error.reason})") from error
    except ValidationError as error:
        raise ConfigError("; ".join(f"{path}: {_complaint(each)}" for each in error.errors())) from error


def _complaint(error: Any) -> str:
    where = ".".join(str(part) for part in error["loc"]) or "the file"
    if error["type"] == "extra_forbidden":
        return f"there is no key {where!r}"
    return f"{where}: {error['msg']}"
