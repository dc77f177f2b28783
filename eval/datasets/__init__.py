"""What there is to evaluate on: `open_dataset("bop:PATH")` and the protocol that a dataset fulfils."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from eval.symmetries import ASYMMETRIC, ObjectSymmetries
from tracker.errors import SourceError
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.sources import PosedSource

# Of an object's pixels those that can be seen, or its whole silhouette, also where something else hides it.
MaskKind = Literal["visib", "full"]
LEAST_VISIBLE_FRACTION = 0.1  # BOP: an instance of which less can be seen is no target


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """An object in an image whose pose is to be estimated.

    index: position of the image in its scene. image_id: its number in the dataset. T_cam_obj: the true pose.
    visible_px, visible_fraction: what can be seen of the object.
    """

    index: int
    image_id: int
    object_id: str
    T_cam_obj: Pose
    visible_px: int
    visible_fraction: float


@dataclass(frozen=True, slots=True, eq=False)
class ObjectModel:
    """The shape that errors are measured on; no tracker sees it.

    points_m: (N, 3) object coordinates. diameter_m: the largest distance between two of its points, as the dataset
    says. symmetric: whether the dataset declares a symmetry; None where it declares nothing about any object.
    symmetries: which motions look the same. triangles: (M, 3) indices into the mesh's vertices; None for a cloud of
    points, of which no picture can be rendered. vertices_m: (V, 3) of the mesh, None where they are the points.
    """

    points_m: Floats
    diameter_m: float
    symmetric: bool | None
    symmetries: ObjectSymmetries = ASYMMETRIC
    triangles: npt.NDArray[np.integer] | None = None
    vertices_m: Floats | None = None

    @property
    def mesh_vertices_m(self) -> Floats:
        return self.points_m if self.vertices_m is None else self.vertices_m


@runtime_checkable
class CameraSource(Protocol):
    """A source that tells a frame's camera without reading its pictures. Of one that does not, the frame is read."""

    def camera(self, index: int) -> Intrinsics: ...


@runtime_checkable
class CategoryDataset(Protocol):
    """A dataset whose objects are instances of categories, such as several mugs. An object of another one is known by
    its own name alone."""

    def category(self, object_id: str) -> str: ...


class Dataset(Protocol):
    """Scenes with known poses, the instances in them that count, and the models to measure with.

    Objects are called by text everywhere but in BOP's result file, which numbers them: `number` and `object_with`.
    Whatever is asked for that is not there is a SourceError that lists what is.
    """

    @property
    def name(self) -> str:
        """As the user wrote it."""
        ...

    @property
    def target_rule(self) -> str:
        """Which frames and instances are targets, for the protocol of a report."""
        ...

    @property
    def model_frame(self) -> str:
        """Whose object coordinates the poses are in, for the protocol of a report."""
        ...

    @property
    def scene_ids(self) -> tuple[int, ...]: ...

    @property
    def object_ids(self) -> tuple[str, ...]: ...

    def scene(self, scene_id: int, masks: MaskKind = "visib") -> PosedSource:
        """masks: which its frames have. What is told of an object without reading a frame (visible_px) does not depend
        on it."""
        ...

    def image_ids(self, scene_id: int) -> Sequence[int]:
        """Number of every image of the scene, by its position in the source."""
        ...

    def targets(self, scene_id: int) -> list[Target]:
        """In the order of images, then of objects."""
        ...

    def model(self, object_id: str) -> ObjectModel: ...

    def number(self, object_id: str) -> int: ...

    def object_with(self, number: int) -> str: ...


def category_of(dataset: Dataset, object_id: str) -> str | None:
    """What the object is an instance of; None where the dataset does not say."""
    return dataset.category(object_id) if isinstance(dataset, CategoryDataset) else None


def require(kind: str, asked: object, available: Sequence[object], dataset: str) -> None:
    """Raises SourceError unless the dataset has what was asked for; the message lists what it has."""
    if asked not in available:
        raise SourceError(f"{dataset} has no {kind} {asked!r}; it has {', '.join(map(str, available)) or 'none'}")


def require_visible_masks(masks: MaskKind, dataset: str) -> None:
    """At the door of a dataset whose layout has no other masks. Raises SourceError that says so."""
    if masks != "visib":
        raise SourceError(f"{dataset} has no {masks} masks; it has visib (what can be seen of an object)")


def number_of(object_id: str, names: Sequence[str], dataset: str) -> int:
    """The object's place in the names, from 1. Raises SourceError where it has none."""
    require("object", object_id, names, dataset)
    return names.index(object_id) + 1


def name_of(number: int, names: Sequence[str], dataset: str) -> str:
    """Inverse of `number_of`."""
    require("object number", number, range(1, len(names) + 1), dataset)
    return names[number - 1]


def _bop(argument: str) -> Dataset:
    from eval.datasets.bop import BopDataset

    return BopDataset(argument)


def _synthetic(argument: str) -> Dataset:
    from eval.datasets.synthetic import open_synthetic

    return open_synthetic(argument)


def _ycb_video(argument: str) -> Dataset:
    from eval.datasets.ycb_video import YcbVideoDataset

    return YcbVideoDataset(argument)


def _nocs(argument: str) -> Dataset:
    from eval.datasets.nocs import NocsDataset

    return NocsDataset(argument)


def _ycbineoat(argument: str) -> Dataset:
    from eval.datasets.ycbineoat import YcbInEoatDataset

    return YcbInEoatDataset(argument)


DATASETS: dict[str, Callable[[str], Dataset]] = {
    "bop": _bop,
    "synthetic": _synthetic,
    "ycb-video": _ycb_video,
    "nocs": _nocs,
    "ycbineoat": _ycbineoat,
}


def open_dataset(name: str) -> Dataset:
    """`KIND:PATH` or `synthetic:NAME[?options]` -> the dataset. Raises SourceError where it cannot be one."""
    kind, separator, argument = name.partition(":")
    if kind not in DATASETS or not separator or not argument:
        raise SourceError(f"{name!r} is not a dataset; expected KIND:ARGUMENT with KIND one of {', '.join(DATASETS)}")
    return DATASETS[kind](argument)
