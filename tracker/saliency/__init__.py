"""Where each named concept is in a picture of an object: the protocol, its result, and the table of backends."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from tracker.errors import ConfigError
from tracker.view import Box, Float32s, ObjectView


@dataclass(frozen=True, slots=True, eq=False)
class Saliency:
    """One map a concept over a part of a frame.

    labels: the L concepts. maps: (L, h, w) float32 in [0, 1]. box: the frame's pixels that the maps cover, at whatever
    resolution the backend has; it may reach beyond the frame.
    """

    labels: tuple[str, ...]
    maps: Float32s
    box: Box

    def sample(self, columns: npt.NDArray, rows: npt.NDArray) -> Float32s:
        """Values (N, L) at pixels of the frame, interpolated between the maps' pixels."""
        height, width = self.maps.shape[1:]
        x = (columns + 0.5 - self.box.x0) * (width / (self.box.x1 - self.box.x0)) - 0.5
        y = (rows + 0.5 - self.box.y0) * (height / (self.box.y1 - self.box.y0)) - 0.5
        x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
        left, top = np.minimum(x.astype(int), max(width - 2, 0)), np.minimum(y.astype(int), max(height - 2, 0))
        right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
        a, b = (x - left).astype(np.float32), (y - top).astype(np.float32)
        upper = self.maps[:, top, left] * (1 - a) + self.maps[:, top, right] * a
        lower = self.maps[:, bottom, left] * (1 - a) + self.maps[:, bottom, right] * a
        return np.ascontiguousarray((upper * (1 - b) + lower * b).T)

    def full(self, height: int, width: int) -> Float32s:
        """(L, height, width) maps over the whole frame, 0 outside the box."""
        x0, y0, x1, y1 = max(self.box.x0, 0), max(self.box.y0, 0), min(self.box.x1, width), min(self.box.y1, height)
        out = np.zeros((len(self.labels), height, width), np.float32)
        size = (self.box.x1 - self.box.x0, self.box.y1 - self.box.y0)
        for place, concept_map in zip(out, self.maps, strict=True):
            whole = cv2.resize(concept_map, size, interpolation=cv2.INTER_LINEAR)
            place[y0:y1, x0:x1] = whole[y0 - self.box.y0 : y1 - self.box.y0, x0 - self.box.x0 : x1 - self.box.x0]
        return out


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """Where in this view is each of these L concepts?"""

    view: ObjectView
    labels: tuple[str, ...]


class SaliencyBackend(Protocol):
    """Finds concepts in views of objects; queries of several objects or frames at once may share a batch.

    name: as in `--backend`. weights: which it has, for reports. fingerprint: changes whenever its maps of the same
    query would.
    """

    @property
    def name(self) -> str: ...

    @property
    def weights(self) -> str: ...

    @property
    def fingerprint(self) -> str: ...

    def labels_for(self, wanted: Sequence[str] | None) -> tuple[str, ...]:
        """The labels to ask for when a model is to hold these concepts; None leaves the choice to the backend.

        Raises ConfigError where it cannot find one of them in any picture.
        """
        ...

    def __call__(self, queries: Sequence[Query]) -> list[Saliency]:
        """One Saliency a query, whose labels are the query's."""
        ...


def fingerprint_of(name: str, settings: str) -> str:
    """A short text that differs between backends and between settings of one."""
    return f"{name}-{hashlib.sha256(settings.encode()).hexdigest()[:12]}"


def require_labels(labels: Sequence[str]) -> tuple[str, ...]:
    """Raises ConfigError unless there are labels, each with a text, no two alike."""
    known: set[str] = set()
    for label in labels:
        if not label.strip():
            raise ConfigError(f"a concept's label has a text, got {label!r} among {len(labels)}")
        if label.strip().casefold() in known:
            raise ConfigError(f"two concepts are called {label!r}: a vocabulary has no label twice")
        known.add(label.strip().casefold())
    if not labels:
        raise ConfigError("the vocabulary is empty: expected at least one concept")
    return tuple(labels)


@dataclass(frozen=True, slots=True)
class BackendOptions:
    """What a backend with weights is opened with.

    weights: a size it has a name for, a model's name on the hub, or a folder; None is the paper's choice.
    device: "auto" is CUDA where there is one.
    """

    weights: str | None = None
    device: str = "auto"


def _attributes(options: BackendOptions) -> SaliencyBackend:
    from tracker.saliency.attributes import Attributes

    if options.weights is not None:
        raise ConfigError(f"backend attributes measures, it has no weights to load; got {options.weights!r}")
    return Attributes()


def _siglip2(options: BackendOptions) -> SaliencyBackend:
    from tracker.saliency.siglip2 import open_siglip2

    return open_siglip2(options)


def _clip(options: BackendOptions) -> SaliencyBackend:
    from tracker.saliency.clip import open_clip

    return open_clip(options)


def _dinotxt(options: BackendOptions) -> SaliencyBackend:
    from tracker.saliency.dinotxt import open_dinotxt

    return open_dinotxt(options)


BACKENDS: dict[str, Callable[[BackendOptions], SaliencyBackend]] = {
    "attributes": _attributes,
    "siglip2": _siglip2,
    "clip": _clip,
    "dinotxt": _dinotxt,
}
WITHOUT_WEIGHTS = ("attributes",)
INSTALLED = "conceptrack.backends"  # entry points of installed packages: NAME = "module:function of BackendOptions"


def open_backend(name: str, options: BackendOptions | None = None) -> SaliencyBackend:
    """The backend of this name, or of several: NAME[*WEIGHT]+NAME[*WEIGHT]... asks them together.

    Raises ConfigError that lists those that there are, ours and those of installed packages.
    """
    options = options or BackendOptions()
    parts = [_part(text, name) for text in name.split("+")]
    if len(parts) == 1 and parts[0][1] == 1:
        return _opener(parts[0][0])(options)
    if len({part for part, _ in parts}) < len(parts):
        raise ConfigError(f"backend {name!r} has a part twice")
    from tracker.saliency.combined import Combined

    bare = BackendOptions(None, options.device)
    return Combined([(_opener(p)(bare if p in WITHOUT_WEIGHTS else options), w) for p, w in parts])


def _part(text: str, whole: str) -> tuple[str, float]:
    name, separator, weight = text.partition("*")
    known = dict.fromkeys((*BACKENDS, *entry_points(group=INSTALLED).names))
    if name not in known:
        raise ConfigError(f"there is no saliency backend {name!r}; expected one of {', '.join(known)}")
    try:
        share = float(weight) if separator else 1.0
    except ValueError:
        share = 0.0
    if not 0 < share <= 1:
        raise ConfigError(f"backend {whole!r}: a weight is a number over 0 and up to 1, got {weight!r}")
    return name, share


def _opener(name: str) -> Callable[[BackendOptions], SaliencyBackend]:
    """Only what is installed: a model's file names its backend too, and is not to run code."""
    if name in BACKENDS:
        return BACKENDS[name]
    (entry, *_) = entry_points(group=INSTALLED, name=name)
    try:
        return entry.load()
    except (ImportError, AttributeError) as error:
        raise ConfigError(f"the package that has backend {name!r} cannot be loaded ({entry.value}: {error})") from error
