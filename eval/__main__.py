"""`python -m eval track` runs the tracker on a dataset and scores it, `pairs` on pairs of images; `score` scores
anybody's BOP result file."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from eval.bench.registration import RegistrationBench
from eval.bench.saliency import SaliencyBench
from eval.bench.scoring import ScoringBench
from eval.pairs.command import Pairs
from tracker.terminal import STDERR, progress, run

if TYPE_CHECKING:
    from tracker.concept import ConceptModel
    from tracker.viewer import Viewer


@dataclass
class Track:
    """Make few-shot models from each scene's own frames, track all its frames in order, and score the poses."""

    dataset: str
    """bop:PATH, ycb-video:PATH, nocs:PATH, ycbineoat:PATH or synthetic:NAME."""
    scenes: tuple[int, ...] | None = None
    """Only these scenes."""
    objects: tuple[str, ...] | None = None
    """Only these objects."""
    method: Literal["ours", "sift", "fpfh", "icp", "colored-icp"] = "ours"
    """Who tracks: this tracker, or another method made of the same models. icp and colored-icp need --init gt."""
    init: Literal["estimated", "gt"] = "estimated"
    """gt: tell each object's true pose once a scene, in the first frame where it is visible."""
    backend: str = "attributes"
    """Which saliency backend finds the concepts; "siglip2+attributes" joins two."""
    weights: str | None = None
    """Weights of the backend: a size, a name on the hub, or a folder."""
    device: str = "auto"
    """Where the backend runs; auto is CUDA where there is one."""
    vocabulary: str | None = None
    """Concepts to look for: a set that comes along (general, ycbv, real275, linemod, toyota-light) or a YAML file.
    Default: the backend's own."""
    views: int = 2
    """Reference frames an object and scene; they are not scored."""
    masks: Literal["visib"] = "visib"
    """Where the object's pixels come from: the dataset's masks of what can be seen."""
    prior: Literal["on", "off"] | None = None
    """Start each frame from the predicted pose, or search every frame anew. Default: as the config says (on)."""
    poses: Literal["filtered", "raw"] = "filtered"
    """Which poses are scored: after the filter, or of each frame alone."""
    symmetric: tuple[str, ...] | None = None
    """The objects whose ADD(-S) is ADD-S. Default: those that the dataset declares symmetric."""
    vsd: bool = False
    """Measure VSD too, and with it BOP's AR: reads the depth of every image with a target once more."""
    config: Path | None = None
    """YAML file with settings that differ from the defaults."""
    out: Path | None = None
    """Folder for scores.json, results.csv, report.html, report.md, config.yaml and what --view makes."""
    view: Literal["none", "overlay"] = "none"
    """overlay: write overlay.mp4 to the --out folder (one for each of several scenes)."""
    overwrite: bool = False
    """Replace results that are in the --out folder."""

    def __call__(self) -> None:
        from contextlib import ExitStack

        from eval.bop_results import write_results
        from eval.datasets import open_dataset
        from eval.html_report import write_html
        from eval.markdown_report import write_markdown
        from eval.peers import method_kind
        from eval.predict import Protocol, track_dataset
        from eval.report import environment, make_report, write_scores
        from eval.score import score
        from eval.score_tables import tables
        from reference.vocabulary import read_vocabulary
        from tracker.config import dump_config, read_config
        from tracker.errors import ConfigError
        from tracker.output import result_folder
        from tracker.saliency import BackendOptions, open_backend
        from tracker.viewer import NullViewer, OverlayVideo

        if self.view != "none" and self.out is None:
            raise ConfigError(f"--view {self.view} needs a folder to write to: give --out DIR")
        if self.views < 1:
            raise ConfigError(f"--views: at least one reference frame is needed, got {self.views}")
        config = read_config(self.config)
        if self.prior is not None:
            config = config.model_copy(update={"prior": self.prior == "on"})
        kind = method_kind(self.method)
        dataset = open_dataset(self.dataset)
        vocabularies = read_vocabulary(self.vocabulary) if self.vocabulary else None
        backend = open_backend(self.backend, BackendOptions(self.weights, self.device))
        protocol = Protocol(backend, config, self.views, self.poses, vocabularies, self.method, self.init)
        scene_ids = dataset.scene_ids if self.scenes is None else self.scenes
        with ExitStack() as stack:
            folder = stack.enter_context(result_folder(self.out, self.overwrite)) if self.out else None

            def viewer(scene_id: int, models: Sequence[ConceptModel]) -> Viewer:
                if folder is None or self.view == "none":
                    return NullViewer()
                name = "overlay.mp4" if len(scene_ids) == 1 else f"overlay_{scene_id:06d}.mp4"
                return OverlayVideo(folder / name, models)

            tracked = track_dataset(dataset, protocol, scene_ids, self.objects, viewer, progress)
            scores = score(
                dataset,
                tracked.estimates,
                scene_ids=scene_ids,
                object_ids=self.objects,
                exclude=tracked.reference_frames,
                protocol={
                    "method": self.method,
                    **kind.stated(config, backend, self.vocabulary, self.init),
                    "views": self.views,
                    "masks": "the dataset's visible masks",
                    "reinitialisation": "by the method itself, never from the truth",
                    "poses": self.poses,
                    "models_refused": tracked.refused,
                },
                tracking=tracked.counts,
                symmetric=self.symmetric,
                with_vsd=self.vsd,
            )
            latency_ms = tracked.latency_ms()
            if folder:
                extra = {"latency_ms": latency_ms, "environment": environment()}
                write_results(folder / "results.csv", tracked.estimates)
                write_scores(folder / "scores.json", scores, extra)
                title = f"Tracking {self.dataset}"
                report = make_report(title, dataset, scores, tracked.estimates, extra, tracked.records)
                write_html(folder / "report.html", report)
                write_markdown(folder / "report.md", report)
                (folder / "config.yaml").write_text(dump_config(config))
        who = f"backend {self.backend}" if kind.concepts else f"method {self.method}"
        for each in tables(scores, f"{self.dataset}, {self.views} views, {who}"):
            STDERR.print(each)
        if latency_ms:
            STDERR.print(f"an object and frame: median {latency_ms['median']:.1f} ms, p95 {latency_ms['p95']:.1f} ms")
        if self.out:
            STDERR.print(f"written to {self.out}")


