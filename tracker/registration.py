"""Correspondences, most of them wrong -> a few candidate poses, each with the share of them that supports it."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, log

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field

from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.geometry import Pose
from tracker.hypotheses import Pairs, closeness, fitted, sampled, seeded, support
from tracker.matching import Correspondences
from tracker.threads import one_thread
from tracker.umeyama import Motions, no_motions

FIRST_BATCH = 8192  # samples before the first look at whether more are needed; every further batch is twice as large
REFITS, SETTLED = 15, 1e-4  # at most so many, or until no entry of a rotation changes by more
WIDE, NARROWED = 2.0, 0.25  # thresholds that a refit begins with, and by how many each is less: near optima become one
STARTS = 8  # best hypotheses that are fitted whether or not they are alike


class RegistrationConfig(BaseModel):
    """The paper's RANSAC and what is done to make it quick.

    samples: three-point samples drawn at most (the paper's 100,000). confidence: with which a pose of the best one's
    support has been sampled free of outliers when sampling stops; 1 draws all. threshold_m: distance at which a
    correspondence is an inlier (the paper's 0.01 m). slack: of an edge's length, in thresholds. shortest_edge: a
    triangle's least edge, as a share of the diameter. normal_cosine: how far the cosine between two normals may
    differ. solved: samples that are solved at most. scored_points: correspondences on which those are scored.
    rescored: best of them that are scored on all. seeding_below: support, as a share of the correspondences, under
    which spatial compatibility is tried too; seeding_points, seeds, group: pairs compared, groups grown, their size.
    candidates: distinct poses that are returned at most. distinct_rad, distinct_share: poses nearer than this angle
    and this share of the diameter are one.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    samples: int = Field(default=100_000, ge=1)
    confidence: float = Field(default=0.999, gt=0, le=1)
    threshold_m: float = Field(default=0.01, gt=0)
    slack: float = Field(default=1.5, gt=0)
    shortest_edge: float = Field(default=0.12, ge=0, lt=1)
    normal_cosine: float = Field(default=0.4, gt=0, le=2)
    solved: int = Field(default=4000, ge=1)
    scored_points: int = Field(default=300, ge=10)
    rescored: int = Field(default=64, ge=1)
    seeding_below: float = Field(default=0.05, ge=0, le=1)
    seeding_points: int = Field(default=2000, ge=10)
    seeds: int = Field(default=200, ge=1)
    group: int = Field(default=12, ge=3)
    candidates: int = Field(default=24, ge=1)
    distinct_rad: float = Field(default=0.2, gt=0)
    distinct_share: float = Field(default=0.12, gt=0)


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A pose that some correspondences agree on. inlier_share: of all correspondences, in [0, 1]. support: the same,
    every inlier counted by how near it is and only if its normals agree; by it candidates are ranked."""

    T_cam_obj: Pose
    inlier_share: float
    support: float


def register(
    correspondences: Correspondences,
    cloud: PointCloud,
    model: ConceptModel,
    config: RegistrationConfig,
    generator: torch.Generator,
) -> list[Candidate]:
    """Up to `config.candidates` distinct poses, the best supported first. None where no three points fit together."""
    q, m = correspondences.query_index, correspondences.model_index
    arrays = (cloud.points[q], cloud.normals[q], model.points[m], model.normals[m])
    pairs = Pairs(*(torch.from_numpy(np.ascontiguousarray(a, np.float32)).to(generator.device) for a in arrays))
    return register_pairs(pairs, model.diameter_m, config, generator)


@one_thread()
def register_pairs(
    pairs: Pairs, diameter_m: float, config: RegistrationConfig, generator: torch.Generator
) -> list[Candidate]:
    """`register` for corresponding points themselves, wherever their origin is."""
    if len(pairs) < 3:
        return []
    centre, model_centre = pairs.points.double().mean(dim=0), pairs.model_points.double().mean(dim=0)
    centred = Pairs(
        (pairs.points.double() - centre).float(), pairs.normals,
        (pairs.model_points.double() - model_centre).float(), pairs.model_normals,
    )  # fmt: skip
    motions = _hypotheses(centred, diameter_m, config, generator)
    if len(motions) == 0:
        return []
    best = torch.arange(min(STARTS, len(motions)), device=generator.device)  # near-equals may end at different optima
    motions = motions[torch.cat((best, distinct(motions, diameter_m, 2 * config.candidates, config))).unique()]
    motions, inliers, supports = _refit(centred, motions, config)
    chosen = distinct(motions, diameter_m, config.candidates, config)
    rotation = motions.rotation[chosen].double()
    translation = motions.translation[chosen].double() + centre - rotation @ model_centre
    return [
        Candidate(Pose(R, t), share, support)
        for R, t, share, support in zip(
            rotation.cpu().numpy(),
            translation.cpu().numpy(),
            inliers[chosen].tolist(),
            supports[chosen].tolist(),
            strict=True,
        )
    ]


def _hypotheses(pairs: Pairs, diameter_m: float, config: RegistrationConfig, generator: torch.Generator) -> Motions:
    """Motions, best first."""
    slack_m, shortest_m = config.slack * config.threshold_m, config.shortest_edge * diameter_m
    subset = pairs[torch.randperm(len(pairs), generator=generator, device=generator.device)[: config.scored_points]]
    pool, scores, drawn = no_motions(pairs.points), pairs.points[:0, 0], 0
    batch = FIRST_BATCH if config.confidence < 1 else config.samples
    while drawn < min(config.samples, _needed(_best(scores), len(subset), config)):
        batch = min(batch, config.samples - drawn)
        found = sampled(pairs, batch, slack_m, shortest_m, config.normal_cosine, config.solved, generator)
        pool, drawn, batch = pool.joined(found), drawn + batch, 2 * batch
        scores = torch.cat((scores, support(subset, found, config.threshold_m)))
    if _best(scores) < config.seeding_below * len(subset):
        limits = (config.normal_cosine, config.seeding_points, config.seeds, config.group)
        found = seeded(pairs, slack_m, shortest_m, *limits, generator)
        pool = pool.joined(found)
        scores = torch.cat((scores, support(subset, found, config.threshold_m)))
    order = scores.argsort(descending=True, stable=True)[: int((scores > 0).sum())]
    finalists = order[: config.rescored]
    exact = support(pairs, pool[finalists], config.threshold_m)
    return pool[torch.cat((finalists[exact.argsort(descending=True, stable=True)], order[config.rescored :]))]


def _best(scores: torch.Tensor) -> float:
    return float(scores.amax()) if len(scores) else 0.0


def _needed(best: float, points: int, config: RegistrationConfig) -> float:
    """Samples after which one free of outliers was drawn, with this confidence, if the best score is of a true pose."""
    share = min(best / points, 1 - 1e-9) ** 3
    return log(1 - config.confidence) / log(1 - share) if config.confidence < 1 and share > 1e-12 else float("inf")


def distinct(motions: Motions, diameter_m: float, most: int, config: RegistrationConfig) -> torch.Tensor:
    """Indices of up to `most` motions, in order, no two alike in angle and in where they put the model's centre."""
    turns, places_m = motions.rotation.flatten(1).cpu().numpy(), motions.translation.cpu().numpy()
    near_m, alike = config.distinct_share * diameter_m, 1 + 2 * cos(config.distinct_rad)
    chosen: list[int] = []
    free = np.ones(len(motions), bool)
    while len(chosen) < most and free.any():
        k = int(free.argmax())
        chosen.append(k)
        free &= (turns @ turns[k] <= alike) | (np.square(places_m - places_m[k]).sum(axis=1) >= near_m**2)
        free[k] = False
    return torch.tensor(chosen, dtype=torch.long, device=motions.rotation.device)


def _refit(pairs: Pairs, motions: Motions, config: RegistrationConfig) -> tuple[Motions, torch.Tensor, torch.Tensor]:
    """Every motion fitted to its inliers until they hardly change, those left out that their inliers do not determine,
    the best supported first; the share (B,) of the pairs that are inliers of each, and its support (B,) a pair."""
    threshold_m = config.threshold_m
    for k in range(REFITS):
        reach_m = threshold_m * max(1.0, WIDE - k * NARROWED)
        before, motions = motions, fitted(pairs, closeness(pairs, motions, reach_m).square_())  # Tukey's weights
        if reach_m == threshold_m and float((motions.rotation - before.rotation).abs().amax()) < SETTLED:
            break
    motions = motions[motions.determined]
    inliers = closeness(pairs, motions, threshold_m) > 0
    supports = support(pairs, motions, threshold_m) / len(pairs)
    order = supports.argsort(descending=True, stable=True)
    order = order[((inliers.sum(dim=1) > 2) & (supports > 0))[order]]
    return motions[order], inliers[order].float().mean(dim=1), supports[order]
