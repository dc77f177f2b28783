"""`python -m eval track`."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from tracker.terminal import STDERR, hush, progress, say_json

if TYPE_CHECKING:
    from eval.kept_units import KeptUnits
    from eval.track_run import TrackRun
    from eval.units import Unit


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
    concepts: int | None = None
    """Only the first so many of them. Default: all."""
    views: int = 2
    """Reference frames an object and scene; they are not scored."""
    unposed: bool = False
    """Make models without the poses of their reference frames, but the first one's, which sets the object frame. They
    are spread over the scene; without it, they are picked by their poses."""
    complete: bool = False
    """Let models grow while their objects are tracked, by frames of sides that they do not know and of whose poses the
    tracker is sure."""
    masks: Literal["visib", "full", "carried"] = "visib"
    """Where the object's pixels come from: the dataset's masks of what can be seen; those of the whole silhouette, also
    where something hides it (BOP's mask/); or its first visible one alone, which the tracker carries on by itself."""
    prior: Literal["on", "off"] | None = None
    """Start each frame from the predicted pose, or search every frame anew. Default: as the config says (on)."""
    poses: Literal["filtered", "raw"] = "filtered"
    """Which poses are scored: after the filter, or of each frame alone."""
    smooth: Literal["off", "offline"] = "off"
    """offline: score, and write, filtered poses that are smoothed over each scene, every one by all of its frames."""
    symmetric: tuple[str, ...] | None = None
    """The objects whose ADD(-S) is ADD-S. Default: those that the dataset declares symmetric."""
    vsd: bool = False
    """Measure VSD too, and with it BOP's AR: reads the depth of every image with a target once more."""
    config: Path | None = None
    """YAML file with settings that differ from the defaults."""
    out: Path | None = None
    """Folder for scores.json, results.csv, report.html, report.md, config.yaml and what --view makes."""
    view: Annotated[tuple[Literal["overlay", "frames", "rrd"], ...], tyro.conf.UseAppendAction] = ()
    """overlay: write overlay.mp4 to the --out folder (one for each of several scenes), estimates orange, truth green;
    H.264 where the program ffmpeg is installed. frames: write a PNG a frame to its folder frames. rrd: write run.rrd
    there, all that was seen and said, for Rerun (extra rerun). Once for each."""
    overwrite: bool = False
    """Replace results that are in the --out folder, and forget a run that did not end."""
    resume: bool = False
    """Go on with a run that did not end, from the scenes that it finished (they are in DIR.units beside the --out
    folder). Scenes of other settings, code or libraries are tracked again."""
    jobs: int = 1
    """Processes that track scenes side by side; -1 is one a core. Times in the results grow where they share cores."""
    cluster: str | None = None
    """Track on a cluster that is there: dask://HOST:PORT (extra cluster) or ray://HOST:PORT (extra ray). Its workers
    need the same code and packages, and the dataset under the same path; one thread a worker."""
    threads: int = 1
    """Threads of torch in each process: more make a vision-language backend without a GPU faster."""
    json: bool = False
    """Write the scores, as in scores.json, to the standard output, as a line of JSON, and no tables."""
    quiet: bool = False
    """Nothing on the terminal but warnings and errors."""

    def __call__(self) -> None:
        from contextlib import ExitStack

        from eval.bop_results import write_results
        from eval.environment import environment
        from eval.html_report import write_html
        from eval.markdown_report import write_markdown
        from eval.peers import method_kind
        from eval.report import make_report, write_scores
        from eval.score import score
        from eval.score_tables import tables
        from eval.spread import Spreading
        from eval.track_run import opened_dataset
        from eval.tracked import Tracked
        from eval.units import track_units, units_of
        from tracker.config import dump_config
        from tracker.errors import ConfigError
        from tracker.output import require_free, result_folder

        hush(self.quiet or self.json)
        if self.view and self.out is None:
            raise ConfigError(f"--view {self.view[0]} needs a folder to write to: give --out DIR")
        if self.view and self.cluster is not None:
            raise ConfigError(
                f"--view {self.view[0]} writes where the frames are tracked: it goes with --jobs, not --cluster"
            )
        if self.resume and self.out is None:
            raise ConfigError("--resume goes on with what is beside a folder: give --out DIR")
        spreading, run = Spreading(self.jobs, self.cluster), self._run()
        dataset = opened_dataset(self.dataset)
        scene_ids = tuple(dataset.scene_ids if self.scenes is None else self.scenes)
        units, stated = units_of(run, scene_ids, self.view)
        if self.out:
            require_free(self.out, self.overwrite)
        with ExitStack() as stack:
            kept = stack.enter_context(self._kept(units))
            outcomes = track_units(units, kept, spreading, progress, progress)
            tracked = Tracked.joined(outcome for outcome in outcomes if isinstance(outcome, Tracked))
            scores = score(
                dataset,
                tracked.estimates,
                scene_ids=scene_ids,
                object_ids=self.objects,
                exclude=tracked.reference_frames,
                protocol={**stated, "models_refused": tracked.refused},
                tracking=tracked.counts,
                symmetric=self.symmetric,
                with_vsd=self.vsd,
            )
            latency_ms = tracked.latency_ms()
            if self.json:
                say_json({**scores.as_json(), "latency_ms": latency_ms, "environment": environment()})
            if self.out:
                folder = stack.enter_context(result_folder(self.out, self.overwrite))
                extra = {"latency_ms": latency_ms, "environment": environment()}
                write_results(folder / "results.csv", tracked.estimates)
                write_scores(folder / "scores.json", scores, extra)
                title = f"Tracking {self.dataset}"
                report = make_report(title, dataset, scores, tracked.estimates, extra, tracked.records)
                write_html(folder / "report.html", report)
                write_markdown(folder / "report.md", report)
                (folder / "config.yaml").write_text(dump_config(run.config))
                _take_pictures(kept, units, folder)
        who = f"backend {self.backend}" if method_kind(self.method).concepts else f"method {self.method}"
        for each in tables(scores, f"{self.dataset}, {self.views} views, {who}"):
            STDERR.print(each)
        if latency_ms:
            STDERR.print(f"an object and frame: median {latency_ms['median']:.1f} ms, p95 {latency_ms['p95']:.1f} ms")
        if self.out:
            STDERR.print(f"written to {self.out}")

    def _run(self) -> TrackRun:
        from eval.track_run import TrackRun
        from reference.vocabulary import read_vocabulary
        from tracker.config import read_config

        config = read_config(self.config)
        if self.prior is not None:
            config = config.model_copy(update={"prior": self.prior == "on"})
        return TrackRun(
            dataset=self.dataset,
            config=config,
            backend=self.backend,
            weights=self.weights,
            device=self.device,
            vocabulary=self.vocabulary,
            vocabularies=read_vocabulary(self.vocabulary) if self.vocabulary else None,
            concepts=self.concepts,
            method=self.method,
            initialisation=self.init,
            views=self.views,
            masks=self.masks,
            poses=self.poses,
            smooth=self.smooth,
            unposed=self.unposed,
            complete=self.complete,
            object_ids=self.objects,
            threads=self.threads,
        )

    @contextmanager
    def _kept(self, units: Sequence[Unit]) -> Iterator[KeptUnits | None]:
        """Where finished scenes are until the results are written, which are whole or absent; None without --out.

        Raises OutputError where there are some already and nobody says what to do with them."""
        from eval.kept_units import KeptUnits
        from tracker.errors import OutputError

        if self.out is None:
            yield None
            return
        out = self.out.resolve()
        kept = KeptUnits(out.with_name(f"{out.name}.units"))
        if self.overwrite and not self.resume:
            shutil.rmtree(kept.folder, ignore_errors=True)
        before = set(kept.names())
        if before and not self.resume:
            raise OutputError(
                f"{kept.folder} holds {len(before)} finished scenes of a run that did not end: go on with --resume, "
                "or forget them with --overwrite"
            )
        if self.resume:
            used = len(before & {unit.fingerprint for unit in units})
            STDERR.print(f"{used} of {len(units)} scenes are finished already", highlight=False)
            if others := len(before) - used:
                STDERR.print(f"{others} more were tracked in another way, and are not used", highlight=False)
        yield kept
        shutil.rmtree(kept.folder, ignore_errors=True)


def _take_pictures(kept: KeptUnits | None, units: Sequence[Unit], folder: Path) -> None:
    """Move what was drawn of the scenes to the results."""
    if kept is None:
        return
    for unit in units:
        for drawn in kept.drawn(unit.fingerprint):
            name = drawn.name if len(units) == 1 else f"{drawn.stem}_{unit.scene_id:06d}{drawn.suffix}"
            shutil.move(drawn, folder / name)
