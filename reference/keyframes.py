"""Which frames of a recording become reference frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reference.viewsphere import icosphere_directions, nearest_direction, view_direction, widest_sampling
from tracker.errors import OnboardingError
from tracker.sources import Sighting

SUBDIVISIONS = 3  # 642 directions, 4 to 5 degrees apart: finer differences of view do not matter
LEAST_VISIBLE_SHARE = 0.3  # of the best visible frame's visible fraction: less of it teaches next to nothing
LEAST_VISIBLE_PX = 400


def choose_reference_frames(sightings: Sequence[Sighting], count: int) -> list[Sighting]:
    """Up to count sightings that see the object well and from directions as different as can be.

    Viewing directions in the object's frame are snapped to an icosphere; of the frames at one direction the best
    visible counts. Farthest-point sampling from every direction is tried, and the widest set is taken; an angle counts
    as much as is visible there, as a half hidden view teaches half. Deterministic: ties go to the better visible, then
    to the lower index. Raises OnboardingError if no frame shows the object well enough.
    """
    best_fraction = max((s.visible_fraction for s in sightings), default=0.0)
    usable = [
        s
        for s in sightings
        if s.visible_px >= LEAST_VISIBLE_PX and s.visible_fraction >= LEAST_VISIBLE_SHARE * best_fraction
    ]
    if not usable:
        most = max((s.visible_px for s in sightings), default=0)
        raise OnboardingError(
            f"none of {len(sightings)} frames shows the object well enough for a reference: "
            f"at most {most} pixels of it are visible, {LEAST_VISIBLE_PX} are needed"
        )
    usable.sort(key=lambda s: (-s.visible_px, s.index))
    sphere = icosphere_directions(SUBDIVISIONS)
    nodes = nearest_direction(np.stack([view_direction(s.T_cam_obj) for s in usable]), sphere)
    first = np.sort(np.unique(nodes, return_index=True)[1])  # the best visible frame at each direction, best first
    worth = np.array([usable[i].visible_fraction for i in first]) / best_fraction
    picked = widest_sampling(sphere[nodes[first]], count, worth)
    return [usable[int(first[i])] for i in picked]
