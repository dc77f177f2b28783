"""`python -m eval pairs`: one-shot relative pose on pairs of images, drawn by a seed or read from a list."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from tracker.terminal import STDERR, hush, progress, say_json

if TYPE_CHECKING:
    from eval.datasets import Dataset
    from eval.pairs import Pair

COUNT, SEED, KIND = 2000, 42, "cross-scene"  # 2000 cross-scene pairs a dataset, as in the paper


@dataclass
class Pairs:
    """Make a model of a single anchor image, find the object in a query image, score T_query_anchor."""

    dataset: str
    """bop:PATH, ycb-video:PATH, nocs:PATH, ycbineoat:PATH or synthetic:NAME."""
    pairs: int | None = None
    """How many pairs are drawn from the dataset's targets. Default: 2000, or as many as there are."""
    seed: int | None = None
    """Of the drawing: the same seed, the same pairs. Default: 42."""
    kind: Literal["cross-scene", "same-scene"] | None = None
    """Anchor and query are of different scenes, or different images of one scene. Default: cross-scene."""
    pair_list: Annotated[Path | None, tyro.conf.arg(name="list", metavar="FILE")] = None
    """Take the pairs of a list: a pairs.csv of an earlier run, or an instance_list.txt of Oryon's."""
    scenes: tuple[int, ...] | None = None
    """Draw from these scenes only."""
    objects: tuple[str, ...] | None = None
    """Draw these objects only."""
    method: Literal["ours", "sift", "fpfh"] = "ours"
    """Who answers: this tracker with its prior off, or another method made of the same anchor."""
    backend: str = "attributes"
    """Which saliency backend finds the concepts; "siglip2+attributes" joins two."""
    weights: str | None = None
    """Weights of the backend: a size, a name on the hub, or a folder."""
    device: str = "auto"
    """Where the backend runs; auto is CUDA where there is one."""
    vocabulary: str | None = None
    """Concepts to look for: a set that comes along (general, ycbv, real275, linemod, toyota-light) or a YAML file.
    Default: the backend's own."""
    symmetric: tuple[str, ...] | None = None
    """The objects whose ADD(-S) is ADD-S. Default: those that the dataset declares symmetric."""
    vsd: bool = False
    """Measure VSD too, and with it BOP's AR: reads the depth of every query once more."""
    config: Path | None = None
    """YAML file with settings that differ from the defaults."""
    out: Path | None = None
    """Folder for pairs.csv, poses.jsonl, results.csv, scores.json, report.html and config.yaml."""
    overwrite: bool = False
    """Replace results that are in the --out folder."""
    json: bool = False
    """Write the scores, as in scores.json, to the standard output, as a line of JSON, and no tables."""
    quiet: bool = False
    """Nothing on the terminal but warnings and errors."""

    def __call__(self) -> None:
        from collections import Counter
        from contextlib import ExitStack

        from eval.datasets import open_dataset
        from eval.environment import environment
        from eval.html_report import write_html
        from eval.markdown_report import write_markdown
        from eval.pairs.one_shot import OneShot, answer_pairs, estimates_of, score_pairs
        from eval.pairs.output import write_answers, write_result_files
        from eval.pairs.pair_lists import write_pairs
        from eval.peers import method_kind
        from eval.report import make_report, write_scores
        from eval.score_tables import tables
        from eval.tracked import Tracked
        from reference.vocabulary import read_vocabulary
        from tracker.config import dump_config, read_config
        from tracker.output import result_folder
        from tracker.saliency import BackendOptions, open_backend

        vocabularies = read_vocabulary(self.vocabulary) if self.vocabulary else None
        hush(self.quiet or self.json)
        backend = open_backend(self.backend, BackendOptions(self.weights, self.device))
        one_shot = OneShot(backend, read_config(self.config), vocabularies, self.method)
        dataset = open_dataset(self.dataset)
        with ExitStack() as stack:
            folder = stack.enter_context(result_folder(self.out, self.overwrite)) if self.out else None
            pairs, stated = self._pairs(dataset)
            with _without_warnings_of("reference.onboard"):  # each model has one view, and each would say so
                answered = answer_pairs(dataset, pairs, one_shot, progress)
            kind = method_kind(self.method)
            protocol: dict[str, object] = {
                **stated,
                "method": self.method,
                **kind.stated(one_shot.config, backend, self.vocabulary, "estimated"),
                "views": 1,
                "masks": "the dataset's visible masks, of anchor and query",
                "initialisation": "none: the anchor's true pose names the object frame, of the query's nothing is told",
                "reinitialisation": "none: every query is searched anew, by a method that has seen the anchor only",
                "poses": "T_query_anchor composed with the anchor's true pose",
                "models_refused": answered.refused,
            }
            scores = score_pairs(dataset, pairs, answered.answers, protocol, self.symmetric, self.vsd)
            timings = [answer.timings_ms for answer in answered.answers if answer.timings_ms]
            latency_ms = Tracked(timings_ms=timings).latency_ms()
            if self.json:
                say_json({**scores.as_json(), "latency_ms": latency_ms, "environment": environment()})
            if folder:
                extra = {"latency_ms": latency_ms, "environment": environment()}
                write_pairs(folder / "pairs.csv", pairs, dataset)
                write_answers(folder / "poses.jsonl", pairs, answered.answers, scores.instances)
                estimates = estimates_of(pairs, answered.answers, dataset)
                write_result_files(folder, estimates)
                write_scores(folder / "scores.json", scores, extra)
                times_asked = Counter((e.scene_id, e.image_id, e.object_id) for e in estimates if e)
                drawn = [e for e in estimates if e and times_asked[e.scene_id, e.image_id, e.object_id] == 1]
                report = make_report(f"Pairs of {self.dataset}", dataset, scores, drawn, extra)
                write_html(folder / "report.html", report)
                write_markdown(folder / "report.md", report)
                (folder / "config.yaml").write_text(dump_config(one_shot.config))
        who = f"backend {self.backend}" if kind.concepts else f"method {self.method}"
        for each in tables(scores, f"{self.dataset}, {len(pairs)} {stated['kind']} pairs, {who}"):
            STDERR.print(each)
        if latency_ms:
            STDERR.print(f"a query: median {latency_ms['median']:.1f} ms, p95 {latency_ms['p95']:.1f} ms")
        if self.out:
            STDERR.print(f"written to {self.out}")

    def _pairs(self, dataset: Dataset) -> tuple[Sequence[Pair], dict[str, object]]:
        """The pairs, and what the protocol says of them."""
        from eval.pairs.drawing import DRAWN, draw_pairs
        from eval.pairs.pair_lists import read_pairs
        from tracker.errors import ConfigError

        asked = {
            "--pairs": self.pairs,
            "--seed": self.seed,
            "--kind": self.kind,
            "--scenes": self.scenes,
            "--objects": self.objects,
        }
        if self.pair_list is not None:
            if useless := [name for name, value in asked.items() if value is not None]:
                raise ConfigError(
                    f"--list FILE says which pairs there are: {', '.join(useless)} cannot be asked for too"
                )
            pairs = read_pairs(self.pair_list, dataset)
            origin = {"seed": None, "pair_list": str(self.pair_list), "pairs_are": "those of the list"}
        else:
            count, seed = COUNT if self.pairs is None else self.pairs, SEED if self.seed is None else self.seed
            if count < 1 or seed < 0:
                raise ConfigError(f"--pairs is at least 1 and --seed at least 0, got {count} and {seed}")
            pairs = draw_pairs(dataset, self.kind or KIND, count, seed, self.scenes, self.objects)
            origin = {"seed": seed, "pair_list": None, "pairs_are": DRAWN, "pairs_asked": count}
        kinds = {pair.kind for pair in pairs}
        anchors = {(p.anchor.scene_id, p.anchor.target.image_id, p.object_id) for p in pairs}
        queries = {(p.query.scene_id, p.query.target.image_id, p.object_id) for p in pairs}
        return pairs, {
            "task": "one-shot relative pose: one anchor image makes the model, one query image is answered",
            "kind": kinds.pop() if len(kinds) == 1 else "cross-scene and same-scene",
            "pairs": len(pairs),
            "anchors": len(anchors),
            "queries": len(queries),
            **origin,
        }


@contextmanager
def _without_warnings_of(name: str) -> Iterator[None]:
    logger = logging.getLogger(name)
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)
