"""A cloud and a concept model -> which point of the cloud is which point of the object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from pydantic import BaseModel, ConfigDict, Field

from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.measures import Encoded, Measure, encode_model, encode_query
from tracker.view import Float32s

FAR = 0.1  # of the diameter: model points farther apart than this are different places
DISTINCT_POINTS = 2000  # of the model, among which a place's look-alikes are sought


class MatchingConfig(BaseModel):
    """measure: of how unlike two concept vectors are. temperature: tau of the softmax that makes saliency a
    distribution over concepts. binary: a point has a concept or has it not (`binary_maps`), to compare with masks.
    query_points: at most so many points of the cloud are matched, spread evenly over it (the paper's cap).
    per_point: how many points of the model each is matched to. mutual: keep only matches that are the best in both
    directions. kept: at most so many matches, those of the greatest margin.
    memory_mb: bound on the block of the similarity matrix that is held at a time: one that a processor's cache holds is
    searched sooner."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    measure: Measure = "forward"
    temperature: float = Field(default=0.3, gt=0)
    binary: bool = False
    query_points: int = Field(default=1500, ge=50, le=10_000)
    per_point: int = Field(default=1, ge=1, le=32)
    mutual: bool = False
    kept: int = Field(default=10_000, ge=3)
    memory_mb: float = Field(default=8.0, ge=1)


@dataclass(frozen=True, slots=True, eq=False)
class Correspondences:
    """query_index, model_index: (M,) points of the cloud and of the model that say the same.
    divergence: (M,) float32 of their concept vectors, in nats (one minus the cosine, where that is the measure).
    margin: (M,) float32, by how much less they diverge than the model's point does from its nearest look-alike
    elsewhere on the object: below zero where the match might as well be there."""

    query_index: npt.NDArray[np.intp]
    model_index: npt.NDArray[np.intp]
    divergence: Float32s
    margin: Float32s

    def __len__(self) -> int:
        return len(self.query_index)

    def __getitem__(self, chosen: npt.NDArray) -> Correspondences:
        return Correspondences(
            self.query_index[chosen], self.model_index[chosen], self.divergence[chosen], self.margin[chosen]
        )


def concept_vectors(saliency: torch.Tensor, temperature: float) -> torch.Tensor:
    """(N, L) saliency -> (N, L) log-probabilities of the concepts: log softmax(s / tau), the paper's Eq. 1."""
    return torch.log_softmax(saliency.float() / temperature, dim=1)


def binary_maps(saliency: torch.Tensor) -> torch.Tensor:
    """(N, L) saliency -> (N, L) of 0 and 1: where a concept is stronger than on average over these points.

    The paper cuts at 0.5, maps that are stretched to [0, 1] on each picture. Ours are not, and a concept that is faint
    or everywhere would be lost at 0.5; the mean is a cut that every concept has points on both sides of.
    """
    return (saliency > saliency.mean(dim=0)).to(saliency.dtype)


class Matcher:
    """For each point of a cloud the model's points of least divergence, the paper's Eq. 3."""

    def __init__(self, model: ConceptModel, config: MatchingConfig, device: torch.device) -> None:
        self._config, self._device = config, device
        log_model = self._vectors(model.saliency)
        self._model = encode_model(log_model, config.measure).T.contiguous()
        self._distinctness = self._look_alikes(model, log_model)

    def __call__(self, cloud: PointCloud, most: int | None = None) -> Correspondences:
        """Of the configured number of the cloud's points, or of `most` where that is less, spread evenly over it."""
        config = self._config
        points = min(len(cloud), config.query_points if most is None else min(most, config.query_points))
        chosen = np.linspace(0, len(cloud) - 1, points).round().astype(np.intp)
        query = encode_query(self._vectors(cloud.saliency[chosen]), config.measure)
        per_point = min(config.per_point, self._model.shape[1])
        likeness, nearest, backward = self._greatest(query, per_point)
        divergence = (query.own.unsqueeze(1) - likeness).clamp_min(0)
        margin = self._distinctness[nearest] - divergence
        found = Correspondences(
            query_index=np.repeat(chosen, per_point),
            model_index=nearest.flatten().cpu().numpy(),
            divergence=divergence.flatten().cpu().numpy(),
            margin=margin.flatten().cpu().numpy(),
        )
        if config.mutual:
            own = torch.arange(len(chosen), device=self._device).unsqueeze(1)
            found = found[(backward[nearest] == own).flatten().cpu().numpy()]
        if len(found) > config.kept:
            found = found[np.sort(np.argsort(-found.margin, kind="stable")[: config.kept])]
        return found

    def likeness(self, saliency: Float32s) -> torch.Tensor:
        """(K, M) how alike each of K points' concepts (K, L) and each of the model's M points' are: the greater the
        less they diverge. Rows are not comparable with each other."""
        return encode_query(self._vectors(saliency), self._config.measure).features @ self._model

    def _vectors(self, saliency: Float32s) -> torch.Tensor:
        maps = torch.from_numpy(saliency).to(self._device)
        return concept_vectors(binary_maps(maps) if self._config.binary else maps, self._config.temperature)

    def _greatest(self, query: Encoded, per_point: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """(N, k) greatest likenesses of every query and their model points, block by block; and (M,) every model
        point's best query, if matches are to be mutual."""
        model_points = self._model.shape[1]
        rows = max(1, int(self._config.memory_mb * 2**20 / 4 / model_points))
        best = torch.full((model_points,), -torch.inf, device=self._device)
        backward = torch.zeros(model_points, dtype=torch.long, device=self._device)
        found = []
        for start in range(0, len(query.own), rows):
            block = query.features[start : start + rows] @ self._model
            found.append(block.max(dim=1, keepdim=True) if per_point == 1 else block.topk(per_point, dim=1))
            if self._config.mutual:
                column = (block - query.own[start : start + rows].unsqueeze(1)).max(dim=0)
                backward = torch.where(column.values > best, column.indices + start, backward)
                best = torch.maximum(best, column.values)
        return torch.cat([f.values for f in found]), torch.cat([f.indices for f in found]), backward

    def _look_alikes(self, model: ConceptModel, log_model: torch.Tensor) -> torch.Tensor:
        """(M,) divergence of every model point from the most similar one elsewhere on the object."""
        some = torch.linspace(0, len(model) - 1, min(len(model), DISTINCT_POINTS), device=self._device).long()
        points = torch.from_numpy(model.points).float().to(self._device)
        query = encode_query(log_model, self._config.measure)
        rows = max(1, int(self._config.memory_mb * 2**20 / 8 / len(some)))
        likeness = [
            (part @ self._model[:, some])
            .masked_fill_(torch.cdist(place, points[some]) < FAR * model.diameter_m, -torch.inf)
            .amax(dim=1)
            for part, place in zip(query.features.split(rows), points.split(rows), strict=True)
        ]
        return (query.own - torch.cat(likeness)).clamp(0, 10)  # no look-alike at all: as distinct as can be
