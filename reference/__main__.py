"""`python -m reference SOURCE --object ID --out FILE`: make the concept model of an object."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.table import Table

from tracker.terminal import STDERR, hush, run, say_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from reference.live import Progress
    from tracker.concept import ConceptModel
    from tracker.config import TrackerConfig
    from tracker.frame import Frame, Mask
    from tracker.saliency import SaliencyBackend
    from tracker.sources import FrameSource
    from tracker.symmetry import Symmetry


VIEWS = 2  # of a recording


@dataclass
class Ask:
    """Ask a language model for the concepts, at any endpoint that speaks OpenAI's protocol (extra llm)."""

    category: str | None = None
    """What the object is, for example "mug". Answers are kept and can be edited."""
    kind: Literal["default", "geometric", "affordance", "adjective"] = "default"
    """The paper's four prompts; all but the first send the first reference view along."""
    concepts: int = 20
    """How many concepts to ask for."""
    url: str | None = None
    """Base URL of the endpoint. Default: OPENAI_BASE_URL."""
    model: str | None = None
    """Name of the model there. Default: CONCEPTRACK_LLM_MODEL. The key is read from OPENAI_API_KEY."""

    def labels(self, frame: Frame, mask: Mask) -> tuple[str, ...] | None:
        from reference.llm import endpoint_from
        from reference.vocabulary_cache import cached_vocabulary
        from tracker.view import bounding_box

        if self.category is None:
            return None
        endpoint = endpoint_from({"base_url": self.url, "model": self.model}, os.environ)
        box, picture = bounding_box(mask), None
        if self.kind != "default" and box is not None:
            picture = frame.rgb[box.y0 : box.y1, box.x0 : box.x1]
        return cached_vocabulary(self.category, self.kind, self.concepts, endpoint, picture).labels


@dataclass(frozen=True, slots=True)
class _Means:
    """What a model is made by, whichever way. labels, symmetry: None where they are still to be found."""

    backend: SaliencyBackend
    config: TrackerConfig
    labels: tuple[str, ...] | None
    symmetry: Symmetry | None


