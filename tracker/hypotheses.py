"""Correspondences, most of them wrong -> many poses, among them good ones, each scored by the correspondences.

By sampling (RANSAC): three-point samples are drawn all at once, and those whose triangles differ in an edge or in the
angle of two normals are dropped before anything is solved. By spatial compatibility, where next to nothing is right:
two right correspondences keep their distance, and so do both with many others (SC2-PCR, Chen et al., CVPR 2022).
"""

from __future__ import annotations

from functools import cached_property
from math import ceil, sqrt

import torch

from tracker.umeyama import Motions, triangles, umeyama, umeyama_of_moments

LEAST_HEIGHT = 0.1  # of a triangle over its edge; flatter ones hardly fix the turn about it
SAME_SIDE = 0.5  # least cosine between the normals of two points that are the same


class Pairs:
    """M corresponding points, (M, 3) each: `points` of the cloud, `model_points` of the model, both about their means,
    so that single precision suffices; and their normals, of length 0 where there are none."""

    def __init__(
        self, points: torch.Tensor, normals: torch.Tensor, model_points: torch.Tensor, model_normals: torch.Tensor
    ) -> None:
        self.points, self.normals = points, normals
        self.model_points, self.model_normals = model_points, model_normals

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, chosen: torch.Tensor) -> Pairs:
        """Those at the indices (K,)."""
        parts = (self.points, self.normals, self.model_points, self.model_normals)
        return Pairs(*(part.index_select(0, chosen) for part in parts))

    @cached_property
    def terms(self) -> torch.Tensor:
        """(M, 17) all products of a pair's coordinates that a squared distance or a least-squares motion consists of:
        |p|^2 + |m|^2, 1, p, m, and p m^T row by row."""
        p, m = self.points, self.model_points
        own = (p * p).sum(dim=1, keepdim=True) + (m * m).sum(dim=1, keepdim=True)
        return torch.cat((own, torch.ones_like(own), p, m, _outer(p, m)), dim=1)

    @cached_property
    def normal_terms(self) -> torch.Tensor | None:
        """(M, 9) the same of the normals, None where there are none."""
        return _outer(self.normals, self.model_normals) if self.normals.any() else None


def squared_distances(pairs: Pairs, motions: Motions) -> torch.Tensor:
    """(B, M) |p - R m - t|^2, multiplied out, so that it is one matrix product."""
    return _factors(motions) @ pairs.terms.T


def closeness(pairs: Pairs, motions: Motions, threshold_m: float) -> torch.Tensor:
    """(B, M) from 1 where a pair meets under a motion to 0 from the threshold on, 1 - d^2 / threshold^2."""
    factors = _factors(motions).mul_(-1 / threshold_m**2)
    factors[:, 1] += 1  # of the term that is 1: scaled and taken from 1 in the product, not in passes over its result
    return (factors @ pairs.terms.T).clamp_(min=0)


def support(pairs: Pairs, motions: Motions, threshold_m: float) -> torch.Tensor:
    """(B,) how well each motion explains the pairs: their squared distances, truncated (MSAC, Torr and Zisserman, CVIU
    2000), of those whose normals agree, if they have normals."""
    kept = closeness(pairs, motions, threshold_m)
    if pairs.normal_terms is not None:
        kept.mul_(motions.rotation.flatten(1) @ pairs.normal_terms.T > SAME_SIDE)
    return kept.sum(dim=1)


def fitted(pairs: Pairs, weights: torch.Tensor) -> Motions:
    """Motions of least squared error under weights (B, M)."""
    sums = weights @ pairs.terms[:, 1:]
    centre, model_centre, second = (sums[:, 1:] / sums[:, :1].clamp_min(1e-12)).split((3, 3, 9), dim=1)
    return umeyama_of_moments(model_centre, centre, second.reshape(-1, 3, 3))


