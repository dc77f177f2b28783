"""What it takes, beside the settings in config.yaml, to do a run again: run.json in its folder."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from pydantic import ConfigDict, TypeAdapter, ValidationError

from tracker.concept import ConceptModel, told_apart
from tracker.config import TrackerConfig, read_config
from tracker.errors import OutputError, SourceError
from tracker.first_masks import FirstMasks
from tracker.frame import Frame
from tracker.in_order import InOrder
from tracker.pipeline import ObjectTracker
from tracker.pointing import parse_pointers
from tracker.result import TrackResult
from tracker.saliency import BackendOptions, SaliencyBackend, open_backend
from tracker.sources import FrameSource, LiveSource, open_source

FILE, CONFIG = "run.json", "config.yaml"


@dataclass(frozen=True, slots=True)
class SavedRun:
    """source: as it was opened. models: paths of the concept models. weights, device: of the backend. at: objects that
    were pointed out in the first frame, as --at has them."""

    __pydantic_config__ = ConfigDict(strict=True, extra="forbid")

    source: str
    models: tuple[str, ...]
    weights: str | None = None
    device: str = "auto"
    at: tuple[str, ...] = ()

    def save(self, folder: Path) -> None:
        """Raises OutputError."""
        content = asdict(self) | {"models": [str(Path(model).resolve()) for model in self.models]}
        try:
            (folder / FILE).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            raise OutputError(f"{folder / FILE}: cannot be written ({error.strerror})") from error

    @classmethod
    def load(cls, folder: Path) -> SavedRun:
        """Raises OutputError where there is none, or it is damaged."""
        try:
            return _RUN.validate_json((folder / FILE).read_bytes())
        except (OSError, ValidationError) as error:
            first = {} if isinstance(error, OSError) else error.errors()[0]
            why = f"{'.'.join(map(str, first['loc']))}: {first['msg']}" if first else str(error)
            raise OutputError(
                f"{folder / FILE} cannot be used ({why}); expected a folder that python -m tracker --out wrote"
            ) from error


_RUN = TypeAdapter(SavedRun)


class Replay:
    """A saved run, done again up to wherever it is of interest: with the same files and code it comes out the same.

    Where concepts were asked later, by a worker, it does not: here they are asked at once. Raises as what it opens
    does, and SourceError where the source was a camera, whose frames come once.
    """

    def __init__(self, folder: Path) -> None:
        run = SavedRun.load(folder)
        self.config: TrackerConfig = read_config(folder / CONFIG)
        self.models = told_apart([ConceptModel.load(path) for path in run.models])
        self.backend: SaliencyBackend = open_backend(self.models[0].backend, BackendOptions(run.weights, run.device))
        self.source: FrameSource = open_source(run.source)
        if isinstance(self.source, LiveSource):
            raise SourceError(
                f"{run.source} was a camera, whose frames come once: track what --record FILE wrote of it instead"
            )
        self.tracker = ObjectTracker(self.models, self.config, self.backend)
        self._pointed_out = parse_pointers(run.at, [model.object_id for model in self.models])

    def __iter__(self) -> Iterator[tuple[Frame, tuple[TrackResult, ...]]]:
        first_masks = FirstMasks(self._pointed_out)
        for object_id, there in self._pointed_out.items():
            self.tracker.point_out(object_id, there)
        for frame in InOrder(iter(self.source)):
            yield frame, self.tracker.step(frame if self.config.masks == "given" else first_masks(frame))
