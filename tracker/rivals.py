"""Poses about where one was found, but turned otherwise: what speaks for them speaks against it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tracker.concept import ConceptModel
from tracker.confidence import Grounds, odds
from tracker.found import Found
from tracker.geometry import Pose

CLEARLY_MORE = 0.05  # has a rival to explain: the evidence of one pose differs less by what moves it a bit
TURNED_RAD = 0.175  # a pose farther than this from a right one is wrong


def rival(found: Found, tried: Sequence[Found], model: ConceptModel) -> Pose | None:
    """T_cam_obj of the best of them that explains clearly more of the object, and was thought less likely for being
    unexpected alone. What was found may have turned astray."""
    best = max(tried, key=lambda other: other.explains, default=found)
    if best.explains <= found.explains + CLEARLY_MORE:
        return None
    return next((pose for _, pose in _turned(found, [best], model)), None)


def told_apart(found: Found, tried: Sequence[Found], model: ConceptModel) -> float:
    """In [0, 1], how likely it is this pose rather than one of them, if it is one at all: by the picture alone, as what
    is expected of one frame may have gone wrong in those before it.

    A can whose print is too small to be read fits turned in several ways, each of them so well that it would be
    believed: all are not right at once.
    """
    others: list[Found] = []
    for other, _ in _turned(found, sorted(tried, key=_odds, reverse=True), model):
        if all(any(_turned(one, [other], model)) for one in others):
            others.append(other)
    return _odds(found) / (_odds(found) + sum(map(_odds, others)))


def _odds(found: Found) -> float:
    return odds(Grounds(found.hypothesis.evidence, found.grounds.turn_sigma_rad))


def _turned(found: Found, tried: Sequence[Found], model: ConceptModel) -> Iterator[tuple[Found, Pose]]:
    """Those about there that are turned otherwise, with their poses nearest to it."""
    pose = found.hypothesis.refined.T_cam_obj
    for other in tried:
        nearest = model.symmetry.nearest(other.hypothesis.refined.T_cam_obj, pose)
        if nearest.angle_to_rad(pose) > TURNED_RAD and nearest.distance_to_m(pose) < model.diameter_m / 4:
            yield other, nearest
