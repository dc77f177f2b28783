"""Result folders that are whole or absent, and poses as lines of JSON."""

from __future__ import annotations

import json
import logging
import os
import re
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, TextIO

from tracker.errors import OutputError
from tracker.frame import Frame, Provenance
from tracker.geometry import Pose
from tracker.region import Region, SeenRegion
from tracker.result import TrackResult
from tracker.smoothing import smooth_results

log = logging.getLogger(__name__)


@contextmanager
def result_folder(path: str | Path, overwrite: bool) -> Iterator[Path]:
    """A folder to write into, which takes the place of `path` when the block ends without an error.

    What a run that was killed had written is named, and stays. Raises OutputError at once where `path` holds something
    already and `overwrite` is False.
    """
    path = Path(path).resolve()
    require_free(path, overwrite)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    shutil.rmtree(partial, ignore_errors=True)  # of a process that had this number before
    for left in _left_behind(path):
        log.warning("%s is what a run that was killed had written: have a look, and remove it", left)
    try:
        partial.mkdir(parents=True)
        yield partial
        _move_into_place(partial, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _left_behind(path: Path) -> list[Path]:
    """Folders of processes that are no more."""
    if not path.parent.is_dir():
        return []
    kind = re.compile(rf"\.{re.escape(path.name)}\.(\d+)\.partial")
    found = {name: match for name in sorted(os.listdir(path.parent)) if (match := kind.fullmatch(name))}
    return [path.with_name(name) for name, match in found.items() if not _runs(int(match[1]))]


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True  # somebody else's
    return True


def _move_into_place(partial: Path, path: Path) -> None:
    if not path.is_dir():
        partial.rename(path)
        return
    old = path.with_name(f".{path.name}.{os.getpid()}.old")
    path.rename(old)
    try:
        partial.rename(path)
    except OSError:
        old.rename(path)
        raise
    shutil.rmtree(old)


def require_free(path: Path, overwrite: bool) -> None:
    """Raises OutputError where results would be overwritten without having been asked to."""
    if path.is_file() and not overwrite:
        raise OutputError(f"{path} exists already; give another name, or --overwrite")
    if path.is_dir() and any(path.iterdir()) and not overwrite:
        raise OutputError(f"{path} holds results already; give another folder, or --overwrite")


class PoseWriter(Protocol):
    """Takes the results of every frame, in the order of the frames; `provenance` is the frame's."""

    def add(self, frame_index: int, provenance: Provenance, results: Sequence[TrackResult]) -> None: ...


class PoseOutput:
    """Results on their way to every writer: as they come, or, smoothed, all at the end.

    smooth: "offline" waits for `finish`. located: objects of which a writer asks where concepts are.
    """

    def __init__(self, writers: Sequence[PoseWriter], smooth: str = "off", located: Collection[str] = ()) -> None:
        self._writers, self._smooth, self._located = writers, smooth, located
        self._held: list[tuple[int, Provenance, Sequence[TrackResult]]] = []

    def add(self, frame: Frame, results: Sequence[TrackResult]) -> None:
        if self._smooth == "off":
            self._write(frame.index, frame.provenance, results)
        else:  # the depth picture of every frame is held only where it is asked for
            kept = [r if r.object_id in self._located else r.slim() for r in results]
            self._held.append((frame.index, frame.provenance, kept))

    def finish(self) -> None:
        """There are no more frames."""
        smoothed = iter(smooth_results([result for _, _, results in self._held for result in results]))
        for frame_index, provenance, results in self._held:
            self._write(frame_index, provenance, [next(smoothed) for _ in results])
        self._held = []

    def _write(self, frame_index: int, provenance: Provenance, results: Sequence[TrackResult]) -> None:
        for writer in self._writers:
            writer.add(frame_index, provenance, results)


class PoseLines:
    """Results as lines of JSON in one or several texts.

    regions: of every object, where on it concepts are, to be said in every line.
    """

    def __init__(self, texts: Sequence[TextIO], regions: Mapping[str, Mapping[str, Region | None]]) -> None:
        self._texts, self._regions = texts, regions

    def add(self, frame_index: int, provenance: Provenance, results: Sequence[TrackResult]) -> None:  # noqa: ARG002
        for result in results:
            seen = {concept: r and result.locate(r) for concept, r in self._regions[result.object_id].items()}
            line = as_json_line(result, frame_index, seen)
            for text in self._texts:
                text.write(line + "\n")
                text.flush()  # a program at the other end of a pipe waits for the line


def as_json_line(result: TrackResult, frame_index: int, regions: Mapping[str, SeenRegion | None] | None = None) -> str:
    """One result as a line of JSON: metres, radians, nanoseconds, quaternions wxyz; null where there is no pose.

    regions: where concepts of the object are; null where a concept is not on it.
    """
    evidence = result.evidence
    return json.dumps(
        {
            "frame": frame_index,
            "stamp_ns": result.stamp_ns,
            "object": result.object_id,
            "state": result.state.value,
            "reason": result.reason,
            "confidence": round(result.confidence, 4),
            "T_cam_obj": _pose(result.pose),
            "T_cam_obj_raw": _pose(result.raw_pose),
            "covariance": None if result.covariance is None else result.covariance.tolist(),
            "evidence": None if evidence is None else {k: round(getattr(evidence, k), 4) for k in evidence.__slots__},
            "timings_ms": {stage: round(ms, 2) for stage, ms in result.timings_ms.items()},
            **({"regions": {concept: _region(seen) for concept, seen in regions.items()}} if regions else {}),
        }
    )


def _region(seen: SeenRegion | None) -> dict[str, Any] | None:
    if seen is None:
        return None
    return {
        "centre_cam_m": seen.cam.centre_m.round(5).tolist(),
        "centre_obj_m": seen.obj.centre_m.round(5).tolist(),
        "axes_cam": seen.cam.axes.round(5).tolist(),
        "extent_m": seen.obj.extent_m.round(5).tolist(),
        "visible": round(seen.visible, 3),
        "share": round(seen.obj.share, 3),
    }


def _pose(pose: Pose | None) -> dict[str, Any] | None:
    if pose is None:
        return None
    return {"quaternion_wxyz": pose.quaternion_wxyz.tolist(), "translation_m": pose.translation_m.tolist()}
