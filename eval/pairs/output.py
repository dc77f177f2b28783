"""What a run over pairs leaves behind beside its scores: every pair's answer, and result files in BOP's format."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from eval.bop_results import Estimate, write_results
from eval.instances import InstanceError
from eval.pairs import Pair, View
from eval.pairs.one_shot import PairAnswer

MEASURED = ("add_m", "adds_m", "rotation_deg", "translation_m", "mssd_m", "mspd_px", "iou")


def write_answers(
    path: Path, pairs: Sequence[Pair], answers: Sequence[PairAnswer], errors: Sequence[InstanceError]
) -> None:
    """A line of JSON a pair, in their order: T_query_anchor as 4x4 in metres, or null and the reason; the errors of the
    query's pose, null where they are infinite or were not measured."""
    lines = (
        {
            "pair": number,
            "object": pair.object_id,
            "anchor": _place(pair.anchor),
            "query": _place(pair.query),
            "T_query_anchor": None if answer.T_query_anchor is None else answer.T_query_anchor.matrix.tolist(),
            "confidence": round(answer.confidence, 4),
            "reason": answer.reason,
            "errors": {name: value if np.isfinite(value := getattr(error, name)) else None for name in MEASURED},
        }
        for number, (pair, answer, error) in enumerate(zip(pairs, answers, errors, strict=True), 1)
    )
    path.write_text("".join(json.dumps(line, allow_nan=False) + "\n" for line in lines), encoding="utf-8")


def write_result_files(folder: Path, estimates: Iterable[Estimate | None]) -> list[Path]:
    """results.csv in BOP's format, or where a query is in several pairs results-1.csv, results-2.csv ..: the K-th holds
    the K-th pose of every query that has so many. In one file they would be several instances of the object.

    Of time nothing is written: BOP's is that of all objects in an image together. Returns the files.
    """
    rounds: list[list[Estimate]] = [[]]
    seen: Counter[tuple[int, int, int]] = Counter()
    for estimate in estimates:
        if estimate is not None:
            place = estimate.scene_id, estimate.image_id, estimate.object_id
            if seen[place] == len(rounds):
                rounds.append([])
            rounds[seen[place]].append(estimate)
            seen[place] += 1
    names = [f"results-{k}.csv" for k in range(1, len(rounds) + 1)] if len(rounds) > 1 else ["results.csv"]
    for name, of_round in zip(names, rounds, strict=True):
        write_results(folder / name, of_round)
    return [folder / name for name in names]


def _place(view: View) -> dict[str, int]:
    return {"scene": view.scene_id, "image": view.target.image_id}
