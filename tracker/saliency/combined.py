"""Two backends or more, asked together: "siglip2+attributes" knows the handle and measures the label's colours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracker.saliency import Query, Saliency, SaliencyBackend, fingerprint_of
from tracker.view import Float32s


class Combined:
    """Concept vectors of its parts one after the other, each part's saliency times its weight.

    parts: backends with their weights in (0, 1]. The first is asked for the vocabulary, the others for their own
    concepts; of two concepts of one name the later part's is kept, as it is the measured one.
    """

    def __init__(self, parts: Sequence[tuple[SaliencyBackend, float]]) -> None:
        self._parts = parts
        self.name = "+".join(backend.name if w == 1 else f"{backend.name}*{w:g}" for backend, w in parts)
        self.weights = ", ".join(f"{backend.name}: {backend.weights}" for backend, _ in parts)
        self.fingerprint = fingerprint_of(self.name, " ".join(backend.fingerprint for backend, _ in parts))
        self._own = [backend.labels_for(None) for backend, _ in parts[1:]]

    def labels_for(self, wanted: Sequence[str] | None) -> tuple[str, ...]:
        """The vocabulary's labels, then those of the other parts; a vocabulary that holds those already is complete."""
        first, _ = self._parts[0]
        others = tuple(label for own in self._own for label in own)
        if wanted is not None and len(wanted) > len(others) and tuple(wanted[-len(others) :]) == others:
            return tuple(wanted)
        measured = {label.casefold() for label in others}
        return tuple(label for label in first.labels_for(wanted) if label.casefold() not in measured) + others

    def __call__(self, queries: Sequence[Query]) -> list[Saliency]:
        cuts = [self._cuts(query.labels) for query in queries]
        found = [
            _asked(backend, [Query(q.view, labels[k]) for q, labels in zip(queries, cuts, strict=True)])
            for k, (backend, _) in enumerate(self._parts)
        ]
        return [self._joined(query, [of_part[k] for of_part in found]) for k, query in enumerate(queries)]

    def _cuts(self, labels: tuple[str, ...]) -> list[tuple[str, ...]]:
        """Which labels are whose: the last ones are the later parts' own."""
        rest, cuts = labels, []
        for own in reversed(self._own):
            rest, mine = rest[: -len(own)], rest[-len(own) :]
            cuts.append(mine)
        return [rest, *reversed(cuts)]

    def _joined(self, query: Query, found: Sequence[Saliency | None]) -> Saliency:
        """On the view's grid, on which the cloud samples."""
        box, (height, width) = query.view.box, query.view.depth_m.shape
        block = (box.x1 - box.x0) / width
        rows, columns = np.indices((height, width)).reshape(2, -1)
        x, y = box.x0 + (columns + 0.5) * block - 0.5, box.y0 + (rows + 0.5) * block - 0.5
        maps: list[Float32s] = [
            weight * one.sample(x, y).T.reshape(-1, height, width)
            for one, (_, weight) in zip(found, self._parts, strict=True)
            if one is not None
        ]
        inside = query.view.inside.astype(np.float32)
        return Saliency(query.labels, np.concatenate(maps).astype(np.float32) * inside, box)


def _asked(backend: SaliencyBackend, queries: Sequence[Query]) -> list[Saliency | None]:
    """None for a query without labels: all that was wanted may be another part's."""
    found = iter(backend([query for query in queries if query.labels]) if any(q.labels for q in queries) else ())
    return [next(found) if query.labels else None for query in queries]
