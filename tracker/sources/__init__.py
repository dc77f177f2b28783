"""Where frames come from: `open_source("bop:PATH:SCENE")` and the protocols that a source may fulfil."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence, Sized
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from tracker.errors import SourceError
from tracker.frame import Frame
from tracker.geometry import Pose


class FrameSource(Protocol):
    """Frames in the order of their stamps. `name` says which source it is, as the user wrote it."""

    @property
    def name(self) -> str: ...

    def __iter__(self) -> Iterator[Frame]: ...


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """What is known of an object in a frame before the frame is read.

    index: position in the source. visible_px: its pixels that can be seen. visible_fraction: share of its silhouette
    that can be seen, in [0, 1].
    """

    index: int
    T_cam_obj: Pose
    visible_px: int
    visible_fraction: float


@runtime_checkable
class Recording(FrameSource, Protocol):
    """Frames by position, as often as they are asked for."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> Frame: ...


@runtime_checkable
class PosedSource(Recording, Protocol):
    """A recording with known poses: where each object is in its frames."""

    @property
    def object_ids(self) -> tuple[str, ...]: ...

    def sightings(self, object_id: str) -> Sequence[Sighting]: ...


def length_of(source: FrameSource) -> int | None:
    """How many frames the source has; None where nobody knows, as of a camera."""
    return len(source) if isinstance(source, Sized) else None


@runtime_checkable
class LiveSource(FrameSource, Protocol):
    """A camera: time goes on while nobody looks, and frames come once.

    `stop` ends them soon, from any thread. left_out: how many frames never came out, by what became of them.
    """

    def stop(self) -> None: ...

    @property
    def left_out(self) -> Mapping[str, int]: ...


@runtime_checkable
class RosSource(LiveSource, Protocol):
    """A camera of a running ROS, by whose node results are published. ros: its modules. frame_id: of the pictures."""

    ros: Any
    node: Any
    frame_id: str


@runtime_checkable
class Recordable(LiveSource, Protocol):
    """A camera that can write what it sees to a file of its own kind while it is looked at."""

    def record(self, path: Path) -> None: ...


def require_recording(source: FrameSource) -> Recording:
    """The source itself. Raises SourceError where its frames come once, as those of a camera."""
    if not isinstance(source, Recording):
        raise SourceError(f"{source.name} has no frames by position, they come once; expected a recording")
    return source


def require_posed(source: FrameSource) -> PosedSource:
    """The source itself. Raises SourceError where it has no poses of objects, or no frames by position."""
    if not isinstance(source, PosedSource):
        raise SourceError(
            f"{source.name} has no poses of objects; expected a recording of a kind that may: {', '.join(POSED)}"
        )
    return source


def require_recordable(source: FrameSource) -> Recordable:
    """The source itself. Raises SourceError where it is no camera whose pictures can be written to a file."""
    if not isinstance(source, Recordable):
        raise SourceError(f"{source.name} cannot be recorded; expected a camera: realsense or realsense:SERIAL")
    return source


def require_object(source: PosedSource, object_id: str) -> None:
    """Raises SourceError unless the source knows the object; the message lists those that it knows."""
    if object_id not in source.object_ids:
        raise SourceError(
            f"{source.name} has no poses of object {object_id!r}; it has {', '.join(source.object_ids) or 'none'}"
        )


POSED = ("bop", "folder", "synthetic")


def _bop(argument: str) -> PosedSource:
    from tracker.sources.bop import BopScene

    path, separator, scene = argument.rpartition(":")
    if not separator or not scene.isdecimal():
        raise SourceError(f"bop:{argument}: expected bop:PATH:SCENE with the number of a scene")
    return BopScene(path, int(scene))


def _folder(argument: str) -> PosedSource:
    from tracker.sources.folder import Folder

    return Folder(argument)


def _realsense(argument: str) -> FrameSource:
    from tracker.sources.realsense import open_realsense

    return open_realsense(argument)


def _synthetic(argument: str) -> PosedSource:
    from tracker.sources.synthetic import open_scene

    return open_scene(argument)


def _orbbec(argument: str) -> FrameSource:
    from tracker.sources.orbbec import open_orbbec

    return open_orbbec(argument)


def _tum(argument: str) -> Recording:
    from tracker.sources.tum import TumFolder

    return TumFolder(argument)


def _video(argument: str) -> FrameSource:
    from tracker.sources.video import VideoWithDepth

    return VideoWithDepth(argument)


def _ros2(argument: str) -> FrameSource:
    from tracker.sources.ros2 import open_ros2

    return open_ros2(argument)


def _rosbag(argument: str) -> FrameSource:
    from tracker.sources.rosbag import RosBag

    return RosBag(argument)


SOURCES: dict[str, Callable[[str], FrameSource]] = {
    "bop": _bop,
    "folder": _folder,
    "orbbec": _orbbec,
    "realsense": _realsense,
    "ros2": _ros2,
    "rosbag": _rosbag,
    "synthetic": _synthetic,
    "tum": _tum,
    "video": _video,
}
WITHOUT_MASKS = ("orbbec", "realsense", "ros2", "rosbag", "tum", "video")  # kinds that never say where an object is
ALONE = ("orbbec", "realsense", "ros2")  # kinds that may stand without an argument: the only one that there is


def kind_of(name: str) -> str:
    """What a source's name begins with, whether there is such a kind or not."""
    return name.partition(":")[0].partition("?")[0]


def open_source(name: str) -> FrameSource:
    """`KIND:ARGUMENT` -> the source. Raises SourceError where kind, path or content is not what it needs.

    Whoever needs its frames by position asks `require_recording` for them, whoever needs poses `require_posed`.
    """
    kind, (_, separator, argument) = kind_of(name), name.partition(":")
    if not separator:  # realsense?fps=60
        argument = name[len(kind) :]
    if kind not in SOURCES or (not argument if separator else kind not in ALONE):
        raise SourceError(f"{name!r} is not a source; expected KIND:ARGUMENT with KIND one of {', '.join(SOURCES)}")
    return SOURCES[kind](argument)
