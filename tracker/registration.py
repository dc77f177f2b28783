"""Correspondences, most of them wrong -> a few candidate poses, by RANSAC over three-point samples.

All samples are drawn at once; those whose triangles differ in an edge or in the angle of two normals are dropped
before anything is solved; the rest are solved in closed form, scored, told apart, and fitted again to their inliers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field

from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.geometry import Pose
from tracker.matching import Correspondences


class RegistrationConfig(BaseModel):
    """The paper's RANSAC and what is done to make it quick.

    samples: three-point samples drawn (the paper's 100,000). threshold_m: distance at which a correspondence is an
    inlier (the paper's 0.01 m). shortest_edge: a triangle's least edge, as a share of the diameter. normal_cosine:
    how far the cosine between two normals may differ. solved: samples that are solved at most. scored_points:
    correspondences on which those are scored. refitted: best of them that are scored on all. candidates: distinct
    poses that are returned at most. distinct_rad, distinct_share: poses nearer than this angle and this share of the
    diameter are one.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    samples: int = Field(default=100_000, ge=1)
    threshold_m: float = Field(default=0.01, gt=0)
    shortest_edge: float = Field(default=0.12, ge=0, lt=1)
    normal_cosine: float = Field(default=0.4, gt=0, le=2)
    solved: int = Field(default=4000, ge=1)
    scored_points: int = Field(default=300, ge=10)
    refitted: int = Field(default=300, ge=1)
    candidates: int = Field(default=12, ge=1)
    distinct_rad: float = Field(default=0.2, gt=0)
    distinct_share: float = Field(default=0.12, gt=0)


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A pose that some correspondences agree on. inlier_share: of all correspondences, in [0, 1]."""

    T_cam_obj: Pose
    inlier_share: float


def umeyama(source: torch.Tensor, target: torch.Tensor, weights: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Rotations (B, 3, 3) and translations (B, 3) of least weighted squared error, target = R source + t.

    source, target: (B, N, 3); weights: (B, N) not negative. Without scale. Umeyama, TPAMI 1991, Eqs. 40-43.
    """
    share = (weights / weights.sum(dim=1, keepdim=True).clamp_min(1e-12)).unsqueeze(2)
    centre_s, centre_t = (share * source).sum(dim=1, keepdim=True), (share * target).sum(dim=1, keepdim=True)
    covariance = (share * (target - centre_t)).transpose(1, 2) @ (source - centre_s)
    u, _, vt = torch.linalg.svd(covariance)
    sign = torch.ones_like(u[:, 0])
    sign[:, 2] = torch.det(u @ vt)
    rotation = (u * sign.unsqueeze(1)) @ vt
    return rotation, (centre_t - centre_s @ rotation.transpose(1, 2)).squeeze(1)


def register(
    correspondences: Correspondences,
    cloud: PointCloud,
    model: ConceptModel,
    config: RegistrationConfig,
    generator: torch.Generator,
) -> list[Candidate]:
    """Up to `config.candidates` distinct poses, the best supported first. None where no three points fit together."""
    if len(correspondences) < 3:
        return []
    device = generator.device
    q, m = correspondences.query_index, correspondences.model_index
    arrays = (cloud.points[q], cloud.normals[q], model.points[m], model.normals[m])
    pairs = _Pairs(*(torch.from_numpy(np.ascontiguousarray(a, np.float32)).to(device) for a in arrays))
    triples = _congruent_triples(pairs, config, model.diameter_m, generator)
    if len(triples) == 0:
        return []
    ones = torch.ones(triples.shape, device=device)
    rotation, translation = umeyama(pairs.model_points[triples], pairs.points[triples], ones)
    subset = torch.randperm(len(correspondences), generator=generator, device=device)[: config.scored_points]
    best = pairs.support(rotation, translation, subset, config.threshold_m).topk(min(config.refitted, len(triples)))
    rotation, translation = rotation[best.indices], translation[best.indices]
    distinct = _distinct(rotation, translation, model, config)
    return _refit(pairs, rotation[distinct], translation[distinct], config)


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Corresponding points and normals, (M, 3) each: of the cloud (camera) and of the model (object)."""

    points: torch.Tensor
    normals: torch.Tensor
    model_points: torch.Tensor
    model_normals: torch.Tensor

    def support(
        self, rotation: torch.Tensor, translation: torch.Tensor, subset: torch.Tensor, threshold_m: float
    ) -> torch.Tensor:
        """(B,) how well each pose explains a subset of the pairs: truncated squared distances, normals agreeing."""
        moved = self.model_points[subset] @ rotation.transpose(1, 2) + translation.unsqueeze(1)
        squared = ((moved - self.points[subset]) ** 2).sum(dim=2)
        turned = self.model_normals[subset] @ rotation.transpose(1, 2)
        same_side = (turned * self.normals[subset]).sum(dim=2) > 0.5
        return ((1 - squared / threshold_m**2).clamp_min(0) * same_side).sum(dim=1)


def _congruent_triples(
    pairs: _Pairs, config: RegistrationConfig, diameter_m: float, generator: torch.Generator
) -> torch.Tensor:
    """(B, 3) samples whose triangles in the cloud and in the model are congruent up to noise."""
    count = len(pairs.points)
    triples = torch.randint(count, (config.samples, 3), generator=generator, device=generator.device)
    slack_m, shortest_m = 1.5 * config.threshold_m, config.shortest_edge * diameter_m
    for i, j in ((0, 1), (1, 2), (2, 0)):  # edge by edge: the second test sees only what passes the first
        a, b = triples[:, i], triples[:, j]
        edge = (pairs.points[a] - pairs.points[b]).norm(dim=1)
        model_edge = (pairs.model_points[a] - pairs.model_points[b]).norm(dim=1)
        bend = (pairs.normals[a] * pairs.normals[b]).sum(dim=1)
        model_bend = (pairs.model_normals[a] * pairs.model_normals[b]).sum(dim=1)
        fits = ((edge - model_edge).abs() < slack_m) & (edge > shortest_m)
        triples = triples[fits & ((bend - model_bend).abs() < config.normal_cosine)]
    return triples[: config.solved]


def _distinct(
    rotation: torch.Tensor, translation: torch.Tensor, model: ConceptModel, config: RegistrationConfig
) -> list[int]:
    """Indices of poses, best first, of which no two are alike in angle and in where they put the model's centre."""
    centre = torch.from_numpy(model.points.mean(axis=0)).to(rotation)
    places = rotation @ centre + translation
    trace = torch.einsum("aij,bij->ab", rotation, rotation)
    alike = trace > 1 + 2 * np.cos(config.distinct_rad)
    alike &= torch.cdist(places, places) < config.distinct_share * model.diameter_m
    chosen: list[int] = []
    for k, row in enumerate(alike.cpu().numpy()):
        if not row[chosen].any():
            chosen.append(k)
        if len(chosen) == config.candidates:
            break
    return chosen


def _refit(
    pairs: _Pairs, rotation: torch.Tensor, translation: torch.Tensor, config: RegistrationConfig
) -> list[Candidate]:
    """Fit every pose to its inliers until they hardly change, and count them."""
    inliers = torch.zeros((len(rotation), len(pairs.points)), device=rotation.device)
    for _ in range(3):
        moved = pairs.model_points @ rotation.transpose(1, 2) + translation.unsqueeze(1)
        inliers = ((moved - pairs.points).norm(dim=2) < config.threshold_m).float()
        enough = inliers.sum(dim=1) >= 3
        fitted_rotation, fitted_translation = umeyama(
            pairs.model_points.expand(len(rotation), -1, -1), pairs.points.expand(len(rotation), -1, -1), inliers
        )
        rotation = torch.where(enough[:, None, None], fitted_rotation, rotation)
        translation = torch.where(enough[:, None], fitted_translation, translation)
    share = inliers.mean(dim=1).cpu().numpy()
    poses = [
        Pose(r, t) for r, t in zip(rotation.double().cpu().numpy(), translation.double().cpu().numpy(), strict=True)
    ]
    found = [Candidate(pose, float(s)) for pose, s in zip(poses, share, strict=True)]
    return sorted(found, key=lambda c: -c.inlier_share)
