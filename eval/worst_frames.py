"""Where a run was worst, and where it said nothing and why."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from eval.frame_record import FrameRecord
from eval.instances import InstanceError

WORST = 12


@dataclass(frozen=True, slots=True)
class MissingPoses:
    """Images of a scene in which an object has no pose for the same reason."""

    scene_id: int
    object_id: str
    reason: str
    image_ids: tuple[int, ...]


def counted_error_m(row: InstanceError) -> float:
    """ADD(-S): ADD-S of an object that is declared symmetric, ADD of any other."""
    return row.adds_m if row.symmetric else row.add_m


def worst_instances(rows: Iterable[InstanceError], count: int = WORST) -> list[InstanceError]:
    """Those of the largest ADD(-S) that have a pose, the worst first; of equals in their order."""
    return sorted((row for row in rows if not row.missing), key=counted_error_m, reverse=True)[:count]


def missing_poses(rows: Iterable[InstanceError], records: Sequence[FrameRecord]) -> list[MissingPoses]:
    """Instances without a pose by scene, object and reason, the most frequent first."""
    said = {(r.scene_id, r.object_id, r.image_id): f"{r.state}: {r.reason}" if r.reason else r.state for r in records}
    unsaid = "no step of the run was about it" if records else "the results have no row of it"
    found: dict[tuple[int, str, str], list[int]] = {}
    for row in (row for row in rows if row.missing):
        reason = said.get((row.scene_id, row.object_id, row.image_id), unsaid)
        found.setdefault((row.scene_id, row.object_id, reason), []).append(row.image_id)
    groups = [MissingPoses(*key, tuple(sorted(images))) for key, images in found.items()]
    return sorted(groups, key=lambda group: -len(group.image_ids))
