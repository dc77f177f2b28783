"""A scene whose images have a picture of labels: every object in it has a value of its own, and a pose."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eval.datasets import Target
from tracker.errors import FrameError
from tracker.frame import Frame, Provenance
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.sources import Sighting, require_object
from tracker.sources.image_files import read_depth_m, read_labels, read_rgb

NOMINAL_RATE_HZ = 30.0  # images are numbered, none has a stamp


@dataclass(frozen=True, slots=True)
class ImageFiles:
    """The pictures of one image, and the file that says what is in them."""

    rgb: Path
    depth: Path
    labels: Path
    annotation: Path


@dataclass(frozen=True, slots=True, eq=False)
class Annotation:
    """What is known of one image without decoding a picture.

    K: (3, 3) camera matrix. metres_per_unit: of the depth picture. labels: object id -> its value in the picture of
    labels. poses: object id -> T_cam_obj, for those of them that have one.
    """

    K: Floats
    metres_per_unit: float
    labels: Mapping[str, int]
    poses: Mapping[str, Pose]


class LabelledScene:
    """Frames, masks and poses of one scene, each read when it is asked for; annotations and sightings are kept.

    images: image id -> its files, in order. annotate: reads the annotation of the image with this id. packed_depth: its
    depth pictures may be packed into colours.
    """

    def __init__(
        self,
        name: str,
        images: Mapping[int, ImageFiles],
        annotate: Callable[[int], Annotation],
        *,
        packed_depth: bool = False,
    ) -> None:
        self.name = name
        self.image_ids = list(images)
        self._images = images
        self._annotate = annotate
        self._packed_depth = packed_depth
        self._annotations: dict[int, Annotation] = {}
        self._seen: dict[int, dict[str, Sighting]] = {}

    def __len__(self) -> int:
        return len(self.image_ids)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        image_id = self.image_ids[index]
        files, annotation = self._images[image_id], self.annotation(index)
        rgb, labels = read_rgb(files.rgb), read_labels(files.labels)
        try:
            intrinsics = Intrinsics.from_matrix(annotation.K, rgb.shape[1], rgb.shape[0])
        except FrameError as error:
            raise FrameError(f"{files.annotation}: {error}") from error
        return Frame(
            rgb=rgb,
            depth_m=read_depth_m(files.depth, annotation.metres_per_unit, packed=self._packed_depth),
            intrinsics=intrinsics,
            stamp_ns=round(image_id * 1e9 / NOMINAL_RATE_HZ),
            masks={object_id: labels == value for object_id, value in annotation.labels.items()},
            index=index,
            provenance=Provenance(f"{self.name} image {image_id}", "nominal", 0, annotation.metres_per_unit),
        )

    @property
    def object_ids(self) -> tuple[str, ...]:
        return tuple(sorted({object_id for i in range(len(self)) for object_id in self.annotation(i).poses}))

    def annotation(self, index: int) -> Annotation:
        if index not in self._annotations:
            self._annotations[index] = self._annotate(self.image_ids[index])
        return self._annotations[index]

    def sightings(self, object_id: str) -> Sequence[Sighting]:
        """Every frame in which the object has a pose, also where no pixel of it can be seen.

        How much of its silhouette is hidden the labels don't tell: visible_fraction is 1 where any pixel can be seen.
        """
        require_object(self, object_id)
        return [seen[object_id] for i in range(len(self)) if object_id in (seen := self.seen(i))]

    def seen(self, index: int) -> Mapping[str, Sighting]:
        """By object, those that have a pose in the frame, in the order of their names."""
        if index not in self._seen:
            annotation = self.annotation(index)
            counts = np.bincount(read_labels(self._images[self.image_ids[index]].labels).ravel(), minlength=1)
            self._seen[index] = {}
            for object_id, T_cam_obj in sorted(annotation.poses.items()):
                value = annotation.labels[object_id]
                px = int(counts[value]) if value < len(counts) else 0
                self._seen[index][object_id] = Sighting(index, T_cam_obj, px, 1.0 if px else 0.0)
        return self._seen[index]

    def targets(self, indices: Sequence[int], least_px: int) -> list[Target]:
        """The objects with a pose in these frames of which so many pixels can be seen, by frame, then by name."""
        return [
            Target(index, self.image_ids[index], object_id, s.T_cam_obj, s.visible_px, s.visible_fraction)
            for index in indices
            for object_id, s in self.seen(index).items()
            if s.visible_px >= least_px
        ]