@dataclass
class Reference:
    """Make a concept model from a few frames of a recording in which the object's pose is known, or --unposed, or from
    a camera before which the object is turned."""

    source: tyro.conf.Positional[str]
    """bop:PATH:SCENE, folder:PATH or synthetic:NAME; or one that knows no objects, as realsense or rosbag:PATH: then
    the object is turned before the camera, or the camera goes around it, until enough of it is known or at ctrl-C."""
    object: str
    """Which of the source's objects."""
    out: Path
    """File to write, for example mug.concept."""
    views: Annotated[int | None, tyro.conf.arg(metavar="K")] = None
    """How many reference frames to pick from the recording, by default 2; of an object that is turned, how many at
    most, by default 12."""
    at: Annotated[str | None, tyro.conf.arg(metavar="X,Y[,X1,Y1]|nearest")] = None
    """Of an object that is turned: where it is in the first frame, by a pixel on it, a box around it, or as the nearest
    thing on the table, which is what a source without masks does by default. Masks and poses are not looked at then."""
    coverage: float = 0.6
    """Of an object that is turned: which share of the viewing sphere, within 60 degrees of a view, is enough."""
    unposed: bool = False
    """No poses are needed, and none are read: the tracker finds how the reference frames belong together. They are
    spread over the recording, and have to show enough of the same side; those that cannot be joined are named."""
    least_confidence: float = 0.98
    """With --unposed: from which confidence a frame joins the others."""
    backend: str = "attributes"
    """Which saliency backend finds the concepts; "siglip2+attributes" joins two."""
    weights: str | None = None
    """Weights of the backend: a size, a name on the hub, or a folder."""
    device: str = "auto"
    """Where the backend runs; auto is CUDA where there is one."""
    vocabulary: str | None = None
    """Concepts to look for: a set that comes along (general, ycbv, real275, linemod, toyota-light) or a YAML file.
    Default: the backend's own."""
    symmetry: str = "auto"
    """Turns after which the object looks the same: auto detects them, none, or declared ones such as z:inf (any angle
    about its z axis), x:180, z:90, several joined by commas."""
    ask: Ask = field(default_factory=Ask)
    show: Annotated[tuple[Literal["concepts", "views"], ...], tyro.conf.UseAppendAction] = ()
    """Write pictures beside the model (mug.concept -> mug.concepts.png, mug.views.png). concepts: their maps in every
    reference view. views: the reference views, and where on the viewing sphere they are. Once for each."""
    config: Path | None = None
    """YAML file with settings that differ from the defaults (view and cloud are used here)."""
    overwrite: bool = False
    """Replace the file if it exists."""
    json: bool = False
    """Write what the model is to the standard output, as a line of JSON, and no tables."""
    quiet: bool = False
    """Nothing on the terminal but warnings and errors."""

    def __call__(self) -> None:
        from reference.plate import write_concept_plate
        from reference.sheet import write_png
        from reference.view_plate import view_plate
        from reference.vocabulary import read_vocabulary
        from tracker.config import read_config
        from tracker.errors import ConfigError
        from tracker.output import require_free
        from tracker.saliency import BackendOptions, open_backend
        from tracker.sources import open_source

        hush(self.quiet or self.json)
        if self.views is not None and self.views < 1:
            raise ConfigError(f"--views: at least one reference frame is needed, got {self.views}")
        if not 0 <= self.least_confidence <= 1:
            raise ConfigError(f"--least-confidence: expected a number from 0 to 1, got {self.least_confidence:g}")
        if not 0 <= self.coverage <= 1:
            raise ConfigError(f"--coverage: expected a number from 0 to 1, got {self.coverage:g}")
        if self.unposed and self.at is not None:
            raise ConfigError("--unposed takes the source's masks, --at does without them: give one of the two")
        if self.vocabulary is not None and self.ask.category is not None:
            raise ConfigError("--vocabulary and --ask.category both name concepts: give one of them")
        plates = {show: self.out.with_suffix(f".{show}.png") for show in self.show}
        for path in (self.out, *plates.values()):
            require_free(path, self.overwrite)
        config, symmetry = read_config(self.config), self._symmetry()
        labels = read_vocabulary(self.vocabulary).for_object(self.object).labels if self.vocabulary else None
        backend = open_backend(self.backend, BackendOptions(self.weights, self.device))
        make = self._turned if self._is_turned else self._unposed if self.unposed else self._posed
        model = make(open_source(self.source), _Means(backend, config, labels, symmetry))
        model.save(self.out)
        if "concepts" in plates:
            write_concept_plate(plates["concepts"], model, backend)
        if "views" in plates:
            write_png(plates["views"], view_plate(model))
        STDERR.print(_verdict(model, self.out))
        if self.json:
            say_json(_facts(model, self.out))

    def _posed(self, source: FrameSource, by: _Means) -> ConceptModel:
        from reference.onboard import onboard, read_reference_frames

        frames = read_reference_frames(source, self.object, self.views or VIEWS)
        labels = by.labels or self.ask.labels(frames[0].frame, frames[0].mask)
        return onboard(frames, by.backend, by.config.view, by.config.cloud, labels, by.symmetry)

    def _unposed(self, source: FrameSource, by: _Means) -> ConceptModel:
        from reference.unposed import onboard_unposed, read_unposed_frames

        frames = read_unposed_frames(source, self.object, self.views or VIEWS)
        labels, sure = by.labels or self.ask.labels(*frames[0]), self.least_confidence
        return onboard_unposed(frames, self.object, by.backend, by.config, labels, by.symmetry, least_confidence=sure)

    def _turned(self, source: FrameSource, by: _Means) -> ConceptModel:
        from contextlib import ExitStack

        from reference.completion import MOST_VIEWS
        from reference.live import TurnedObject, first_sight
        from reference.onboard import warn_of_problems
        from tracker.errors import TrackerError
        from tracker.in_order import InOrder
        from tracker.latest import Latest
        from tracker.pointing import parse_pointer
        from tracker.sources import LiveSource

        there = None if self.at in (None, "nearest") else parse_pointer(self.at)
        live, views = isinstance(source, LiveSource), self.views or MOST_VIEWS
        with ExitStack() as stack:
            coming = stack.enter_context(Latest(source)) if isinstance(source, LiveSource) else source
            frames = iter(InOrder(coming, live=live))
            frame, mask = first_sight(frames, there)
            labels, enough = by.labels or self.ask.labels(frame, mask), (views, self.coverage)
            turned = TurnedObject(frame, mask, self.object, by.backend, by.config, labels, by.symmetry, *enough)
            show = stack.enter_context(_sphere_bar(self.object, self.coverage))
            try:
                show(turned.progress)
                while not turned.progress.enough and (frame := next(frames, None)) is not None:
                    show(turned.see(frame))
            except KeyboardInterrupt:
                STDERR.print("stopped; what is known of the object by now is kept")
            except TrackerError as error:  # a camera that goes away does not cost what it has shown
                STDERR.print(f"{error}; what is known of the object by now is kept", markup=False)
        warn_of_problems(turned.model)
        return turned.model

    @property
    def _is_turned(self) -> bool:
        from tracker.sources import WITHOUT_MASKS, kind_of

        return self.at is not None or (kind_of(self.source) in WITHOUT_MASKS and not self.unposed)

    def _symmetry(self) -> Symmetry | None:
        from tracker.declared_symmetry import parse_symmetry
        from tracker.errors import ConfigError

        if (self.unposed or self._is_turned) and self.symmetry not in ("auto", "none"):
            raise ConfigError(
                f"--symmetry {self.symmetry} is about the object's own axes, which nobody knows "
                f"{'with --unposed' if self.unposed else 'of an object that is turned'}: expected auto or none"
            )
        return None if self.symmetry == "auto" else parse_symmetry(self.symmetry)


