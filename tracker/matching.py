"""A cloud and a concept model -> which point of the cloud is which point of the object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from pydantic import BaseModel, ConfigDict, Field

from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.view import Float32s


class MatchingConfig(BaseModel):
    """temperature: tau of the softmax that makes saliency a distribution over concepts.
    query_points: at most so many points of the cloud are matched, spread evenly over it.
    memory_mb: bound on the block of the similarity matrix that is held at a time."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    temperature: float = Field(default=0.3, gt=0)
    query_points: int = Field(default=1500, ge=50, le=10_000)
    memory_mb: float = Field(default=64.0, ge=1)


@dataclass(frozen=True, slots=True, eq=False)
class Correspondences:
    """query_index, model_index: (M,) points of the cloud and of the model that say the same.
    divergence: (M,) float32, KL(query || model) of their concept vectors in nats."""

    query_index: npt.NDArray[np.intp]
    model_index: npt.NDArray[np.intp]
    divergence: Float32s

    def __len__(self) -> int:
        return len(self.query_index)


def concept_vectors(saliency: torch.Tensor, temperature: float) -> torch.Tensor:
    """(N, L) saliency -> (N, L) log-probabilities of the concepts: log softmax(s / tau), the paper's Eq. 1."""
    return torch.log_softmax(saliency.float() / temperature, dim=1)


class Matcher:
    """For each point of a cloud the model's point of least forward KL divergence, the paper's Eq. 3."""

    def __init__(self, model: ConceptModel, config: MatchingConfig, device: torch.device) -> None:
        self._config, self._device = config, device
        saliency = torch.from_numpy(model.saliency).to(device)
        self._log_model = concept_vectors(saliency, config.temperature).T.contiguous()

    def __call__(self, cloud: PointCloud) -> Correspondences:
        chosen = np.linspace(0, len(cloud) - 1, min(len(cloud), self._config.query_points)).round().astype(np.intp)
        saliency = torch.from_numpy(cloud.saliency[chosen]).to(self._device)
        log_query = concept_vectors(saliency, self._config.temperature)
        query = log_query.exp()
        rows = max(1, int(self._config.memory_mb * 2**20 / 4 / self._log_model.shape[1]))
        cross = [(block @ self._log_model).max(dim=1) for block in query.split(rows)]
        # KL(q || m) = sum q log q - sum q log m: the first term is the same for every m
        divergence = (query * log_query).sum(dim=1) - torch.cat([c.values for c in cross])
        return Correspondences(
            query_index=chosen,
            model_index=torch.cat([c.indices for c in cross]).cpu().numpy(),
            divergence=divergence.clamp_min(0).cpu().numpy(),
        )
