"""`python -m reference SOURCE --object ID --out FILE`: make the concept model of an object."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.table import Table

from tracker.terminal import STDERR, run


@dataclass
class Reference:
    """Make a concept model from a few frames of a recording in which the object's pose is known."""

    source: tyro.conf.Positional[str]
    """bop:PATH:SCENE, folder:PATH or synthetic:NAME."""
    object: str
    """Which of the source's objects."""
    out: Path
    """File to write, for example mug.concept."""
    views: Annotated[int, tyro.conf.arg(metavar="K")] = 2
    """How many reference frames to pick from the recording."""
    backend: str = "attributes"
    """Which saliency backend finds the concepts."""
    config: Path | None = None
    """YAML file with settings that differ from the defaults (view and cloud are used here)."""
    overwrite: bool = False
    """Replace the file if it exists."""

    def __call__(self) -> None:
        from reference.onboard import onboard, read_reference_frames
        from tracker.config import read_config
        from tracker.errors import ConfigError
        from tracker.output import require_free
        from tracker.saliency import open_backend
        from tracker.sources import open_source

        if self.views < 1:
            raise ConfigError(f"--views: at least one reference frame is needed, got {self.views}")
        require_free(self.out, self.overwrite)
        config, backend = read_config(self.config), open_backend(self.backend)
        source = open_source(self.source)
        frames = read_reference_frames(source, self.object, self.views)
        model = onboard(frames, backend, config.view, config.cloud)
        model.save(self.out)
        quality = model.notes["quality"]
        table = Table("", "", title=f"{self.out}", show_header=False)
        table.add_row("object", model.object_id)
        table.add_row("backend", f"{model.backend}, {len(model.labels)} concepts")
        table.add_row("reference frames", "\n".join(model.notes["reference_frames"]))
        table.add_row("diameter seen", f"{model.diameter_m * 1000:.0f} mm")
        table.add_row("surface points", str(quality["points"]))
        table.add_row("viewing sphere", f"{quality['coverage']:.0%} within 60 degrees of a reference view")
        table.add_row("seen twice", f"{quality['shared']:.0%} of the points, agreeing to {quality['agreement']:.2f}")
        table.add_row("missing", "\n".join(quality["problems"]) or "nothing")
        STDERR.print(table)


def main() -> None:
    run(tyro.cli(Reference, prog="python -m reference", args=sys.argv[1:]))


if __name__ == "__main__":
    main()
