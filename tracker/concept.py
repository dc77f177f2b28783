"""The concept model of one object: what `reference` writes and `tracker` reads.

On disk it is a safetensors file: arrays and a JSON header, nothing that could run.
"""

from __future__ import annotations

import json
import reprlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy

from tracker.errors import ModelError
from tracker.frame import PosedFrame
from tracker.geometry import Floats
from tracker.grounding import ground
from tracker.reference_views import PARTS, packed, unpacked
from tracker.region import Region, region_of
from tracker.saliency import SaliencyBackend, open_backend
from tracker.sources.json_files import DAMAGE
from tracker.symmetry import NO_SYMMETRY, Symmetry
from tracker.view import Float32s
from tracker.whole_file import write_whole

FORMAT_VERSION = 2
FORMAT = "conceptrack concept model"
FARTHEST_M = 1000.0  # from the origin of the object's coordinates
# Beyond what any model holds, so that no number of a file overflows later on.
MOST_OF = {"points": FARTHEST_M, "normals": 100, "view_directions": 100, "colours": 256, "saliency": 2, "agreement": 2}
ARRAYS = ("points", "normals", "colours", "saliency", "view_count", "agreement", "view_directions")


@dataclass(frozen=True, slots=True, eq=False)
class ConceptModel:
    """Points of an object's surface that know what they are. In object coordinates, metres.

    object_id: as in frames' masks. points, normals: (N, 3). colours: (N, 3) float32 RGB in [0, 255].
    saliency: (N, L) float32 in [0, 1], a value a concept, before the softmax. view_count: (N,) int32, reference views
    that saw the point. agreement: (N,) float32 in [0, 1], cosine between what the views say of it (1 where one saw it).
    view_directions: (K, 3) unit, from the object towards the cameras of the reference views.
    diameter_m: greatest distance between two points seen; the scale at which saliency was measured.
    labels: the L concepts. backend, fingerprint: who measured them and with which settings.
    notes: how it came about (reference frames, quality), JSON-ready.
    references: the K reference views, empty outside the object's box, so that other concepts can be asked for later.
    symmetry: the turns after which it looks the same.
    """

    object_id: str
    points: Floats
    normals: Floats
    colours: Float32s
    saliency: Float32s
    view_count: np.ndarray
    agreement: Float32s
    view_directions: Floats
    diameter_m: float
    labels: tuple[str, ...]
    backend: str
    fingerprint: str
    notes: dict[str, Any] = field(default_factory=dict)
    references: tuple[PosedFrame, ...] = ()
    symmetry: Symmetry = NO_SYMMETRY

    def __len__(self) -> int:
        return len(self.points)

    def locate(self, label: str, backend: SaliencyBackend | None = None) -> Region | None:
        """Where on the object a concept is, in object coordinates; None where it is not to be seen on it.

        A label outside the model's vocabulary is looked for in the reference views, by the backend that made the model
        (None opens it by name). Raises ModelError where there are no views, ConfigError where the backend knows no
        such concept.
        """
        if label in self.labels:
            saliency = self.saliency[:, self.labels.index(label)].astype(np.float64)
        elif self.references:
            backend = backend or open_backend(self.backend)
            self.require_backend(backend)
            saliency = ground(label, self.references, backend, self.points, self.diameter_m)
        else:
            raise ModelError(
                f"the model of {self.object_id!r} does not hold {label!r} and has no reference views to look for it; "
                f"it holds {', '.join(self.labels)}"
            )
        return region_of(label, self.points, saliency, self.diameter_m)

    def require_backend(self, backend: SaliencyBackend) -> None:
        """Raises ModelError unless this backend measured the model, with the settings that it has now.

        Labels are no part of that: a backend finds those that the model asks for."""
        if self.fingerprint != backend.fingerprint:
            raise ModelError(
                f"the model of {self.object_id!r} was made by backend {self.backend} ({self.fingerprint}), "
                f"it cannot be tracked with {backend.name} ({backend.fingerprint}): make it again with "
                f"python -m reference ... --backend {backend.name}"
            )

    def save(self, path: str | Path) -> None:
        """Write the file whole or not at all. Raises OutputError where it cannot be written."""
        path = Path(path)
        views, view_headers = packed(self.references)
        header = {
            "format": FORMAT,
            "version": FORMAT_VERSION,
            "object_id": self.object_id,
            "diameter_m": self.diameter_m,
            "labels": self.labels,
            "backend": self.backend,
            "fingerprint": self.fingerprint,
            "notes": self.notes,
            "references": view_headers,
            "symmetry": self.symmetry.packed(),
        }
        arrays = {name: np.ascontiguousarray(getattr(self, name)) for name in ARRAYS} | views
        content = safetensors.numpy.save(arrays, metadata={"concept_model": json.dumps(header)})
        write_whole(path, content)

    @classmethod
    def load(cls, path: str | Path) -> ConceptModel:
        """Raises ModelError where the file is missing, damaged, of another version, or no concept model at all."""
        path = Path(path)
        if not path.is_file():
            raise ModelError(f"{path}: there is no such model file")
        try:
            with safetensors.safe_open(path, framework="numpy") as file:
                header = json.loads((file.metadata() or {}).get("concept_model", "{}"))
                _check_header(path, header)
                arrays = {name: file.get_tensor(name) for name in ARRAYS}
                names = (f"view{k}.{part}" for k in range(len(header["references"])) for part in PARTS)
                symmetry = Symmetry.unpacked(header["symmetry"])
                views = unpacked({n: file.get_tensor(n) for n in names}, header["references"], header["object_id"])
        except (safetensors.SafetensorError, OSError, RecursionError, *DAMAGE) as error:
            raise ModelError(f"{path}: not a whole concept model ({error})") from error
        _check_arrays(path, arrays, len(header["labels"]))
        return cls(
            object_id=header["object_id"],
            diameter_m=header["diameter_m"],
            labels=tuple(header["labels"]),
            backend=header["backend"],
            fingerprint=header["fingerprint"],
            notes=header["notes"],
            references=views,
            symmetry=symmetry,
            **arrays,
        )