def sampled(
    pairs: Pairs,
    count: int,
    slack_m: float,
    shortest_m: float,
    normal_cosine: float,
    most: int,
    generator: torch.Generator,
) -> Motions:
    """Motions of up to `most` of random triples, those that are congruent to within slack_m; of `count` triples at
    least are the edges compared, fewer only where there are not so many.

    The pairs are shuffled once; a triple is a pair and those two of a few random steps further on. So an edge serves
    every triple of its pair that takes its step, and whole rows are compared with whole rows: looking up the corners
    of each triple would cost more than all arithmetic.
    """
    rounds = ceil(count / len(pairs))
    few = min(ceil((1 + sqrt(1 + 8 * rounds)) / 2), len(pairs) - 1)  # steps of which there are so many twos
    order = torch.randperm(len(pairs), generator=generator, device=generator.device)
    steps = 1 + torch.randperm(len(pairs) - 1, generator=generator, device=generator.device)[:few]
    pairs = pairs[torch.cat((order, order))]  # twice, so that a step may go beyond the end
    one, other = torch.triu_indices(few, few, 1, device=steps.device)[:, :rounds]
    fits = _congruent_after(steps, pairs, slack_m, shortest_m)
    which, first = (fits[one] & fits[other]).nonzero().unbind(dim=1)
    triples = torch.stack((first, first + steps[one[which]], first + steps[other[which]]))
    together = _padded(pairs.points, pairs.model_points)
    third = together[triples[1]].sub_(together[triples[2]]).square_().reshape(-1, 2, 4).sum(dim=2).sqrt_()
    triples = triples[:, _congruent(third[:, 0], third[:, 1], slack_m, shortest_m)]
    if pairs.normal_terms is not None:
        tilts = _padded(pairs.normals, pairs.model_normals)
        for i, j in ((0, 1), (0, 2), (1, 2)):  # each test sees only what passes those before
            bends = (tilts[triples[i]] * tilts[triples[j]]).reshape(-1, 2, 4).sum(dim=2)
            triples = triples[:, (bends[:, 0] - bends[:, 1]).abs() < normal_cosine]
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


def _factors(motions: Motions) -> torch.Tensor:
    """(B, 17) what `Pairs.terms` are multiplied with in a squared distance."""
    t, R = motions.translation, motions.rotation
    back = (R.transpose(1, 2) @ t.unsqueeze(2)).squeeze(2)
    one, far = torch.ones_like(t[:, :1]), (t * t).sum(dim=1, keepdim=True)
    return torch.cat((one, far, -2 * t, 2 * back, -2 * R.flatten(1)), dim=1)


def _outer(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """(M, 9) products of the coordinates of (M, 3) and (M, 3), in the order of a flattened rotation."""
    return (a.unsqueeze(2) * b.unsqueeze(1)).flatten(1)


def _padded(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """(M, 8): both of a pair side by side, so that one look-up brings them, and aligned, so that it is quick."""
    return torch.nn.functional.pad(torch.stack((a, b), dim=1), (0, 1)).flatten(1).contiguous()


def _congruent_after(steps: torch.Tensor, pairs: Pairs, slack_m: float, shortest_m: float) -> torch.Tensor:
    """(S, M/2) bool, whether a pair of the first half and the one that many steps further on are as far apart in the
    cloud as in the model."""
    half = len(pairs) // 2
    twice = torch.cat((pairs.points, pairs.model_points), dim=1).T.contiguous()
    later = torch.stack([twice[:, step : step + half] for step in steps.tolist()], dim=1)
    apart = later.sub_(twice[:, :half].unsqueeze(1)).square_()
    edge, model_edge = ((part[0] + part[1]).add_(part[2]).sqrt_() for part in (apart[:3], apart[3:]))
    return _congruent(edge, model_edge, slack_m, shortest_m)


def _congruent(edge: torch.Tensor, model_edge: torch.Tensor, slack_m: float, shortest_m: float) -> torch.Tensor:
    """Which lengths in the cloud and in the model are alike, and no needle's."""
    return ((edge - model_edge).abs_() < slack_m) & (edge > shortest_m)


def _spread(corners: torch.Tensor) -> torch.Tensor:
    """(B,) bool, triangles (B, 3, 3) that are no needles."""
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    longest = torch.maximum((edge * edge).sum(dim=1), (other * other).sum(dim=1))
    return torch.linalg.cross(edge, other).norm(dim=1) > LEAST_HEIGHT * longest
