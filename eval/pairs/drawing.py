"""Pairs drawn from the targets of a dataset, the same for the same seed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eval.answers import targets_of
from eval.datasets import Dataset
from eval.pairs import Pair, PairKind, View
from reference.keyframes import LEAST_VISIBLE_PX, LEAST_VISIBLE_SHARE
from tracker.errors import SourceError

DRAWN = (
    "anchors uniformly from the targets that show the object well enough for a reference "
    f"({LEAST_VISIBLE_PX} pixels, {LEAST_VISIBLE_SHARE:g} of the object's best visible fraction), queries uniformly "
    "from the object's other targets, no pair twice"
)


def draw_pairs(
    dataset: Dataset,
    kind: PairKind,
    count: int,
    seed: int,
    scene_ids: Sequence[int] | None = None,
    object_ids: Sequence[str] | None = None,
) -> list[Pair]:
    """The first `count` pairs of the order that the seed gives, fewer where there are not so many.

    Anchor and query are of different scenes, or different images of one scene; `DRAWN` is the rule. scene_ids,
    object_ids: only those, all unless given. Raises SourceError where there is no such pair, or where the dataset does
    not have a scene or object that is asked for.
    """
    views: dict[str, list[View]] = {}
    for scene_id, target in targets_of(dataset, scene_ids, object_ids):
        views.setdefault(target.object_id, []).append(View(scene_id, target))
    good = [anchor for object_id in sorted(views, key=dataset.number) for anchor in _good_anchors(views[object_id])]
    anchors = [a for a in good if any(_may_meet(a, query, kind) for query in views[a.target.object_id])]
    if not good:
        raise SourceError(
            f"{dataset.name}: none of {sum(map(len, views.values()))} targets shows its object well enough for an "
            f"anchor, {LEAST_VISIBLE_PX} visible pixels are needed"
        )
    if not anchors:
        other, where = ("same-scene", "scene") if kind == "cross-scene" else ("cross-scene", "image of its scene")
        raise SourceError(
            f"{dataset.name} has no {kind} pair: none of {len(good)} possible anchors of {len(views)} objects has a "
            f"target in another {where}; try the kind {other}"
        )
    rng = np.random.default_rng(seed)
    left = list(range(len(anchors)))
    unused: dict[int, list[View]] = {}  # by anchor, its queries in the order in which they will be taken
    pairs: list[Pair] = []
    while left and len(pairs) < count:
        place = int(rng.integers(len(left)))
        anchor = anchors[left[place]]
        if left[place] not in unused:
            queries = [query for query in views[anchor.target.object_id] if _may_meet(anchor, query, kind)]
            unused[left[place]] = [queries[k] for k in rng.permutation(len(queries))]
        pairs.append(Pair(anchor, unused[left[place]].pop()))
        if not unused[left[place]]:
            left.pop(place)
    return pairs


def _good_anchors(views: Sequence[View]) -> list[View]:
    """Those that may become reference frames, by the rule of `reference.keyframes`."""
    least_fraction = LEAST_VISIBLE_SHARE * max(view.target.visible_fraction for view in views)
    large = [view for view in views if view.target.visible_px >= LEAST_VISIBLE_PX]
    return [view for view in large if view.target.visible_fraction >= least_fraction]


def _may_meet(anchor: View, query: View, kind: PairKind) -> bool:
    same_scene = anchor.scene_id == query.scene_id
    return same_scene and anchor.target.image_id != query.target.image_id if kind == "same-scene" else not same_scene
