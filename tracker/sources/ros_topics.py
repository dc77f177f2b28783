"""Which topics of a recording are its colour, its depth and its camera: named, or found by what they hold."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from tracker.errors import SourceError
from tracker.sources.query import number, some, yes_or_no
from tracker.sources.ros_frames import WHAT_TO_RECORD, is_rectified
from tracker.sources.ros_images import Kind

IMAGE_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
INFO_TYPE = "sensor_msgs/msg/CameraInfo"
TRANSPORTS = ("compressed", "compressedDepth")
SLOP_S = 0.02  # less than the time between two pictures at 30 Hz, more than what drivers stamp apart
OPTIONS = {  # of a bag and of a running ROS
    "colour": some,
    "depth": some,
    "info": some,
    "depth_unit": number(1e-6, 1.0, "metres per unit of the depth"),
    "slop": number(0, 10, "seconds"),
    "registered": yes_or_no,
}


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic and what its first message says. kind: of pictures, else None. size: (width, height), or None."""

    name: str
    msgtype: str
    count: int
    kind: Kind | None = None
    frame_id: str = ""
    size: tuple[int, int] | None = None

    @property
    def camera(self) -> str:
        """Name of the camera: that of the topic without what it says of the picture."""
        return _without_transport(self.name).rpartition("/")[0]

    def __str__(self) -> str:
        size = f" {self.size[0]}x{self.size[1]}" if self.size else ""
        what = f"{self.kind}{size} in {self.frame_id!r}" if self.kind else self.msgtype.rpartition("/")[2]
        return f"{self.name} ({what}, {self.count})"


@dataclass(frozen=True, slots=True)
class Chosen:
    """Names of topics."""

    colour: str
    depth: str
    info: str


def choose_topics(
    where: str,
    topics: Sequence[Topic],
    colour: str | None = None,
    depth: str | None = None,
    info: str | None = None,
    registered: bool = False,
) -> Chosen:
    """colour, depth, info: as the user names them; what is not named is found, where it can only be one.

    Raises SourceError, which begins with `where` and lists the topics, where one is not there, is of another kind, or
    where several could be meant.
    """
    with_messages = [topic for topic in topics if topic.count > 0]
    pictures = _not_twice([topic for topic in with_messages if topic.kind is not None])
    of_colour = _colour(where, with_messages, pictures, colour)
    of_depth = _depth(where, with_messages, pictures, depth, of_colour, registered)
    return Chosen(of_colour.name, of_depth.name, _info(where, with_messages, info, of_colour).name)


def _colour(where: str, topics: Sequence[Topic], pictures: Sequence[Topic], asked: str | None) -> Topic:
    if asked is not None:
        return _named(where, topics, "colour", asked, [t for t in topics if t.kind and t.kind.is_colour])
    found = [t for t in pictures if t.kind and t.kind.is_colour]
    # An infrared camera is gray, too, so gray is colour only where there is no other.
    return _only(where, topics, "colour", [t for t in found if t.kind and t.kind.encoding != "mono8"] or found)


def _depth(
    where: str,
    topics: Sequence[Topic],
    pictures: Sequence[Topic],
    asked: str | None,
    colour: Topic,
    registered: bool,
) -> Topic:
    if asked is not None:
        return _named(where, topics, "depth", asked, [t for t in topics if t.kind and t.kind.is_depth])
    found = [t for t in pictures if t.kind and t.kind.is_depth]
    fitting = [t for t in found if registered or t.frame_id.lstrip("/") == colour.frame_id.lstrip("/")]
    fitting = [t for t in fitting if not t.size or not colour.size or t.size == colour.size]
    if found and not fitting:
        raise SourceError(
            f"{where}: none of the depth topics ({_listed(found)}) is registered to the colour {colour}; "
            f"{WHAT_TO_RECORD}"
        )
    same = [t for t in fitting if is_rectified(t.name) == is_rectified(colour.name)]
    return _only(where, topics, "depth", same if len(same) == 1 else fitting)


def _info(where: str, topics: Sequence[Topic], asked: str | None, colour: Topic) -> Topic:
    infos = [t for t in topics if t.msgtype == INFO_TYPE]
    if asked is not None:
        return _named(where, topics, "info", asked, infos)
    beside = [t for t in infos if t.camera == colour.camera]
    return _only(where, topics, "info", beside or [t for t in infos if _same_camera(t, colour)])


def _same_camera(info: Topic, colour: Topic) -> bool:
    same_size = not info.size or not colour.size or info.size == colour.size
    return same_size and info.frame_id.lstrip("/") == colour.frame_id.lstrip("/")


def _named(where: str, topics: Sequence[Topic], option: str, asked: str, fitting: Iterable[Topic]) -> Topic:
    found = next((topic for topic in fitting if topic.name == asked), None)
    if found is None:
        there = any(topic.name == asked for topic in topics)
        problem = "is no such topic" if there else "is not there"
        raise SourceError(f"{where}: {option}={asked} {problem}; the topics are {_listed(topics)}")
    return found


def _only(where: str, topics: Sequence[Topic], option: str, found: Sequence[Topic]) -> Topic:
    if not found:
        what = {"colour": "colour pictures", "depth": "depth pictures", "info": "a CameraInfo of the colour camera"}
        raise SourceError(f"{where}: no topic has {what[option]}; the topics are {_listed(topics) or 'none'}")
    if len(found) > 1:
        raise SourceError(f"{where}: several topics could be the {option}: {_listed(found)}; say ?{option}=TOPIC")
    return found[0]


def _not_twice(pictures: Sequence[Topic]) -> list[Topic]:
    """Without those that are the compressed form of one that is there raw."""
    names = {topic.name for topic in pictures}
    return [t for t in pictures if _without_transport(t.name) == t.name or _without_transport(t.name) not in names]


def _without_transport(name: str) -> str:
    stem, _, last = name.rpartition("/")
    return stem if last in TRANSPORTS else name


def _listed(topics: Iterable[Topic]) -> str:
    return ", ".join(str(topic) for topic in topics)
