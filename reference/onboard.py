"""Reference frames -> a concept model. The method on one page."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np

from reference.cross_check import cross_check, others_than
from reference.fusion import DEPTH_SLACK, diameter_of, fuse
from reference.keyframes import choose_reference_frames
from reference.quality import judge
from reference.symmetry_detection import detect_symmetry
from reference.viewsphere import view_direction
from tracker.cloud import LEAST_POINTS, CloudConfig, inliers, lift
from tracker.concept import ConceptModel
from tracker.errors import OnboardingError
from tracker.frame import PosedFrame
from tracker.geometry import Floats
from tracker.saliency import Query, SaliencyBackend
from tracker.sources import FrameSource, PosedSource, Sighting, require_posed
from tracker.symmetry import Symmetry
from tracker.view import ViewConfig, bounding_box, view_object

logger = logging.getLogger(__name__)


def read_reference_frames(source: FrameSource, object_id: str, views: int) -> list[PosedFrame]:
    """The frames of a recording that `choose_reference_frames` picks for an object, read and with their masks.

    Raises SourceError where the source has no poses, or none of this object.
    """
    posed = require_posed(source)
    return [_posed(posed, object_id, s) for s in choose_reference_frames(posed.sightings(object_id), views)]


def onboard(
    frames: Sequence[PosedFrame],
    backend: SaliencyBackend,
    view_config: ViewConfig | None = None,
    cloud_config: CloudConfig | None = None,
    vocabulary: Sequence[str] | None = None,
    symmetry: Symmetry | None = None,
) -> ConceptModel:
    """One concept model from frames with known poses and masks of one object. Its frame is that of the poses.

    vocabulary: the concepts that it is to hold, None for the backend's own choice. symmetry: of the object, in
    the coordinates of the poses, None to detect it.

    Raises OnboardingError where a frame has no usable points or the frames together do not make a model.
    """
    model = joined_model(frames, backend, view_config, cloud_config, vocabulary, symmetry)
    warn_of_problems(model)
    return model


def joined_model(
    frames: Sequence[PosedFrame],
    backend: SaliencyBackend,
    view_config: ViewConfig | None = None,
    cloud_config: CloudConfig | None = None,
    vocabulary: Sequence[str] | None = None,
    symmetry: Symmetry | None = None,
) -> ConceptModel:
    """As `onboard`, but says nothing of what the model is missing: that is in its notes."""
    view_config, cloud_config = view_config or ViewConfig(), cloud_config or CloudConfig()
    if not frames:
        raise OnboardingError("onboarding needs at least one reference frame")

    # How big is it? The surfaces alone, at a resolution guessed from the mask.
    surfaces = [surface_of(frame, view_config, cloud_config) for frame in frames]
    diameter_m = _diameter(surfaces, frames)

    # What is where? The concepts, at scales relative to that size.
    views = [view_object(f.frame, f.mask, diameter_m, view_config) for f in frames]
    seen = [view for view in views if view is not None]
    labels = backend.labels_for(vocabulary)
    saliency = backend([Query(view, labels) for view in seen])
    clouds = [lift(view, maps, cloud_config) for view, maps in zip(seen, saliency, strict=True)]

    # One model of all views.
    fused = fuse(clouds, frames, diameter_m, voxel_m=diameter_m / view_config.pixels_across)
    model = ConceptModel(
        object_id=frames[0].object_id,
        diameter_m=diameter_m,
        view_directions=np.stack([view_direction(frame.T_cam_obj) for frame in frames]),
        labels=labels,
        backend=backend.name,
        fingerprint=backend.fingerprint,
        notes={"reference_frames": [f"frame {f.frame.index} of {f.frame.provenance.source}" for f in frames]},
        references=tuple(frames),
        **{name: getattr(fused, name) for name in fused.__slots__},
    )
    quality = judge(model)
    if not quality.usable:
        raise OnboardingError(f"no usable model of object {model.object_id!r}: {'; '.join(quality.problems)}")
    verdict = {**asdict(quality), "problems": list(quality.problems)}
    symmetry = detect_symmetry(model) if symmetry is None else symmetry
    return replace(model, notes={**model.notes, "quality": verdict}, symmetry=symmetry)


def warn_of_problems(model: ConceptModel) -> None:
    for problem in model.notes["quality"]["problems"]:
        logger.warning("model of object %r: %s", model.object_id, problem)


def surface_of(frame: PosedFrame, view_config: ViewConfig, cloud_config: CloudConfig) -> Floats:
    """Points (N, 3) of the masked surface in object coordinates, without outliers. Raises OnboardingError where there
    are too few."""
    where = f"reference frame {frame.frame.provenance.source}, object {frame.object_id!r}"
    box = bounding_box(frame.mask)
    if box is None:
        raise OnboardingError(f"{where}: the mask is empty")
    depth_m = frame.frame.depth_m[frame.mask & (frame.frame.depth_m > 0)]
    if len(depth_m) < LEAST_POINTS:
        raise OnboardingError(f"{where}: {len(depth_m)} masked pixels have depth, {LEAST_POINTS} are needed")
    width_px = float(np.hypot(box.x1 - box.x0, box.y1 - box.y0))
    guess_m = width_px * float(np.median(depth_m)) / frame.frame.intrinsics.fx
    view = view_object(frame.frame, frame.mask, guess_m, view_config)
    points = np.zeros((0, 3)) if view is None else view.points()
    kept = points[inliers(points, cloud_config)]
    if len(kept) < LEAST_POINTS:
        raise OnboardingError(f"{where}: {len(kept)} points without outliers, {LEAST_POINTS} are needed")
    return frame.T_cam_obj.inverse() @ kept


def _posed(source: PosedSource, object_id: str, sighting: Sighting) -> PosedFrame:
    frame = source[sighting.index]
    if object_id not in frame.masks:
        raise OnboardingError(f"{frame.provenance.source} has no mask of object {object_id!r}")
    return PosedFrame(frame, object_id, sighting.T_cam_obj, frame.masks[object_id])


def _diameter(surfaces: Sequence[Floats], frames: Sequence[PosedFrame]) -> float:
    rough_m = diameter_of(np.concatenate(surfaces))
    checked = [
        points[cross_check(points, others_than(frames, k), DEPTH_SLACK * rough_m).kept]
        for k, points in enumerate(surfaces)
    ]
    return diameter_of(np.concatenate(checked))
