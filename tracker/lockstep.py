"""Several objects' stages side by side, so that what all of them ask a backend is one batch."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from tracker.looking import Asking
from tracker.saliency import Saliency
from tracker.view import ObjectView

T = TypeVar("T")


def lockstep(
    steps: Sequence[Asking[T]], answered: Callable[[Mapping[int, ObjectView]], Mapping[int, Saliency | None]]
) -> list[T]:
    """What each step comes to. answered: position -> view to position -> its saliency, as often as any of them asks."""
    results: dict[int, T] = {}
    answers: Mapping[int, Saliency | None] = dict.fromkeys(range(len(steps)))
    while answers:
        asked: dict[int, ObjectView] = {}
        for k, saliency in answers.items():
            try:
                asked[k] = steps[k].send(saliency)  # None starts a generator
            except StopIteration as ended:
                results[k] = ended.value
        answers = answered(asked) if asked else {}
    return [results[k] for k in range(len(steps))]
