"""The settings of all stages together. Defaults live in the code; a file holds differences only."""

from __future__ import annotations

import reprlib
from pathlib import Path
from typing import Any, Literal, Self

import torch
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from tracker.closest_points import ClosestPointsConfig
from tracker.cloud import CloudConfig
from tracker.contacts import ContactConfig
from tracker.errors import ConfigError
from tracker.matching import MatchingConfig
from tracker.pose_filter import FilterConfig
from tracker.proposals import ProposalConfig
from tracker.refinement import RefinementConfig
from tracker.registration import RegistrationConfig
from tracker.saliency.device import torch_device
from tracker.silhouette import SilhouetteConfig
from tracker.verification import VerificationConfig
from tracker.view import ViewConfig
from tracker.yaml_files import read_yaml


class TrackerConfig(BaseModel):
    """prior: start from the predicted pose and search globally only where that fails; False makes every frame
    independent, as in the paper. believe: confidence under which a pose is not reported. regain: the same where nobody
    says which pixels are the object's, of a lost object that is seen again, and of one that has jumped. trust: score of
    the evidence (`tracker.verification.Evidence`) from which no other pose is looked for. jump: by how much the score
    may be lower than the last one for that. sure: confidence from which a pose whose score is so is not compared with
    others either, whatever that is, and that is asked of an object that was expected nowhere. concepts_every: looks of
    which one asks for the concepts nevertheless, where surface and colours alone lead from the prediction to such a
    pose. unsure_rad: standard deviation of its turn, by noise alone, from which a pose is held by where the object is
    if it stands still (`tracker.rest`). verified: candidates that are refined. seed: of the sampling. device: of
    matching and registration, "auto" is CUDA where there is one. masks: "given" by every frame, or "carried" on by the
    tracker itself from the first one on, which a frame's mask overrules. search_every: frames between searches of the
    whole picture for an object that is lost."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    prior: bool = True
    believe: float = Field(default=0.1, ge=0, le=1)
    regain: float = Field(default=0.3, ge=0, le=1)
    trust: float = Field(default=0.6, ge=0, le=1)
    jump: float = Field(default=0.1, ge=0, le=1)
    sure: float = Field(default=0.5, ge=0, le=1)
    concepts_every: int = Field(default=30, ge=1)
    unsure_rad: float = Field(default=0.01, gt=0)
    verified: int = Field(default=5, ge=1, le=64)
    seed: int = 42
    device: str = "auto"
    masks: Literal["given", "carried"] = "given"
    search_every: int = Field(default=3, ge=1)
    view: ViewConfig = ViewConfig()
    cloud: CloudConfig = CloudConfig()
    matching: MatchingConfig = MatchingConfig()
    registration: RegistrationConfig = RegistrationConfig()
    contacts: ContactConfig = ContactConfig()
    verification: VerificationConfig = VerificationConfig()
    closest_points: ClosestPointsConfig = ClosestPointsConfig()
    refinement: RefinementConfig = RefinementConfig()
    silhouette: SilhouetteConfig = SilhouetteConfig()
    proposals: ProposalConfig = ProposalConfig()
    filter: FilterConfig = FilterConfig()

    @model_validator(mode="after")
    def _carried_by_a_prior(self) -> Self:
        if self.masks == "carried" and not self.prior:
            raise ValueError("masks are carried from frame to frame: masks=carried needs prior=true")
        return self

    @property
    def torch_device(self) -> torch.device:
        """Raises ConfigError where the device does not exist here."""
        return torch_device(self.device)


def read_config(path: str | Path | None) -> TrackerConfig:
    """Defaults with the differences of a YAML file, None for the defaults alone.

    Raises ConfigError that names the file, the setting, and the settings that there are.
    """
    if path is None:
        return TrackerConfig()
    return parse_config(read_yaml(Path(path)) or {}, str(path))


def parse_config(content: Any, where: str) -> TrackerConfig:
    try:
        return TrackerConfig.model_validate(content)
    except ValidationError as error:
        raise ConfigError("\n".join(f"{where}: {_complaint(e)}" for e in error.errors())) from error


def dump_config(config: TrackerConfig) -> str:
    """All settings as YAML, defaults included."""
    return yaml.safe_dump(config.model_dump(), sort_keys=False)


def _complaint(error: Any) -> str:
    name = ".".join(str(part) for part in error["loc"]) or "the file"
    if error["type"] == "extra_forbidden":
        known = _settings_at([str(part) for part in error["loc"][:-1]])
        return f"there is no setting {name!r}; there are {', '.join(known)}"
    return f"{name}: {error['msg']} (got {reprlib.repr(error['input']):.200})"


def _settings_at(path: list[str]) -> list[str]:
    """Names of the settings of the stage that the path leads to."""
    model: type[BaseModel] = TrackerConfig
    for part in path:
        model = type(model.model_fields[part].default)
    return list(model.model_fields)
