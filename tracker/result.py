"""What a frame tells about an object."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from tracker.concept import ConceptModel
from tracker.confidence import Grounds
from tracker.frame import Mask
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.pose_filter import FilterStep
from tracker.projection import nearest_pixels, project
from tracker.region import Region, SeenRegion
from tracker.saliency import Saliency
from tracker.verification import Evidence
from tracker.view import Float32s

SAME_SURFACE = 0.05  # of the diameter: a point whose pixel is measured this near is the one that is seen


class TrackState(Enum):
    """INITIALISING: not seen yet. TRACKING: the pose is known. LOST: it was, and is not."""

    INITIALISING = "initialising"
    TRACKING = "tracking"
    LOST = "lost"


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """What a frame measured of an object: its own pixels' depth (h, w), metres, 0 elsewhere, and their camera.
    saliency: the concepts there, None where they were not asked."""

    model: ConceptModel
    depth_m: Float32s
    camera: Intrinsics
    saliency: Saliency | None = None

    def share_seen(self, points_cam: Floats, weights: Floats) -> float:
        """Share of points (N, 3), by weight (N,), that lie on the measured surface."""
        at = project(points_cam, np.zeros_like(points_cam), Pose.identity(), self.camera)
        rows, columns = nearest_pixels(at, self.camera)
        off_m = np.abs(self.depth_m[rows, columns] - points_cam[:, 2])
        on = at.within(self.camera, 0) & (self.depth_m[rows, columns] > 0)
        return float(weights[on & (off_m < SAME_SURFACE * self.model.diameter_m)].sum() / weights.sum())


@dataclass(frozen=True, slots=True, eq=False)
class TrackResult:
    """stamp_ns, object_id: of which frame and object. pose: T_cam_obj after the filter, None unless TRACKING.
    state: see TrackState. confidence: in [0, 1], how likely the pose is right, see `tracker.confidence`; 0 without one.
    covariance: (6, 6) of `pose`, of (turn, radians; shift, metres) in camera axes about the object's origin. reason:
    why there is no pose, or how it came about. raw_pose: T_cam_obj of this frame alone, before the filter. grounds:
    what the confidence was judged by. timings_ms: stage -> milliseconds. surface: what was seen of the object, None
    without a pose. mask: (H, W) bool, the pixels by which it was judged, those that were given or, where masks are
    carried, that the tracker takes for the object's; None without a pose. step: what the filter knew, for
    `tracker.smoothing`."""

    stamp_ns: int
    object_id: str
    pose: Pose | None
    state: TrackState
    confidence: float
    covariance: Floats | None
    reason: str
    raw_pose: Pose | None
    grounds: Grounds | None
    timings_ms: dict[str, float]
    surface: Surface | None = None
    mask: Mask | None = None
    step: FilterStep | None = None

    @property
    def evidence(self) -> Evidence | None:
        """What the picture says of the pose, None without one."""
        return None if self.grounds is None else self.grounds.evidence

    def slim(self) -> TrackResult:
        """Without pictures, to be kept."""
        return replace(self, surface=None, mask=None)

    def locate(self, concept: str | Region) -> SeenRegion | None:
        """Where a concept of the object is in this frame. None without a pose, or where the object does not have it.

        concept: a label, or what `ConceptModel.locate` said of one, which spares asking the model in every frame.
        Raises as `ConceptModel.locate` does.
        """
        if self.pose is None or self.surface is None:
            return None
        region = self.surface.model.locate(concept) if isinstance(concept, str) else concept
        if region is None:
            return None
        in_cam = region.moved(self.pose)
        return SeenRegion(region, in_cam, self.surface.share_seen(in_cam.points, region.weights))