def _check_header(path: Path, header: Any) -> None:
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise ModelError(f"{path}: a safetensors file, but not a concept model")
    if header.get("version") != FORMAT_VERSION:
        raise ModelError(
            f"{path}: a concept model of version {header.get('version')}, this program reads version {FORMAT_VERSION}: "
            "make it again with python -m reference"
        )
    expected = {
        "object_id": str,
        "diameter_m": float,
        "labels": list,
        "backend": str,
        "fingerprint": str,
        "notes": dict,
        "references": list,
        "symmetry": dict,
    }
    for key, kind in expected.items():
        if not isinstance(header.get(key), kind):
            raise ModelError(
                f"{path}: the header's {key} is {reprlib.repr(header.get(key))}, expected a {kind.__name__}"
            )
    if not 0 < header["diameter_m"] < FARTHEST_M:
        raise ModelError(f"{path}: the header's diameter_m is {header['diameter_m']}, expected a length in metres")
    if not header["labels"] or not all(isinstance(label, str) for label in header["labels"]):
        raise ModelError(f"{path}: the header's labels are {reprlib.repr(header['labels'])}, expected texts")


def _check_arrays(path: Path, arrays: dict[str, np.ndarray], concepts: int) -> None:
    points = len(arrays["points"])
    shapes = {
        "points": (points, 3),
        "normals": (points, 3),
        "colours": (points, 3),
        "saliency": (points, concepts),
        "view_count": (points,),
        "agreement": (points,),
        "view_directions": (len(arrays["view_directions"]), 3),
    }
    for name, shape in shapes.items():
        array, kinds = arrays[name], "iu" if name == "view_count" else "f"
        if array.shape != shape or array.dtype.kind not in kinds or not np.isfinite(array).all():
            raise ModelError(
                f"{path}: {name} has shape {array.shape} (expected {shape}), is of {array.dtype}, or is not finite"
            )
        if np.abs(array).max(initial=0) > MOST_OF.get(name, np.inf):
            raise ModelError(f"{path}: {name} has values beyond {MOST_OF[name]}")


def told_apart(models: Sequence[ConceptModel]) -> list[ConceptModel]:
    """The models, the second and further ones of an object named NAME_2, NAME_3: so many of the kind are tracked."""
    seen: Counter[str] = Counter()
    named = []
    for model in models:
        seen[model.object_id] += 1
        count = seen[model.object_id]
        named.append(model if count == 1 else replace(model, object_id=f"{model.object_id}_{count}"))
    return named
