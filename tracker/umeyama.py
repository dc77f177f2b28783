"""Closed-form motions between corresponding points, many problems at once."""

from __future__ import annotations

from dataclasses import dataclass

import torch

LEAST_RANK = 1e-4  # second over first singular value: points nearer to a line than this leave the turn about it open


@dataclass(frozen=True, slots=True, eq=False)
class Motions:
    """B motions, target = scale * rotation @ source + translation. rotation: (B, 3, 3). translation: (B, 3).
    scale: (B,). determined: (B,) bool, False where the points lie on a line or in one place."""

    rotation: torch.Tensor
    translation: torch.Tensor
    scale: torch.Tensor
    determined: torch.Tensor

    def __getitem__(self, chosen: torch.Tensor) -> Motions:
        return Motions(self.rotation[chosen], self.translation[chosen], self.scale[chosen], self.determined[chosen])

    def __len__(self) -> int:
        return len(self.rotation)

    def joined(self, other: Motions) -> Motions:
        """These, then the others."""
        return Motions(
            torch.cat((self.rotation, other.rotation)),
            torch.cat((self.translation, other.translation)),
            torch.cat((self.scale, other.scale)),
            torch.cat((self.determined, other.determined)),
        )


def rigid(rotation: torch.Tensor, translation: torch.Tensor) -> Motions:
    """B motions (B, 3, 3) and (B, 3) that change no distance."""
    one = torch.ones_like(translation[:, 0])
    return Motions(rotation, translation, one, one > 0)


def no_motions(like: torch.Tensor) -> Motions:
    """None at all, of a tensor's type and device."""
    return Motions(like.new_zeros(0, 3, 3), like.new_zeros(0, 3), like.new_zeros(0), like.new_zeros(0) > 0)


def umeyama(source: torch.Tensor, target: torch.Tensor, weights: torch.Tensor, with_scale: bool = False) -> Motions:
    """Motions of least weighted squared error. source, target: (B, N, 3); weights: (B, N), not negative.

    Scale is 1 unless asked for. Umeyama, TPAMI 1991, Eqs. 40-43.
    """
    share = (weights / weights.sum(dim=1, keepdim=True).clamp_min(1e-12)).unsqueeze(2)
    centre_s, centre_t = (share * source).sum(dim=1), (share * target).sum(dim=1)
    apart = source - centre_s.unsqueeze(1)
    covariance = (target - centre_t.unsqueeze(1)).transpose(1, 2) @ (share * apart)
    return _solved(covariance, centre_s, centre_t, (share * apart * apart).sum(dim=(1, 2)) if with_scale else None)


def umeyama_of_moments(centre_s: torch.Tensor, centre_t: torch.Tensor, second: torch.Tensor) -> Motions:
    """`umeyama` where the weighted means (B, 3) of both sides are known, and that of target source^T, (B, 3, 3)."""
    return _solved(second - centre_t.unsqueeze(2) * centre_s.unsqueeze(1), centre_s, centre_t, None)


def _solved(
    covariance: torch.Tensor, centre_s: torch.Tensor, centre_t: torch.Tensor, variance_s: torch.Tensor | None
) -> Motions:
    u, singular, vt = torch.linalg.svd(covariance)
    sign = torch.ones_like(singular)
    sign[:, 2] = torch.det(u @ vt)
    rotation = (u * sign.unsqueeze(1)) @ vt
    scale = torch.ones_like(singular[:, 0])
    if variance_s is not None:
        scale = (singular * sign).sum(dim=1) / variance_s.clamp_min(1e-20)
    moved = scale.unsqueeze(1) * (rotation @ centre_s.unsqueeze(2)).squeeze(2)
    determined = (singular[:, 1] > LEAST_RANK * singular[:, 0]) & (singular[:, 0] > 0)
    return Motions(rotation, centre_t - moved, scale, determined)


def triangles(source: torch.Tensor, target: torch.Tensor) -> Motions:
    """What `umeyama` finds for three points each, (B, 3, 3), that go round the same way, without a singular value
    decomposition: one plane is laid on the other, then turned within it."""
    # B comes last within: sums over three neighbours in memory take several times those over three rows
    source, target = (corners.permute(1, 2, 0).contiguous() for corners in (source, target))
    centre_s, centre_t = source.mean(dim=0), target.mean(dim=0)
    axes_s, axes_t = _axes(source), _axes(target)
    x_s, y_s = (((source - centre_s) * axis).sum(dim=1) for axis in axes_s[:2])
    x_t, y_t = (((target - centre_t) * axis).sum(dim=1) for axis in axes_t[:2])
    cosine, sine = (x_s * x_t + y_s * y_t).sum(dim=0), (x_s * y_t - y_s * x_t).sum(dim=0)
    length = (cosine * cosine + sine * sine).sqrt_()
    cosine, sine = cosine / length.clamp_min(1e-20), sine / length.clamp_min(1e-20)
    x, y, z = axes_t
    turned = torch.stack((cosine * x + sine * y, cosine * y - sine * x, z))
    rotation = (turned.unsqueeze(2) * axes_s.unsqueeze(1)).sum(dim=0)
    translation = centre_t - (rotation * centre_s).sum(dim=1)
    return Motions(rotation.permute(2, 0, 1).contiguous(), translation.T, torch.ones_like(length), length > 0)


def _axes(corners: torch.Tensor) -> torch.Tensor:
    """(3, 3, B) orthonormal axes of triangles (3, 3, B), corner by corner: along the first edge, across it within the
    triangle, out of the triangle."""
    edge, other = corners[1] - corners[0], corners[2] - corners[0]
    along = _unit(edge)
    out = _unit(torch.linalg.cross(edge, other, dim=0))
    return torch.stack((along, torch.linalg.cross(out, along, dim=0), out))


def _unit(vectors: torch.Tensor) -> torch.Tensor:
    """(3, B) of length 1; torch's own norm over rows takes forty times as long."""
    return vectors / (vectors * vectors).sum(dim=0).sqrt_().clamp_min_(1e-20)
