"""`python -m eval score`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from tracker.terminal import STDERR, hush, say_json


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
    json: bool = False
    """Write the scores, as in --out, to the standard output, as a line of JSON, and no tables."""
    quiet: bool = False
    """Nothing on the terminal but warnings and errors."""

    def __call__(self) -> None:
        from eval.bop_results import read_results
        from eval.datasets import open_dataset
        from eval.environment import environment
        from eval.html_report import write_html
        from eval.markdown_report import write_markdown
        from eval.report import make_report, write_scores
        from eval.score import score_results_file
        from eval.score_tables import tables
        from tracker.errors import ConfigError
        from tracker.output import require_free

        hush(self.quiet or self.json)
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
        if self.json:
            say_json({**scores.as_json(), "environment": environment()})
        if self.out:
            self.out.parent.mkdir(parents=True, exist_ok=True)
            extra = {"environment": environment()}
            report = make_report(f"{self.results}", dataset, scores, read_results(self.results), extra)
            write_html(self.out.with_suffix(".html"), report)
            write_markdown(self.out.with_suffix(".md"), report)
            write_scores(self.out, scores, extra)
        for each in tables(scores, f"{self.results} on {self.dataset}"):
            STDERR.print(each)
