"""How unlike two concept vectors are: the paper's five measures, each as one matrix product.

Every measure of distributions q (query) and m (model) over L concepts has the form own(q) - features(q) . features(m):
what depends on m alone is one more column. So all pairs cost one product, and the least divergence of a query is the
greatest entry of its row.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch

Measure = Literal["forward", "reverse", "bidirectional", "asymmetric", "cosine"]
FORWARD_SHARE = 0.75  # of the asymmetric measure


@dataclass(frozen=True, slots=True, eq=False)
class Encoded:
    """Concept vectors of N points, ready for a product. features: (N, F). own: (N,), nats."""

    features: torch.Tensor
    own: torch.Tensor


def encode_query(log_q: torch.Tensor, measure: Measure) -> Encoded:
    """log_q: (N, L) log-probabilities of the cloud's points."""
    q = log_q.exp()
    if measure == "cosine":
        return Encoded(torch.nn.functional.normalize(q, dim=1), torch.ones_like(q[:, 0]))
    forward = SHARES[measure]
    one = torch.ones_like(q[:, :1])
    features = torch.cat((forward * q, (1 - forward) * log_q, -(1 - forward) * one), dim=1)
    return Encoded(_used(features, forward, q.shape[1]), forward * (q * log_q).sum(dim=1))


def encode_model(log_m: torch.Tensor, measure: Measure) -> torch.Tensor:
    """(M, F) features of log-probabilities (M, L) of the model's points."""
    m = log_m.exp()
    if measure == "cosine":
        return torch.nn.functional.normalize(m, dim=1)
    features = torch.cat((log_m, m, (m * log_m).sum(dim=1, keepdim=True)), dim=1)
    return _used(features, SHARES[measure], m.shape[1])


def _used(features: torch.Tensor, forward: float, concepts: int) -> torch.Tensor:
    """Without the columns that a one-sided measure would multiply by zero."""
    if forward == 1:
        return features[:, :concepts].contiguous()
    return features[:, concepts:].contiguous() if forward == 0 else features


# forward x KL(q || m) + (1 - forward) x KL(m || q), with
# KL(q || m) = sum q log q - sum q log m and KL(m || q) = sum m log m - sum m log q
SHARES: dict[str, float] = {
    "forward": 1.0,  # the paper's Eq. 3
    "reverse": 0.0,
    "bidirectional": 0.5,  # half of Jeffreys' divergence (Kullback and Leibler 1951)
    "asymmetric": FORWARD_SHARE,  # named and not defined in the paper's table: here both directions, the forward more
}
MEASURES: tuple[str, ...] = (*SHARES, "cosine")