def _facts(model: ConceptModel, path: Path) -> dict[str, object]:
    """What the verdict says, for other programs."""
    return {
        "model": str(path),
        "object": model.object_id,
        "backend": model.backend,
        "labels": list(model.labels),
        "diameter_m": model.diameter_m,
        "symmetry": str(model.symmetry),
        "notes": model.notes,
    }


@contextmanager
def _sphere_bar(name: str, coverage: float) -> Iterator[Callable[[Progress], None]]:
    """Shows how much of the viewing sphere is known, as a bar on a terminal, else in a line for each new view."""
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    hidden = not STDERR.is_terminal
    text = TextColumn("{task.percentage:.0f} % of the way to {task.fields[wanted]}; {task.fields[said]}")
    with Bar(
        TextColumn(name), BarColumn(), text, console=STDERR, transient=True, disable=not STDERR.is_terminal
    ) as bar:
        task = bar.add_task("", total=max(coverage, 1e-9), wanted=f"{coverage:.0%} of the viewing sphere", said="")

        def show(now: Progress) -> None:
            state = now.result.state.value if now.result.pose else f"{now.result.state.value}: {now.result.reason}"
            said = f"{now.views} views, {state}"
            bar.update(task, completed=now.coverage, said=said)
            if now.grown and hidden:
                STDERR.print(f"{now.views} views, {now.coverage:.0%} of the viewing sphere")

        yield show


def _verdict(model: ConceptModel, path: Path) -> Table:
    quality = model.notes["quality"]
    table = Table("", "", title=f"{path}", show_header=False)
    table.add_row("object", model.object_id)
    table.add_row("backend", f"{model.backend}, {len(model.labels)} concepts")
    table.add_row("reference frames", "\n".join(model.notes["reference_frames"]))
    if "came_about" in model.notes:
        table.add_row("came about", model.notes["came_about"])
    if "object_frame" in model.notes:
        table.add_row("left out", "\n".join(model.notes["left_out"]) or "nothing")
        table.add_row("object frame", model.notes["object_frame"])
    table.add_row("diameter seen", f"{model.diameter_m * 1000:.0f} mm")
    table.add_row("surface points", str(quality["points"]))
    table.add_row("viewing sphere", f"{quality['coverage']:.0%} within 60 degrees of a reference view")
    if len(model.view_directions) > 1:
        table.add_row("seen twice", f"{quality['shared']:.0%} of the points, agreeing to {quality['agreement']:.2f}")
    table.add_row("symmetry", str(model.symmetry))
    table.add_row("missing", "\n".join(quality["problems"]) or "nothing")
    return table


def main() -> None:
    run(tyro.cli(Reference, prog="python -m reference", args=sys.argv[1:]))


if __name__ == "__main__":
    main()
