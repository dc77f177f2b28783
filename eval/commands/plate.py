"""`python -m eval plate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from tracker.terminal import STDERR, hush, progress

if TYPE_CHECKING:
    from reference.sheet import Picture
    from tracker.found import Attempt
    from tracker.frame import Frame, Mask
    from tracker.geometry import Pose
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
        hush(self.quiet)
        path = self._of_model() if self.kind in MODEL_PLATES else self._of_run()
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
        from tracker.sources import length_of

        seen: set[str] = set()
        frames = iter(replay)
        for frame, results in progress(frames, length_of(replay.source), "tracking again"):
            for result in results:
                asked = self.object in (None, result.object_id) and self.frame in (None, frame.index)
                if asked and self._fits(result, result.object_id in seen):
                    return frame, result
                if result.pose is not None:
                    seen.add(result.object_id)
            if frame.index == self.frame:
                break
        state = "lost" if self.kind == "failure" else "tracked"
        where = "no frame" if self.frame is None else f"frame {self.frame} not"
        raise ConfigError(f"{self.kind} shows {self.object or 'an object'} where it is {state}: in {where}")

    def _fits(self, result: TrackResult, seen_before: bool) -> bool:
        from tracker.result import TrackState

        if self.kind == "failure":
            return result.pose is None and (self.frame is not None or result.state is TrackState.LOST)
        return result.pose is not None and (self.frame is not None or seen_before)

    def _drawn(self, replay: Replay, frame: Frame, result: TrackResult) -> Picture:
        from eval.plates.failure import failure_plate
        from eval.plates.matches import match_plate
        from tracker.overlay import Shape

        model = next(model for model in replay.models if model.object_id == result.object_id)
        if result.pose is None:
            attempt = replay.tracker.attempt(result.object_id)
            return failure_plate(frame, result, attempt, Shape.of(model.points), replay.config, self.width)
        attempt = replay.tracker.attempt(result.object_id)
        return match_plate(
            frame, _pixels(attempt, result.pose), result.pose, model, replay.backend, replay.config, self.width
        )


def _pixels(attempt: Attempt, T_cam_obj: Pose) -> Mask:
    """Those by which the pose was found: of the tried ones, the nearest."""
    nearest = min(attempt.tried, key=lambda found: found.hypothesis.refined.T_cam_obj.distance_to_m(T_cam_obj))
    return nearest.hypothesis.view.mask
