"""Candidate poses from single points: a point of the cloud touches one of the model that says about the same.

Registration needs three correspondences that are right. Where hardly any is, as little of the object shows, one that is
not quite wrong may still be had: it fixes all but the turn about its normal (Drost et al., Model globally, match
locally, CVPR 2010), and the picture tells which of all those poses explain it.
"""

from __future__ import annotations

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field
from scipy.spatial.transform import Rotation

from tracker.appearance import ViewAppearance
from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.geometry import Floats, Pose
from tracker.glance import Glance
from tracker.matching import Matcher
from tracker.registration import RegistrationConfig, distinct
from tracker.threads import one_thread
from tracker.umeyama import Motions, rigid
from tracker.verification import evenly
from tracker.view import ObjectView

FEW_POINTS, MORE_POINTS = 48, 128  # by which all poses are looked at first, and those that are looked at twice


class ContactConfig(BaseModel):
    """points: of the cloud, spread evenly, that are taken to touch the model, 0 for none. places: of the model, spread
    evenly, at which they may; likely: of them, those that each point is most like. turns: about the normal, a round.
    kept: poses that are looked at twice."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    points: int = Field(default=16, ge=0)
    places: int = Field(default=200, ge=1)
    likely: int = Field(default=40, ge=1)
    turns: int = Field(default=18, ge=1)
    kept: int = Field(default=2000, ge=1)


class Contacts:
    """For one model."""

    def __init__(
        self, model: ConceptModel, config: ContactConfig, alike: RegistrationConfig, match: Matcher, glance: Glance
    ) -> None:
        self._config, self._alike, self._match, self._glance = config, alike, match, glance
        self._diameter_m = model.diameter_m
        self._places = evenly(model.points, config.places)
        self._points, normals = model.points[self._places] - glance.centre_m, model.normals[self._places]
        self._frames = _frames(normals)

    @one_thread()
    def __call__(self, cloud: PointCloud, view: ObjectView, appearance: ViewAppearance, *, masked: bool) -> list[Pose]:
        """Distinct poses, those that explain most first; as many as registration may have candidates."""
        if self._config.points == 0:
            return []
        motions = self._touching(cloud)
        rough = self._glance(motions, view, appearance, masked=masked, points=FEW_POINTS)
        motions = motions[rough.topk(min(self._config.kept, len(motions))).indices]
        scores = self._glance(motions, view, appearance, masked=masked, points=MORE_POINTS)
        motions = motions[scores.argsort(descending=True, stable=True)]
        motions = motions[distinct(motions, self._diameter_m, self._alike.candidates, self._alike)]
        rotations, places_m = (part.double().cpu().numpy() for part in (motions.rotation, motions.translation))
        return [Pose(R, t - R @ self._glance.centre_m) for R, t in zip(rotations, places_m, strict=True)]

    def _touching(self, cloud: PointCloud) -> Motions:
        """All of them."""
        config, chosen = self._config, evenly(cloud.points, self._config.points)
        likeness = self._match.likeness(cloud.saliency[chosen])[:, self._places]
        places = likeness.topk(min(config.likely, len(self._places)), dim=1).indices  # (K, P)
        device = likeness.device
        frames, points = (_tensor(array, device) for array in (self._frames, self._points))
        seen_frames, seen = _tensor(_frames(cloud.normals[chosen]), device), _tensor(cloud.points[chosen], device)
        turned = seen_frames[:, None] @ _tensor(_turns(config.turns), device)  # (K, T, 3, 3)
        rotation = turned[:, None] @ frames[places].transpose(2, 3)[:, :, None]  # (K, P, T, 3, 3)
        translation = seen[:, None, None] - (rotation @ points[places][:, :, None, :, None]).squeeze(4)
        return rigid(rotation.reshape(-1, 3, 3), translation.reshape(-1, 3))


def _frames(normals: Floats) -> Floats:
    """(N, 3, 3) rotations whose third axes are these (N, 3), wherever the others point."""
    beside = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(beside, normals)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack((first, np.cross(normals, first), normals), axis=2)


def _turns(count: int) -> Floats:
    """(T, 3, 3) rotations about the third axis, a round of them."""
    return Rotation.from_euler("z", 2 * np.pi * np.arange(count)[:, None] / count).as_matrix()


def _tensor(array: Floats, device: torch.device) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(array, np.float32)).to(device)
