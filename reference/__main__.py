"""`python -m reference SOURCE --object ID --out FILE`: make the concept model of an object."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.table import Table

from tracker.terminal import STDERR, hush, run, say_json

if TYPE_CHECKING:
    from tracker.concept import ConceptModel
    from tracker.config import TrackerConfig
    from tracker.frame import Frame, Mask
    from tracker.saliency import SaliencyBackend
    from tracker.sources import FrameSource
    from tracker.symmetry import Symmetry


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


@dataclass
class Reference:
    """Make a concept model from a few frames of a recording in which the object's pose is known, or --unposed."""

    source: tyro.conf.Positional[str]
    """bop:PATH:SCENE, folder:PATH or synthetic:NAME."""
    object: str
    """Which of the source's objects."""
    out: Path
    """File to write, for example mug.concept."""
    views: Annotated[int, tyro.conf.arg(metavar="K")] = 2
    """How many reference frames to pick from the recording."""
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
        if self.views < 1:
            raise ConfigError(f"--views: at least one reference frame is needed, got {self.views}")
        if not 0 <= self.least_confidence <= 1:
            raise ConfigError(f"--least-confidence: expected a number from 0 to 1, got {self.least_confidence:g}")
        if self.vocabulary is not None and self.ask.category is not None:
            raise ConfigError("--vocabulary and --ask.category both name concepts: give one of them")
        plates = {show: self.out.with_suffix(f".{show}.png") for show in self.show}
        for path in (self.out, *plates.values()):
            require_free(path, self.overwrite)
        config, symmetry = read_config(self.config), self._symmetry()
        labels = read_vocabulary(self.vocabulary).for_object(self.object).labels if self.vocabulary else None
        backend = open_backend(self.backend, BackendOptions(self.weights, self.device))
        source = open_source(self.source)
        make = self._unposed if self.unposed else self._posed
        model = make(source, backend, config, labels, symmetry)
        model.save(self.out)
        if "concepts" in plates:
            write_concept_plate(plates["concepts"], model, backend)
        if "views" in plates:
            write_png(plates["views"], view_plate(model))
        STDERR.print(_verdict(model, self.out))
        if self.json:
            say_json(_facts(model, self.out))

    def _posed(
        self,
        source: FrameSource,
        backend: SaliencyBackend,
        config: TrackerConfig,
        labels: tuple[str, ...] | None,
        symmetry: Symmetry | None,
    ) -> ConceptModel:
        from reference.onboard import onboard, read_reference_frames

        frames = read_reference_frames(source, self.object, self.views)
        labels = labels or self.ask.labels(frames[0].frame, frames[0].mask)
        return onboard(frames, backend, config.view, config.cloud, labels, symmetry)

    def _unposed(
        self,
        source: FrameSource,
        backend: SaliencyBackend,
        config: TrackerConfig,
        labels: tuple[str, ...] | None,
        symmetry: Symmetry | None,
    ) -> ConceptModel:
        from reference.unposed import onboard_unposed, read_unposed_frames

        frames = read_unposed_frames(source, self.object, self.views)
        labels = labels or self.ask.labels(*frames[0])
        sure = self.least_confidence
        return onboard_unposed(frames, self.object, backend, config, labels, symmetry, least_confidence=sure)

    def _symmetry(self) -> Symmetry | None:
        from tracker.declared_symmetry import parse_symmetry
        from tracker.errors import ConfigError

        if self.unposed and self.symmetry not in ("auto", "none"):
            raise ConfigError(
                f"--symmetry {self.symmetry} is about the object's own axes, which nobody knows with --unposed: "
                "expected auto or none"
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


def _verdict(model: ConceptModel, path: Path) -> Table:
    quality = model.notes["quality"]
    table = Table("", "", title=f"{path}", show_header=False)
    table.add_row("object", model.object_id)
    table.add_row("backend", f"{model.backend}, {len(model.labels)} concepts")
    table.add_row("reference frames", "\n".join(model.notes["reference_frames"]))
    if "object_frame" in model.notes:
        table.add_row("left out", "\n".join(model.notes["left_out"]) or "nothing")
        table.add_row("object frame", model.notes["object_frame"])
    table.add_row("diameter seen", f"{model.diameter_m * 1000:.0f} mm")
    table.add_row("surface points", str(quality["points"]))
    table.add_row("viewing sphere", f"{quality['coverage']:.0%} within 60 degrees of a reference view")
    table.add_row("seen twice", f"{quality['shared']:.0%} of the points, agreeing to {quality['agreement']:.2f}")
    table.add_row("symmetry", str(model.symmetry))
    table.add_row("missing", "\n".join(quality["problems"]) or "nothing")
    return table


def main() -> None:
    run(tyro.cli(Reference, prog="python -m reference", args=sys.argv[1:]))


if __name__ == "__main__":
    main()
