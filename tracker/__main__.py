"""`python -m tracker SOURCE --model FILE`: track objects through a source of frames."""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from tracker.terminal import STDERR, hush, progress, run

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tracker.concept import ConceptModel
    from tracker.config import TrackerConfig
    from tracker.output import PoseOutput
    from tracker.pipeline import ObjectTracker
    from tracker.region import Region
    from tracker.remote_control import RemoteControl
    from tracker.sources import FrameSource
    from tracker.viewer import Viewer
    from tracker.web.server import WebPage


@dataclass
class Track:
    """Track objects through frames, and say at every frame where they are, or that they are lost."""

    source: tyro.conf.Positional[str]
    """bop:PATH:SCENE, folder:PATH, rosbag:PATH, synthetic:NAME, realsense, realsense:SERIAL or realsense:FILE.db3; the
    README has them all."""
    model: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE"), tyro.conf.UseAppendAction]
    """Concept model that python -m reference made; once for every object. Of two of a kind, the same file twice: the
    second one is called NAME_2."""
    out: Path | None = None
    """Folder for poses.jsonl (a line a frame and object), config.yaml, run.json (what else it takes to do this again,
    as python -m eval plate does) and what --view and --write make."""
    write: tuple[Literal["ob-in-cam", "tum", "bop"], ...] = ()
    """Poses in these formats too: ob-in-cam (FoundationPose: ob_in_cam/NAME.txt, a 4x4 matrix a frame; a folder an
    object where there are several), tum (tum/OBJECT.txt, a trajectory for evo), bop (results.csv)."""
    weights: str | None = None
    """Weights of the backend that made the models: a size, a name on the hub, or a folder."""
    device: str = "auto"
    """Where the backend runs; auto is CUDA where there is one."""
    locate: Annotated[tuple[str, ...], tyro.conf.arg(metavar="CONCEPT"), tyro.conf.UseAppendAction] = ()
    """Say in every line where this concept of the object is; once for every concept."""
    masks: Literal["given", "carried"] | None = None
    """Where the object's pixels come from: given by the source in every frame, or carried on by the tracker from the
    first that is given; where none is, it looks for the object in the whole picture. Default: as the config says
    (given); carried where the source has no masks."""
    at: Annotated[tuple[str, ...], tyro.conf.arg(metavar="[NAME=]X,Y[,X1,Y1]"), tyro.conf.UseAppendAction] = ()
    """Where an object is in the first frame: a pixel on it, or a box around it. NAME may be left out where there is one
    object. With --masks carried, in place of a mask."""
    concepts: Literal["now", "later"] = "now"
    """later: a worker finds the concepts while the tracker goes on without them, so that a slow backend does not hold
    up the frames. What it comes to depends on how fast that is."""
    prior: Literal["on", "off"] | None = None
    """Start each frame from the predicted pose, or search every frame anew. Default: as the config says (on)."""
    config: Path | None = None
    """YAML file with settings that differ from the defaults."""
    smooth: Literal["off", "offline"] = "off"
    """offline: every pose by all frames of the recording, also those after it; the lines are written at the end."""
    view: Annotated[tuple[Literal["overlay", "frames", "rerun"], ...], tyro.conf.UseAppendAction] = ()
    """overlay: write overlay.mp4 to the --out folder, with the poses as they were found, not smoothed; H.264 where the
    program ffmpeg is installed. frames: write a PNG a frame to its folder frames. rerun: open a window of
    Rerun's (extra rerun) with all that is seen and said. Once for each."""
    rrd: Path | None = None
    """Write what --view rerun shows to this file (.rrd), to be opened anywhere (extra rerun)."""
    serve: Annotated[str | None, tyro.conf.arg(metavar="[HOST:]PORT")] = None
    """Show all of it live on a page at http://HOST:PORT (this machine alone where there is no HOST); objects can be
    pointed out there, and the last 30 s saved. Other machines need the token that is printed, or CONCEPTRACK_TOKEN."""
    record: Path | None = None
    """Write what the camera sees to this file (.db3) while it is tracked."""
    overwrite: bool = False
    """Replace results that are in the --out folder, and the --record and --rrd files."""
    json: bool = False
    """Write the lines of poses.jsonl to the standard output as they come."""
    quiet: bool = False
    """No progress bar and no table."""

    def __call__(self) -> None:
        from concurrent.futures import ThreadPoolExecutor

        from tracker.concept import ConceptModel, told_apart
        from tracker.config import dump_config
        from tracker.errors import ConfigError
        from tracker.first_masks import FirstMasks
        from tracker.frame_by_frame import FrameByFrame
        from tracker.in_order import InOrder
        from tracker.latest import Latest
        from tracker.output import result_folder
        from tracker.pipeline import ObjectTracker
        from tracker.pointing import parse_pointers
        from tracker.remote_control import RemoteControl
        from tracker.saliency import BackendOptions, open_backend
        from tracker.saved_run import SavedRun
        from tracker.sources import LiveSource, length_of
        from tracker.summary import Summary, tell_left_out
        from tracker.viewer import Several

        hush(self.quiet or self.json)
        config = self._config()
        if not self.model:
            raise ConfigError("--model: at least one concept model is needed; python -m reference makes one")
        models = told_apart([ConceptModel.load(path) for path in self.model])
        backend = open_backend(models[0].backend, BackendOptions(self.weights, self.device))
        regions = {model.object_id: {c: model.locate(c, backend) for c in self.locate} for model in models}
        source = self._opened_source()
        live = Latest(source) if isinstance(source, LiveSource) else None
        pointed_out = parse_pointers(self.at, [model.object_id for model in models])
        summary = Summary()
        with ExitStack() as stack:
            worker = stack.enter_context(ThreadPoolExecutor(1)) if self.concepts == "later" else None
            tracker = ObjectTracker(models, config, backend, worker)
            for object_id, there in pointed_out.items():
                tracker.point_out(object_id, there)
            remote = RemoteControl()
            page = self._page(tracker, models, config, remote)
            if page:
                stack.callback(page.close)  # also where nothing comes to be shown
            folder = stack.enter_context(result_folder(self.out, self.overwrite)) if self.out else None
            drawn = self._viewer(folder, models)
            viewer = Several([page, drawn]) if page else drawn
            stack.callback(viewer.close)
            if folder:
                (folder / "config.yaml").write_text(dump_config(config))
                SavedRun(self.source, tuple(map(str, self.model)), self.weights, self.device, self.at).save(folder)
            coming = stack.enter_context(live) if live else source
            shown = progress(coming, length_of(source), "tracking", summary.now)
            frames = InOrder(shown, live=live is not None)
            outputs = self._outputs(stack, folder, source, models, regions)
            masks = FirstMasks(pointed_out) if config.masks == "carried" else None
            latency_ms = live.latency_ms if live else None
            follow = FrameByFrame(tracker, masks, viewer, outputs, remote, summary, latency_ms, page)
            failure = follow(frames, kept=bool(folder or self.record or self.rrd))
        tell_left_out(frames.refused, live.left_out if live else {}, tracker.frames_without_concepts)
        if failure:
            raise failure
        STDERR.print(summary.table("its stamp" if live and live.stamped else "its arrival"))

    def _outputs(
        self,
        stack: ExitStack,
        folder: Path | None,
        source: FrameSource,
        models: Sequence[ConceptModel],
        regions: Mapping[str, Mapping[str, Region | None]],
    ) -> list[PoseOutput]:
        """Where results go, as files of the stack where they are ones. Raises OutputError."""
        from tracker.output import PoseLines, PoseOutput
        from tracker.pose_files import open_pose_files
        from tracker.ros_results import PosePublisher
        from tracker.sources import RosSource

        texts = [sys.stdout] if self.json else []
        if folder:
            texts.append(stack.enter_context((folder / "poses.jsonl").open("w")))
        files = open_pose_files(self.write, folder, list(regions)) if folder else []
        located = [object_id for object_id, concepts in regions.items() if concepts]
        outputs = [PoseOutput([PoseLines(texts, regions), *files], self.smooth, located)]
        if isinstance(source, RosSource):
            publisher = PosePublisher(source.ros, source.node, models, lambda: source.frame_id)
            outputs.append(PoseOutput([publisher]))  # what is live is never smoothed
        return outputs

    def _viewer(self, folder: Path | None, models: Sequence[ConceptModel]) -> Viewer:
        """Raises as `RerunLog` does, and OutputError where its file is there already."""
        from tracker.output import require_free
        from tracker.rerun_log import RerunLog
        from tracker.viewer import Several, file_viewer

        drawn, window = file_viewer(self.view, folder, models), "rerun" in self.view
        if not window and self.rrd is None:
            return drawn
        if self.rrd is not None:
            require_free(self.rrd, self.overwrite)
        return Several((drawn, RerunLog(models, self.rrd, window=window)))

    def _page(
        self, tracker: ObjectTracker, models: Sequence[ConceptModel], config: TrackerConfig, remote: RemoteControl
    ) -> WebPage | None:
        """The page that is served, its link printed; None where none is asked for. Raises as `open_page` does."""
        if self.serve is None:
            return None
        from tracker.web import TOKEN_VARIABLE, open_page

        token = os.environ.get(TOKEN_VARIABLE)
        opened = open_page(self.serve, token, self.source, tracker, models, config, remote)
        STDERR.print(f"the page: {opened.link}", highlight=False, soft_wrap=True, markup=False)
        return opened.page

    def _opened_source(self) -> FrameSource:
        """Raises SourceError and OutputError, also where it cannot be recorded as it is asked for."""
        from tracker.output import require_free
        from tracker.sources import open_source, require_recordable

        source = open_source(self.source)
        if self.record is not None:
            camera = require_recordable(source)
            require_free(self.record, self.overwrite)
            camera.record(self.record)
        return source

    def _config(self) -> TrackerConfig:
        """Raises ConfigError where what is asked for does not go together."""
        from tracker.config import parse_config, read_config
        from tracker.errors import ConfigError
        from tracker.sources import WITHOUT_MASKS, kind_of

        for view in self.view:
            if view != "rerun" and self.out is None:
                raise ConfigError(f"--view {view} needs a folder to write to: give --out DIR")
        if self.write and self.out is None:
            raise ConfigError(f"--write {' '.join(self.write)} needs a folder to write to: give --out DIR")
        config = read_config(self.config)
        if self.prior is not None:
            config = config.model_copy(update={"prior": self.prior == "on"})
        masks = self.masks
        if masks is None and kind_of(self.source) in WITHOUT_MASKS:
            if not config.prior:
                raise ConfigError(f"{self.source} has no masks, so the tracker carries them on: it needs --prior on")
            masks = "carried"
        if masks is not None:
            config = parse_config({**config.model_dump(), "masks": masks}, f"--masks {masks}")
        if self.smooth != "off" and not config.prior:
            raise ConfigError(f"--smooth {self.smooth} smooths what is followed through time: it needs --prior on")
        return config


def main() -> None:
    run(tyro.cli(Track, prog="python -m tracker", args=sys.argv[1:]))


if __name__ == "__main__":
    main()