@dataclass
class Score:
    """Score a BOP result file."""

    dataset: str
    """bop:PATH, ycb-video:PATH, nocs:PATH, ycbineoat:PATH or synthetic:NAME."""
    results: Path
    """The csv: scene_id,im_id,obj_id,score,R,t,time."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """File for the scores, for example scores.json; a page and a Markdown file of that name are written beside it."""
    scenes: tuple[int, ...] | None = None
    """Only these scenes."""
    objects: tuple[str, ...] | None = None
    """Only these objects."""
    symmetric: tuple[str, ...] | None = None
    """The objects whose ADD(-S) is ADD-S. Default: those that the dataset declares symmetric."""
    vsd: bool = False
    """Measure VSD too, and with it BOP's AR: reads the depth of every image with a target."""
    align: Literal["none", "reference"] = "none"
    """reference: the poses are of a tracker without a CAD model, in object frames of its own; each object and scene is
    aligned with the truth of one frame, which is not scored."""
    align_frame: Literal["first", "best-score"] = "first"
    """Which of the estimated targets that frame is."""
    score_align_frames: bool = False
    """Score the frames of the alignment too."""
    overwrite: bool = False
    """Replace the file if it exists."""

    def __call__(self) -> None:
        from eval.bop_results import read_results
        from eval.datasets import open_dataset
        from eval.html_report import write_html
        from eval.markdown_report import write_markdown
        from eval.report import environment, make_report, write_scores
        from eval.score import score_results_file
        from eval.score_tables import tables
        from tracker.errors import ConfigError
        from tracker.output import require_free

        if self.align == "none" and (self.score_align_frames or self.align_frame != "first"):
            raise ConfigError("--align-frame and --score-align-frames are of use with --align reference only")
        if self.out:
            for path in (self.out, self.out.with_suffix(".html"), self.out.with_suffix(".md")):
                require_free(path, self.overwrite)
        dataset = open_dataset(self.dataset)
        scores = score_results_file(
            dataset,
            self.results,
            scene_ids=self.scenes,
            object_ids=self.objects,
            symmetric=self.symmetric,
            with_vsd=self.vsd,
            align_on=None if self.align == "none" else self.align_frame,
            keep_alignment_frames=self.score_align_frames,
        )
        if self.out:
            self.out.parent.mkdir(parents=True, exist_ok=True)
            extra = {"environment": environment()}
            report = make_report(f"{self.results}", dataset, scores, read_results(self.results), extra)
            write_html(self.out.with_suffix(".html"), report)
            write_markdown(self.out.with_suffix(".md"), report)
            write_scores(self.out, scores, extra)
        for each in tables(scores, f"{self.results} on {self.dataset}"):
            STDERR.print(each)


@dataclass
class Bench:
    """Measure speed: of saliency and registration as ratios between ways of the same work in one run."""

    what: tyro.conf.OmitArgPrefixes[
        Annotated[SaliencyBench, tyro.conf.subcommand("saliency", prefix_name=False)]
        | Annotated[RegistrationBench, tyro.conf.subcommand("registration", prefix_name=False)]
        | Annotated[ScoringBench, tyro.conf.subcommand("scoring", prefix_name=False)]
    ]

    def __call__(self) -> None:
        self.what()


def main() -> None:
    run(
        tyro.extras.subcommand_cli_from_dict(
            {"track": Track, "score": Score, "pairs": Pairs, "bench": Bench},
            prog="python -m eval",
            args=sys.argv[1:],
        )
    )


if __name__ == "__main__":
    main()
