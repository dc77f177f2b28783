"""Where in a whole picture an object might be: places whose surface says what the object's does."""

from __future__ import annotations

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field
from scipy.spatial import KDTree

from tracker.cloud import CloudConfig, lift
from tracker.concept import ConceptModel
from tracker.frame import Frame, Mask
from tracker.geometry import Floats
from tracker.matching import Matcher, MatchingConfig
from tracker.pointing import Pointer, clicked_m, measured_in
from tracker.saliency import Saliency
from tracker.view import Box, ObjectView, ViewConfig, view_object

CENTRE_BEHIND = 0.25  # of the diameter: an object's centre lies about this far behind its surface
LIKELY = 0.02  # quantile of the picture's divergences beyond which a point hardly speaks for the object any more
PART = 1 / 6  # of the diameter: the parts of the model that have a vote each
LEAST_POINTS = 20


class ProposalConfig(BaseModel):
    """pixels_across: of the object, in the picture that is searched. points: of it that are compared with the model.
    radius: around a place, as a share of the diameter, within which everything may be the object's. places: that are
    proposed at most."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    pixels_across: int = Field(default=24, ge=8)
    points: int = Field(default=4000, ge=100, le=10_000)
    radius: float = Field(default=0.6, gt=0)
    places: int = Field(default=3, ge=1)


class Proposals:
    """For one model."""

    def __init__(
        self, model: ConceptModel, config: ProposalConfig, matching: MatchingConfig, device: torch.device
    ) -> None:
        self._config, self._diameter_m = config, model.diameter_m
        every = matching.model_copy(update={"query_points": config.points, "per_point": 1, "mutual": False})
        self._match = Matcher(model, every, device)
        parts = np.floor(model.points / (PART * model.diameter_m))
        self._part = np.unique(parts, axis=0, return_inverse=True)[1].ravel()

    def picture(self, frame: Frame, searched: Mask) -> ObjectView | None:
        """The pixels (H, W) that are searched, as coarse as suits that; None where none has depth."""
        view = ViewConfig(pixels_across=self._config.pixels_across, least_pixels=0)
        return view_object(frame, searched, self._diameter_m, view)

    def masks(self, picture: ObjectView, saliency: Saliency, cloud: CloudConfig) -> list[Mask]:
        """(H, W) bool each, the likeliest first: what lies around the places where most of the model is matched well.

        Every part of the model has one vote, shared among all points of the picture that look like it: so what is
        everywhere says little about where the object is.
        """
        points = lift(picture, saliency, cloud)
        if len(points) < LEAST_POINTS:
            return []
        matches = self._match(points)
        part = self._part[matches.model_index]
        likely = np.exp(-matches.divergence / max(np.quantile(matches.divergence, LIKELY), 1e-6))
        votes = likely / np.maximum(np.bincount(part, likely)[part], 1e-12)
        places = points.points[matches.query_index]
        centres = self._behind(places)
        tree = KDTree(places)
        centres = centres[np.linspace(0, len(centres) - 1, min(len(centres), 500)).astype(int)]
        around = tree.query_ball_point(centres, self._diameter_m / 2)
        worth = np.array([votes[near].sum() for near in around])
        return [self.around(centre, picture.frame) for centre in self._apart(centres, worth)]

    def pointed_out(self, there: Pointer, frame: Frame) -> Mask:
        """(H, W) bool, pixels with depth that may be the object's where somebody points; none where nothing has."""
        if isinstance(there, Box):
            return measured_in(there, frame)
        place_m = clicked_m(there, frame)
        if place_m is None:
            return np.zeros(frame.depth_m.shape, bool)
        return self.around(self._behind(place_m[None])[0], frame)

    def around(self, centre: Floats, frame: Frame, more: float = 0.0) -> Mask:
        """(H, W) bool, pixels whose points lie within the radius of a place (3,), metres, camera coordinates. more: so
        many diameters farther."""
        camera, radius_m = frame.intrinsics, (self._config.radius + more) * self._diameter_m
        reach_px = radius_m * camera.fx / max(centre[2] - radius_m, 0.1)
        column, row = centre[0] / centre[2] * camera.fx + camera.cx, centre[1] / centre[2] * camera.fy + camera.cy
        x0, x1 = (int(np.clip(x, 0, camera.width)) for x in (column - reach_px, column + reach_px + 1))
        y0, y1 = (int(np.clip(y, 0, camera.height)) for y in (row - reach_px, row + reach_px + 1))
        rows, columns = np.mgrid[y0:y1, x0:x1]
        depth_m = frame.depth_m[y0:y1, x0:x1]
        points = camera.unproject(columns.ravel(), rows.ravel(), depth_m.ravel().astype(np.float64))
        near = np.linalg.norm(points - centre, axis=1).reshape(depth_m.shape) < radius_m
        mask = np.zeros(frame.depth_m.shape, bool)
        mask[y0:y1, x0:x1] = near & (depth_m > 0)
        return mask

    def _behind(self, surface: Floats) -> Floats:
        """(N, 3) about where the centre of an object is whose surface is seen at these points."""
        return surface * (1 + CENTRE_BEHIND * self._diameter_m / np.linalg.norm(surface, axis=1, keepdims=True))

    def _apart(self, centres: Floats, worth: Floats) -> list[Floats]:
        """The worthiest places, none within half a diameter of a worthier one."""
        chosen: list[Floats] = []
        for k in np.argsort(-worth, kind="stable"):
            if all(np.linalg.norm(centres[k] - other) > self._diameter_m / 2 for other in chosen):
                chosen.append(centres[k])
            if len(chosen) == self._config.places:
                break
        return chosen
