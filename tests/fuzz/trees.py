"""Damage of JSON and YAML that keeps it such: values of other types and sizes, keys that are missing or twice there."""

from __future__ import annotations

import json
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import yaml

from tests.fuzz.damage import Rng, damaged
from tests.fuzz.words import WORDS, reworded

NESTED: list[Any] = []
for _ in range(100):
    NESTED = [NESTED]
VALUES: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 5, 7, 255, 2**31, 2**63, -(2**63) - 1, 10**30, 10**400, 0.5, -0.0, 1e308, -1e308,
    1e-320,
    float("nan"), float("inf"), float("-inf"), "", "x", "5", "-1", "nan", "x" * 10_000, "\0", "\ud800", "٣", "²", [],
    {}, [[]],
    [0], [1] * 3, [0.0] * 9, [float("nan")] * 9, [1] * 10_000, [[1, 2], [3]], {"": 0}, {"obj_id": 4}, [None], NESTED,
    {"axis": [0, 0, 0], "offset": [0, 0, 0]}, [1, 0, 0, 0, 1, 0, 0, 0, 1],
)  # fmt: skip
KEYS = (
    "",
    "x",
    "0",
    "-1",
    "5",
    "00005",
    "٣",
    "²",
    "9" * 30,
    "9" * 400,
    "1" * 5000,
    "1e3",
    "nan",
    "\0",
    "obj_id",
    "seed",
)


def changed_json(data: bytes, rng: Rng) -> bytes:
    return _changed(data, rng) or json.dumps(change(json.loads(data), rng)).encode()


def changed_yaml(data: bytes, rng: Rng) -> bytes:
    return _changed(data, rng) or yaml.dump(change(yaml.safe_load(data), rng)).encode(errors="surrogatepass")


def _changed(data: bytes, rng: Rng) -> bytes | None:
    what = rng.random()
    return damaged(data, rng) if what < 0.2 else reworded(data, rng) if what < 0.4 else None


def change(content: Any, rng: Rng) -> Any:
    """A copy with one to three changes."""
    held = {"": deepcopy(content)}
    for _ in range(min(rng.geometric(0.6), 4)):
        _change_once(held, rng)
    return held[""]


def _change_once(held: dict[str, Any], rng: Rng) -> None:
    places = list(_places(held))
    within, key = places[rng.integers(len(places))]
    what = rng.integers(8)
    if what == 0 and within is not held:
        del within[key]
    elif what == 1 and isinstance(within, dict) and within is not held:
        within[KEYS[rng.integers(len(KEYS))]] = within.pop(key)
    elif what == 2 and isinstance(within, list):
        within.extend(deepcopy(within[key]) for _ in range(rng.integers(1, 20)))
    elif what == 3:
        other, there = places[rng.integers(len(places))]
        within[key] = deepcopy(other[there])
    elif what == 4:
        within[key] = WORDS[rng.integers(len(WORDS))]
    elif what == 5:
        within[key] = [within[key]] if rng.random() < 0.5 else {KEYS[rng.integers(len(KEYS))]: within[key]}
    elif what == 6 and isinstance(within[key], str):
        within[key] = reworded(within[key].encode(errors="ignore"), rng).decode(errors="ignore")
    else:
        within[key] = deepcopy(VALUES[rng.integers(len(VALUES))])


def _places(within: Any) -> Iterator[tuple[Any, Any]]:
    """Every value as its container and its key there; of what is nested deeply only the outermost."""
    ahead = [(within, 0)]
    while ahead:
        container, depth = ahead.pop()
        keys = list(container) if isinstance(container, dict) else range(len(container))
        for key in keys:
            yield container, key
            if isinstance(container[key], dict | list) and depth < 12:
                ahead.append((container[key], depth + 1))
