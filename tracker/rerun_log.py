"""Everything that the tracker saw and said, for the viewer Rerun: in its window, in an .rrd file, or both.

On one timeline, the frames' stamps:

    world                   the camera's coordinates: x right, y down, z forward, metres
    world/camera            pinhole; below it rgb, depth, and, where they were asked, concepts: the strongest a pixel
    world/objects/ID        the filtered pose; below it the model's points, by their strongest concept, and its box
    world/raw/ID            axes of the pose before the filter
    world/truth/ID          the true pose and box, where there is one
    state/ID, reason/ID     when they change
    confidence/ID           in [0, 1]
    timings/STAGE           milliseconds, of all objects together
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from tracker.concept import ConceptModel
from tracker.errors import ConfigError, MissingExtraError, OutputError
from tracker.frame import Frame
from tracker.geometry import Intrinsics, Pose
from tracker.overlay import ESTIMATE, STATES, TRUTH
from tracker.result import Surface, TrackResult

if TYPE_CHECKING:
    import rerun
    import rerun.blueprint

APPLICATION, TIMELINE = "conceptrack", "stamp"
DATE_FROM_NS = 10**17  # three years: clocks that count from 1970 are beyond it, those that count from their start not
DEPTH_UNITS_PER_M = 1000  # as 16 bits, half of what floats take
JPEG_QUALITY = 85
BEHIND_M, AHEAD_M = (0.3, -0.4, -0.4), (0.0, 0.0, 0.7)  # from where, at first, one looks to what is before the camera


class RerunLog:
    """A viewer, as `tracker.viewer` has them. file: an .rrd to write. window: open Rerun's, and send it all.

    Raises MissingExtraError without the package, ConfigError where there is no display for a window, OutputError where
    the file cannot be written.
    """

    def __init__(self, models: Sequence[ConceptModel], file: Path | None = None, *, window: bool = False) -> None:
        try:
            import rerun
        except ImportError as error:
            raise MissingExtraError("Rerun needs its package: pip install 'conceptrack[rerun]'") from error
        self._rr = rerun
        self._models = {model.object_id: model for model in models}
        labels = list(dict.fromkeys(label for model in models for label in model.labels))
        self._class_of = {label: number for number, label in enumerate(labels, start=1)}  # 0 is none
        self._told: dict[str, tuple[str, str]] = {}
        self._camera: Intrinsics | None = None
        self._in_view: set[tuple[str, str]] = set()
        self._concepts_shown = False
        self._stages: list[str] = []
        self._recording = rerun.RecordingStream(APPLICATION)
        self._recording.set_log_time_enabled(False)
        self._recording.set_log_tick_enabled(False)
        self._open(file, window)
        self._once()

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        rr, log = self._rr, self._recording.log
        at_ns = frame.stamp_ns
        if at_ns > DATE_FROM_NS:
            self._recording.set_time(TIMELINE, timestamp=np.datetime64(at_ns, "ns"))
        else:
            self._recording.set_time(TIMELINE, duration=np.timedelta64(at_ns, "ns"))
        self._show_frame(frame)
        self._show_concepts(frame, results)
        spent_ms = dict.fromkeys(self._stages, 0.0)
        for result in results:
            self._show_result(result)
            for stage, ms in result.timings_ms.items():
                spent_ms[stage] = spent_ms.get(stage, 0.0) + ms
        self._stages = list(spent_ms)  # one that did not run in a frame took no time there
        for stage, ms in spent_ms.items():
            log(["timings", stage], rr.Scalars(ms))
        for object_id, model in self._models.items():
            self._place("truth", object_id, truth.get(object_id), lambda m=model: {(): self._box(m, TRUTH)})

    def close(self) -> None:
        self._recording.flush()
        self._recording.disconnect()

    def _open(self, file: Path | None, window: bool) -> None:
        rr = self._rr
        sinks = []
        if window:
            require_display()
            try:
                rr.spawn(connect=False, recording=self._recording)
            except RuntimeError as error:
                raise ConfigError(f"Rerun's window cannot be opened: {error}") from error
            sinks.append(rr.GrpcSink())
        if file is not None:
            try:
                file.touch()  # Rerun itself only warns
            except OSError as error:
                raise OutputError(f"{file}: cannot be written ({error.strerror})") from error
            sinks.append(rr.FileSink(str(file)))
        self._recording.set_sinks(*sinks, default_blueprint=self._blueprint())

    def _once(self) -> None:
        """What is the same in all frames."""
        rr = self._rr
        names = [rr.AnnotationInfo(number, label) for label, number in self._class_of.items()]
        self._recording.log("/", rr.AnnotationContext(names), static=True)
        self._recording.log("world", rr.ViewCoordinates.RDF, static=True)
        states = {state.value: (*colour, 255) for state, colour in STATES.items()}
        for object_id in self._models:
            colours = rr.StateConfiguration(values=list(states), colors=list(states.values()))
            self._recording.log(["state", object_id], colours, static=True)

    def _show_frame(self, frame: Frame) -> None:
        rr, log, camera = self._rr, self._recording.log, frame.intrinsics
        if camera != self._camera:
            self._camera = camera
            focal, centre = (camera.fx, camera.fy), (camera.cx, camera.cy)
            pinhole = rr.Pinhole(
                focal_length=focal, principal_point=centre, width=camera.width, height=camera.height,
                camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=0.1,
            )  # fmt: skip
            log("world/camera", pinhole)
        bgr = cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2BGR)
        _, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        log("world/camera/rgb", rr.EncodedImage(contents=jpeg.tobytes(), media_type="image/jpeg"))
        units = np.clip(frame.depth_m * DEPTH_UNITS_PER_M + 0.5, 0, 65535).astype(np.uint16)
        log("world/camera/depth", rr.DepthImage(units, meter=DEPTH_UNITS_PER_M))

    def _show_concepts(self, frame: Frame, results: Sequence[TrackResult]) -> None:
        seen = [result.surface for result in results if result.surface and result.surface.saliency]
        if seen:
            classes = np.zeros(frame.depth_m.shape, np.uint16)
            for surface in seen:
                self._paint(classes, surface, frame.intrinsics)
            self._recording.log("world/camera/concepts", self._rr.SegmentationImage(classes, opacity=0.6))
        elif self._concepts_shown:
            self._recording.log("world/camera/concepts", self._rr.Clear(recursive=False))
        self._concepts_shown = bool(seen)

    def _paint(self, classes: npt.NDArray[np.uint16], surface: Surface, camera: Intrinsics) -> None:
        """The strongest concept's number at every pixel (H, W) of the object's surface."""
        if surface.saliency is None:
            return
        rows, columns = np.nonzero(surface.depth_m > 0)
        block = round(camera.fx / surface.camera.fx)
        x0, y0 = (
            np.rint(frame_c - view_c * block - (block - 1) / 2).astype(int)
            for frame_c, view_c in ((camera.cx, surface.camera.cx), (camera.cy, surface.camera.cy))
        )
        columns, rows = x0 + block * columns, y0 + block * rows
        strength = surface.saliency.sample(columns + (block - 1) // 2, rows + (block - 1) // 2)
        numbers = np.array([self._class_of[label] for label in surface.saliency.labels], np.uint16)
        strongest = numbers[strength.argmax(axis=1)]
        for down in range(block):
            for right in range(block):
                y, x = rows + down, columns + right
                inside = (y >= 0) & (y < classes.shape[0]) & (x >= 0) & (x < classes.shape[1])
                classes[y[inside], x[inside]] = strongest[inside]

    def _show_result(self, result: TrackResult) -> None:
        rr, log, name = self._rr, self._recording.log, result.object_id
        model = self._models[name]
        axes = rr.TransformAxes3D(0.3 * model.diameter_m)
        self._place("objects", name, result.pose, lambda: {(): axes, **self._shape(model)})
        self._place("raw", name, result.raw_pose, lambda: {(): rr.TransformAxes3D(0.15 * model.diameter_m)})
        log(["confidence", name], rr.Scalars(result.confidence))
        before, now = self._told.get(name), (result.state.value, result.reason)
        if before is None or before[0] != now[0]:
            log(["state", name], rr.StateChange(state=now[0]))
        if before != now:
            level = rr.TextLogLevel.INFO if result.pose is not None else rr.TextLogLevel.WARN
            log(["reason", name], rr.TextLog(f"{name}: {now[0]}, {now[1]}", level=level))
        self._told[name] = now

    def _place(
        self, kind: str, name: str, pose: Pose | None, parts: Callable[[], Mapping[tuple[str, ...], rerun.AsComponents]]
    ) -> None:
        """Put something where it is now. parts: of it, by the path below; they are sent when it comes into view, and
        taken away with it: without a pose they would lie at the origin."""
        there: list[object] = ["world", kind, name]
        if pose is not None:
            self._recording.log(there, self._transform(pose))
            if (kind, name) not in self._in_view:
                for below, part in parts().items():
                    self._recording.log([*there, *below], part)
            self._in_view.add((kind, name))
        elif (kind, name) in self._in_view:
            self._recording.log(there, self._rr.Clear(recursive=True))
            self._in_view.discard((kind, name))

    def _shape(self, model: ConceptModel) -> dict[tuple[str, ...], rerun.AsComponents]:
        numbers = np.array([self._class_of[label] for label in model.labels], np.uint16)
        strongest = numbers[model.saliency.argmax(axis=1)]
        points = self._rr.Points3D(model.points, class_ids=strongest, radii=model.diameter_m / 150)
        return {("points",): points, ("box",): self._box(model, ESTIMATE)}

    def _transform(self, pose: Pose) -> rerun.Transform3D:
        return self._rr.Transform3D(translation=pose.translation_m, mat3x3=pose.rotation)

    def _box(self, model: ConceptModel, colour: tuple[int, int, int]) -> rerun.Boxes3D:
        low, high = model.points.min(axis=0), model.points.max(axis=0)
        return self._rr.Boxes3D(
            centers=[(low + high) / 2], half_sizes=[(high - low) / 2], colors=[colour], fill_mode="majorwireframe"
        )

    def _blueprint(self) -> rerun.blueprint.Blueprint:
        import rerun.blueprint as rrb

        parts = [self._rr.escape_entity_path_part(object_id) for object_id in self._models]
        boxes = [f"world/objects/{part}/box" for part in parts]
        drawn = ["world/camera/rgb", "world/camera/concepts", *boxes, "world/truth/**"]
        return rrb.Blueprint(
            rrb.Horizontal(
                rrb.Vertical(
                    rrb.Spatial2DView(name="camera", origin="world/camera", contents=drawn),
                    rrb.Spatial2DView(name="depth", origin="world/camera", contents=["world/camera/depth"]),
                ),
                rrb.Spatial3DView(
                    name="scene",
                    origin="world",
                    contents=["world/**", "- world/camera/concepts"],
                    eye_controls=rrb.EyeControls3D(position=BEHIND_M, look_target=AHEAD_M, eye_up=(0, -1, 0)),
                ),
                rrb.Vertical(
                    rrb.StateTimelineView(name="state", origin="state"),
                    rrb.TimeSeriesView(
                        name="confidence", origin="confidence", axis_y=rrb.ScalarAxis(range=(-0.05, 1.05))
                    ),
                    rrb.TimeSeriesView(name="milliseconds", origin="timings"),
                    rrb.TextLogView(name="reasons", origin="reason"),
                    row_shares=[4, 3, 3, 3],
                ),
                column_shares=[3, 4, 3],
            ),
            rrb.SelectionPanel(state="collapsed"),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        )


def require_display() -> None:
    """Raises ConfigError where no window can be opened."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ConfigError(
            "--view rerun: there is no display here to open a window on; --rrd FILE writes the same to a file, which "
            "`rerun FILE` opens elsewhere"
        )
