"""Correspondences, most of them wrong -> many poses, among them good ones, each scored by the correspondences.

By sampling (RANSAC): three-point samples are drawn all at once, and those whose triangles differ in an edge or in the
angle of two normals are dropped before anything is solved. By spatial compatibility, where next to nothing is right:
two right correspondences keep their distance, and so do both with many others (SC2-PCR, Chen et al., CVPR 2022).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tracker.umeyama import Motions, triangles, umeyama

LEAST_HEIGHT = 0.1  # of a triangle over its edge; flatter ones hardly fix the turn about it
SAME_SIDE = 0.5  # least cosine between the normals of two points that are the same


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """M corresponding points, (M, 3) each: `points` of the cloud, `model_points` of the model, both about their means,
    so that single precision suffices; and their normals, of length 0 where there are none."""

    points: torch.Tensor
    normals: torch.Tensor
    model_points: torch.Tensor
    model_normals: torch.Tensor

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, chosen: torch.Tensor) -> Pairs:
        parts = (self.points, self.normals, self.model_points, self.model_normals)
        return Pairs(*(part[chosen] for part in parts))


def squared_distances(pairs: Pairs, motions: Motions) -> torch.Tensor:
    """(B, M) |p - R m - t|^2, multiplied out, so that it is one matrix product."""
    p, m = pairs.points, pairs.model_points
    own = (p * p).sum(dim=1) + (m * m).sum(dim=1)
    of_pair = torch.cat((own[:, None], torch.ones_like(own)[:, None], p, m, _outer(p, m)), dim=1)
    t, R = motions.translation, motions.rotation
    back = (R.transpose(1, 2) @ t.unsqueeze(2)).squeeze(2)
    one, far = torch.ones_like(t[:, :1]), (t * t).sum(dim=1, keepdim=True)
    of_motion = torch.cat((one, far, -2 * t, 2 * back, -2 * R.flatten(1)), dim=1)
    return of_motion @ of_pair.T


def support(pairs: Pairs, motions: Motions, threshold_m: float) -> torch.Tensor:
    """(B,) how well each motion explains the pairs: their squared distances, truncated (MSAC, Torr and Zisserman, CVIU
    2000), of those whose normals agree, if they have normals."""
    kept = squared_distances(pairs, motions).mul_(-1 / threshold_m**2).add_(1).clamp_(min=0)
    if pairs.normals.any():
        agreement = motions.rotation.flatten(1) @ _outer(pairs.normals, pairs.model_normals).T
        kept.mul_(agreement > SAME_SIDE)
    return kept.sum(dim=1)


def sampled(
    pairs: Pairs,
    count: int,
    slack_m: float,
    shortest_m: float,
    normal_cosine: float,
    most: int,
    generator: torch.Generator,
) -> Motions:
    """Motions of up to `most` of `count` random triples, those that are congruent to within slack_m."""
    triples = torch.randint(len(pairs), (3, count), generator=generator, device=generator.device)
    together = _padded(pairs.points, pairs.model_points)
    tilts = _padded(pairs.normals, pairs.model_normals) if pairs.normals.any() else None
    for i, j in ((0, 1), (1, 2), (2, 0)):  # edge by edge: the second test sees only what passes the first
        edges = _differences(together, triples[i], triples[j])
        fits = ((edges[:, 0] - edges[:, 1]).abs() < slack_m) & (edges[:, 0] > shortest_m)
        triples = triples[:, fits.nonzero()[:, 0]]
        if tilts is not None:
            bends = (tilts[triples[i]] * tilts[triples[j]]).reshape(-1, 2, 4).sum(dim=2)
            triples = triples[:, ((bends[:, 0] - bends[:, 1]).abs() < normal_cosine).nonzero()[:, 0]]
    triples = triples[:, :most].T
    source, target = pairs.model_points[triples], pairs.points[triples]
    spread = _spread(source)
    return triangles(source[spread], target[spread])


def seeded(
    pairs: Pairs,
    slack_m: float,
    shortest_m: float,
    normal_cosine: float,
    most: int,
    seeds: int,
    group: int,
    generator: torch.Generator,
) -> Motions:
    """Motions of up to `seeds` groups of `group` pairs that keep their distances to one another, found among `most`
    pairs by second-order compatibility: how many others two compatible pairs are both compatible with."""
    chosen = pairs[torch.randperm(len(pairs), generator=generator, device=generator.device)[:most]]
    edges = torch.cdist(chosen.points, chosen.points)
    compatible = (edges - torch.cdist(chosen.model_points, chosen.model_points)).abs_() < slack_m
    bends = chosen.normals @ chosen.normals.T - chosen.model_normals @ chosen.model_normals.T
    compatible = (compatible & (edges > shortest_m) & (bends.abs_() < normal_cosine)).float()
    seed = compatible.sum(dim=1).topk(min(seeds, len(chosen))).indices
    common = (compatible[seed] @ compatible) * compatible[seed]
    best = common.topk(min(group, len(chosen)), dim=1)
    members = torch.cat((seed.unsqueeze(1), best.indices), dim=1)
    weights = torch.cat((best.values[:, :1], best.values), dim=1)
    motions = umeyama(chosen.model_points[members], chosen.points[members], weights)
    return motions[motions.determined & (best.values[:, min(2, best.values.shape[1] - 1)] > 0)]


def _outer(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """(M, 9) products of the coordinates of (M, 3) and (M, 3), in the order of a flattened rotation."""
    return (a.unsqueeze(2) * b.unsqueeze(1)).flatten(1)


def _padded(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """(M, 8): both of a pair side by side, so that one look-up brings them, and aligned, so that it is quick."""
    return torch.nn.functional.pad(torch.stack((a, b), dim=1), (0, 1)).flatten(1).contiguous()


def _differences(together: torch.Tensor, i: torch.Tensor, j: torch.Tensor) -> torch.Tensor:
    """(K, 2) lengths of the edges from pairs i to pairs j, in the cloud and in the model."""
    apart = together.index_select(0, i).sub_(together.index_select(0, j)).square_()
    return apart.reshape(-1, 2, 4).sum(dim=2).sqrt_()


def _spread(corners: torch.Tensor) -> torch.Tensor:
    """(B,) bool, triangles (B, 3, 3) that are no needles."""
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    longest = torch.maximum((edge * edge).sum(dim=1), (other * other).sum(dim=1))
    return torch.linalg.cross(edge, other).norm(dim=1) > LEAST_HEIGHT * longest
