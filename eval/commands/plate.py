"""`python -m eval plate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from tracker.terminal import STDERR, progress

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from tracker.frame import Frame, Mask
    from tracker.result import TrackResult
    from tracker.saved_run import Replay

MODEL_PLATES = ("concepts", "views")


@dataclass
class Plate:
    """Make a picture for a paper or a bug report, of a concept model or of a run that python -m tracker --out saved."""

    kind: tyro.conf.Positional[Literal["concepts", "views", "matches", "failure"]]
    """concepts: what they saw in the reference views. views: the reference views, and where they are on the viewing
    sphere. matches: which points of a frame were taken for which of the model. failure: where an object was looked for
    in a frame, the poses that were tried, and why none was believed."""
    what: tyro.conf.Positional[Path]
    """A concept model (for concepts and views), or the --out folder of a run, which is done again up to the frame: its
    source and models have to be there still."""
    object: str | None = None
    """Which of the run's objects. Default: the first one that the plate can be made of."""
    frame: int | None = None
    """Which of the run's frames. Default: for failure, the first in which the object is lost; for matches, the first in
    which it is tracked and not a new find."""
    out: Path | None = None
    """PNG to write. Default: beside the model, or in the folder."""
    width: int = 1600
    """Pixels; concepts have a width of their own."""
    backend_weights: str | None = None
    """Weights of the backend that made the model (concepts): a size, a name on the hub, or a folder."""
    overwrite: bool = False
    """Replace the picture if it is there."""
    quiet: bool = False
    """No progress bar, and no word of where the picture is."""

    def __call__(self) -> None:
        from tracker.errors import ConfigError

        if self.width < 320:
            raise ConfigError(f"--width: expected at least 320 pixels, got {self.width}")
        path = self._of_model() if self.kind in MODEL_PLATES else self._of_run()
        if not self.quiet:
            STDERR.print(f"written to {path}", highlight=False, soft_wrap=True)

    def _of_model(self) -> Path:
        from reference.plate import write_concept_plate
        from reference.sheet import write_png
        from reference.view_plate import view_plate
        from tracker.concept import ConceptModel
        from tracker.output import require_free
        from tracker.saliency import BackendOptions, open_backend

        path = self.out or self.what.with_suffix(f".{self.kind}.png")
        require_free(path, self.overwrite)
        model = ConceptModel.load(self.what)
        if self.kind == "views":
            write_png(path, view_plate(model, self.width))
        else:
            backend = open_backend(model.backend, BackendOptions(self.backend_weights))
            model.require_backend(backend)
            write_concept_plate(path, model, backend)
        return path

    def _of_run(self) -> Path:
        from reference.sheet import write_png
        from tracker.errors import ConfigError
        from tracker.output import require_free
        from tracker.saved_run import Replay

        if self.out is not None:
            require_free(self.out, self.overwrite)
        replay = Replay(self.what)
        known = [model.object_id for model in replay.models]
        if self.object is not None and self.object not in known:
            raise ConfigError(f"--object {self.object}: the run has {', '.join(known)}")
        frame, result = self._wanted(replay)
        path = self.out or self.what / f"{self.kind}_{result.object_id}_{frame.index:06d}.png"
        require_free(path, self.overwrite)
        write_png(path, self._drawn(replay, frame, result))
        return path

    def _wanted(self, replay: Replay) -> tuple[Frame, TrackResult]:
        """Raises ConfigError where there is no such frame."""
        from tracker.errors import ConfigError
        from tracker.result import TrackState
        from tracker.sources import length_of

        ended, seen = -1, set()
        frames = iter(replay)
        for frame, results in frames if self.quiet else progress(frames, length_of(replay.source), "tracking again"):
            ended = frame.index
            for result in results:
                if self.object not in (None, result.object_id) or self.frame not in (None, frame.index):
                    continue
                lost = result.pose is None
                fits = lost if self.kind == "failure" else not lost
                if self.frame is None:
                    again = result.object_id in seen
                    fits = fits and (result.state is TrackState.LOST if self.kind == "failure" else again)
                if not lost:
                    seen.add(result.object_id)
                if fits:
                    return frame, result
                if self.frame is not None and self.object is not None:
                    break
            if self.frame is not None and frame.index >= self.frame:
                break
        what = "is lost" if self.kind == "failure" else "has a pose"
        where = f"in frame {self.frame}" if self.frame is not None else f"in any of the frames up to {ended}"
        raise ConfigError(f"{self.kind}: {self.object or 'no object'} {what} {where}" if not self.object else
                          f"{self.kind}: {self.object} {what} not {where}")  # fmt: skip

    def _drawn(self, replay: Replay, frame: Frame, result: TrackResult) -> npt.NDArray[np.uint8]:
        from eval.plates.failure import failure_plate
        from eval.plates.matches import match_plate
        from tracker.overlay import Shape

        model = next(model for model in replay.models if model.object_id == result.object_id)
        if result.pose is None:
            attempt = replay.tracker.attempt(result.object_id)
            return failure_plate(frame, result, attempt, Shape.of(model.points), replay.config, self.width)
        mask = _pixels(replay, result)
        return match_plate(frame, mask, result.pose, model, replay.backend, replay.config, self.width)


def _pixels(replay: Replay, result: TrackResult) -> Mask:
    """Those by which it was found: of the poses that were tried, the one that is told."""
    raw = result.raw_pose or result.pose
    tried = replay.tracker.attempt(result.object_id).tried
    return min(tried, key=lambda f: f.hypothesis.refined.T_cam_obj.distance_to_m(raw)).hypothesis.view.mask if raw else tried[0].hypothesis.view.mask
