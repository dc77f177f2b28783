"""One batch answers what several ask at once."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from typing import Any, cast

from tracker.lockstep import lockstep
from tracker.saliency import Saliency
from tracker.view import ObjectView


def asks(name: str, times: int) -> Generator[ObjectView, Saliency | None, list[str]]:
    """Collects the answers to so many questions."""
    answers: list[Any] = [None] * times
    for k in range(times):
        answers[k] = yield cast("ObjectView", f"{name}{k}")
    return answers


def test_all_that_is_asked_at_once_is_one_batch_and_everyone_gets_the_answer_to_their_own_question() -> None:
    batches: list[Mapping[int, ObjectView]] = []

    def answered(views: Mapping[int, ObjectView]) -> dict[int, Any]:
        batches.append(dict(views))
        return {k: f"to {view}" for k, view in views.items()}

    results = lockstep([asks("a", 2), asks("b", 0), asks("c", 3)], answered)
    assert results == [["to a0", "to a1"], [], ["to c0", "to c1", "to c2"]]
    assert [sorted(cast("dict[int, str]", batch).values()) for batch in batches] == [["a0", "c0"], ["a1", "c1"], ["c2"]]


def test_where_nobody_asks_nobody_is_asked() -> None:
    assert lockstep([asks("a", 0)], lambda _: 1 / 0) == [[]]  # pyright: ignore[reportArgumentType, reportReturnType]


def test_an_answer_may_be_none() -> None:
    assert lockstep([asks("a", 2)], dict.fromkeys) == [[None, None]]
