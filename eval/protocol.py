"""How a dataset is tracked: all that an evaluation may choose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from eval.datasets import MaskKind
from eval.peers import method_kind
from reference.vocabulary import VocabularySet
from tracker.config import TrackerConfig
from tracker.errors import ConfigError
from tracker.saliency import SaliencyBackend

PosesThatCount = Literal["filtered", "raw"]


@dataclass(frozen=True, slots=True)
class Protocol:
    """views: reference frames an object and scene, picked from its own frames. poses: which of a result's poses count.
    vocabularies: the concepts of each object, None for the backend's own. method: "ours", or a peer as `eval.peers` has
    it. initialisation: "gt" tells the method each object's true pose, once a scene, in the first frame where the object
    is visible. concepts: only the first so many of the vocabulary, all where there are fewer. masks: which the
    dataset's frames have, those that models are made of too. smooth: "offline" smooths the filtered poses over each
    scene. unposed: reference frames are spread over the scene, and of their poses only the first one's is told, which
    sets the object frame. complete: models grow by frames of which the tracker is sure, once those are tracked.

    Raises ConfigError where the method does not exist, or cannot do with that initialisation, with no view or concept,
    or where there are no filtered poses to smooth.
    """

    backend: SaliencyBackend
    config: TrackerConfig
    views: int
    poses: PosesThatCount = "filtered"
    vocabularies: VocabularySet | None = None
    method: str = "ours"
    initialisation: Literal["estimated", "gt"] = "estimated"
    concepts: int | None = None
    masks: MaskKind = "visib"
    smooth: Literal["off", "offline"] = "off"
    unposed: bool = False
    complete: bool = False

    def __post_init__(self) -> None:
        if self.views < 1:
            raise ConfigError(f"--views: at least one reference frame is needed, got {self.views}")
        if self.concepts is not None and self.concepts < 1:
            raise ConfigError(f"--concepts: at least one concept is needed, got {self.concepts}")
        if self.config.masks == "carried" and self.method != "ours":
            raise ConfigError(
                f"method {self.method} is given the masks of every frame: --masks carried is of no use to it"
            )
        if self.complete and self.method != "ours":
            raise ConfigError(f"method {self.method} has a model once and for all: --complete is of no use to it")
        if self.smooth != "off" and (self.method != "ours" or self.poses != "filtered" or not self.config.prior):
            raise ConfigError(
                f"--smooth {self.smooth} smooths this tracker's filtered poses: it needs --method ours, "
                "--poses filtered and --prior on"
            )
        start = method_kind(self.method).start
        if start == "needed" and self.initialisation != "gt":
            raise ConfigError(f"method {self.method} goes on from a pose that it is told: it needs --init gt")
        if start == "used" and self.initialisation == "gt" and not self.config.prior:
            raise ConfigError(f"method {self.method} uses no start with the prior off: --init gt needs --prior on")

    def labels_of(self, object_id: str, category: str | None = None) -> tuple[str, ...] | None:
        """The concepts to look for on an object; None leaves the choice to the backend."""
        labels = self.vocabularies.for_object(object_id, category).labels if self.vocabularies else None
        return labels if self.concepts is None else (labels or self.backend.labels_for(None))[: self.concepts]
