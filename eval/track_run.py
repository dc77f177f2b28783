"""Everything that decides what a run over a dataset gives, as plain values that can be sent to another process."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Literal

from eval.datasets import Dataset, MaskKind, open_dataset
from eval.environment import package_versions
from eval.peers import method_kind
from eval.protocol import Protocol
from reference.vocabulary import VocabularySet
from tracker.config import TrackerConfig, parse_config
from tracker.errors import ConfigError
from tracker.saliency import BackendOptions, SaliencyBackend, open_backend

ROOT = Path(__file__).resolve().parents[1]
# What poses come out of. A page or a table may change without a pose being computed again.
DECIDE = (
    "tracker", "reference", "eval/datasets", "eval/peers", "eval/protocol.py", "eval/scene_models.py",
    "eval/tracked.py", "eval/predict.py", "eval/bop_results.py",
)  # fmt: skip
MASKS = {
    "visib": "the dataset's visible masks",
    "full": "the dataset's full masks: whole silhouettes, with the pixels of whatever hides the object",
    "carried": "carried by the tracker from the dataset's first visible mask of each object and scene",
}
UNPOSED = "found by the tracker; the first one's true pose sets the object frame"
COMPLETED = "models grow by frames that were tracked, after they were, where the tracker is sure of its pose"


@dataclass(frozen=True, slots=True)
class TrackRun:
    """How a dataset is tracked, by names: `eval.protocol.Protocol` has the meaning of the fields, with what was opened.

    dataset: as `eval.datasets` opens it. vocabulary: its name, for the report; vocabularies: what is in it, so that no
    file has to be where a unit is tracked. object_ids: only these. masks: one of `MASKS`. threads: of torch in a
    process; another number may change the last digits of a result. Raises ConfigError where `threads` is no number of
    threads, or where masks are to be carried and the rest does not allow it.
    """

    dataset: str
    config: TrackerConfig = field(default_factory=TrackerConfig)
    backend: str = "attributes"
    weights: str | None = None
    device: str = "auto"
    vocabulary: str | None = None
    vocabularies: VocabularySet | None = None
    concepts: int | None = None
    method: str = "ours"
    initialisation: Literal["estimated", "gt"] = "estimated"
    views: int = 2
    masks: str = "visib"
    poses: Literal["filtered", "raw"] = "filtered"
    smooth: Literal["off", "offline"] = "off"
    unposed: bool = False
    complete: bool = False
    object_ids: tuple[str, ...] | None = None
    threads: int = 1

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise ConfigError(f"--threads: at least one is needed, got {self.threads}")
        if "carried" in (self.masks, self.config.masks):  # either says so: the run's masks, or a config file
            if self.masks == "full":
                raise ConfigError("--masks full gives masks of every frame, masks=carried of the config takes one")
            config = parse_config({**self.config.model_dump(), "masks": "carried"}, "--masks carried")
            object.__setattr__(self, "config", config)
            object.__setattr__(self, "masks", "carried")

    @property
    def given_masks(self) -> MaskKind:
        """Which of the dataset's masks its frames have."""
        return "full" if self.masks == "full" else "visib"

    def protocol(self) -> Protocol:
        """Opens the backend, once a process. Raises ConfigError where the parts do not go together."""
        return Protocol(
            backend=opened_backend(self.backend, BackendOptions(self.weights, self.device)),
            config=self.config,
            views=self.views,
            poses=self.poses,
            smooth=self.smooth,
            vocabularies=self.vocabularies,
            method=self.method,
            initialisation=self.initialisation,
            concepts=self.concepts,
            masks=self.given_masks,
            unposed=self.unposed,
            complete=self.complete,
        )

    def stated(self, backend: SaliencyBackend) -> dict[str, object]:
        """What a report's protocol says of the run, JSON-ready."""
        kind = method_kind(self.method)
        return {
            "method": self.method,
            **kind.stated(self.config, backend, self.vocabulary, self.initialisation),
            "concepts": (self.concepts or "all of the vocabulary") if kind.concepts else "not used by the method",
            "views": self.views,
            "reference_poses": UNPOSED if self.unposed else "true ones",
            "completion": COMPLETED if self.complete else "none: models stay as they are",
            "masks": MASKS[self.masks],
            "reinitialisation": "by the method itself, never from the truth",
            "poses": self.poses,
            "smoothing": self.smooth,
        }

    def decided_by(self, scene_id: int, backend: SaliencyBackend) -> dict[str, object]:
        """All that decides the poses of a scene, JSON-ready: the run, the code and the libraries.

        The content of the dataset's files and of a weights folder are not in it, only their names (and what a
        backend's own fingerprint knows of its weights).
        """
        return {
            "dataset": self.dataset,
            "scene": scene_id,
            "objects": "all" if self.object_ids is None else sorted(set(self.object_ids)),
            "method": self.method,
            "method_settings": method_kind(self.method).settings,
            "initialisation": self.initialisation,
            "config": self.config.model_dump(mode="json"),
            "backend": [self.backend, backend.fingerprint, backend.weights, self.device],
            "vocabulary": None if self.vocabularies is None else asdict(self.vocabularies),
            "concepts": self.concepts,
            "views": self.views,
            "masks": self.masks,
            "poses": self.poses,
            "smooth": self.smooth,
            "unposed": self.unposed,
            "complete": self.complete,
            "threads": self.threads,
            "code": code_fingerprint(),
            "packages": package_versions(),
        }


def fingerprint_of(decided_by: Mapping[str, object]) -> str:
    """A short name that differs wherever what decides a result does."""
    return hashlib.sha256(json.dumps(decided_by, sort_keys=True).encode()).hexdigest()[:24]


@cache
def code_fingerprint() -> str:
    """Of the source files that poses come out of.

    The version alone is not enough: while somebody works on the code it stays the same, and a table of an ablation
    would mix results of before and after. Too many scenes tracked again cost time, too few cost the truth.
    """
    found = hashlib.sha256()
    for path in sorted(file for part in DECIDE for file in _sources(ROOT / part)):
        content = path.read_bytes()
        found.update(f"{path.relative_to(ROOT).as_posix()} {len(content)}\n".encode() + content)
    return found.hexdigest()[:24]


def _sources(path: Path) -> list[Path]:
    return [path] if path.is_file() else list(path.rglob("*.py"))


@lru_cache(maxsize=1)
def opened_backend(name: str, options: BackendOptions) -> SaliencyBackend:
    """One a process: weights are large, and the units of a run come one after the other."""
    return open_backend(name, options)


@lru_cache(maxsize=1)
def opened_dataset(name: str) -> Dataset:
    """One a process, as reading the truth of a large scene takes longer than tracking a small one."""
    return open_dataset(name)
