"""Recordings of ROS: a ROS 2 bag (its folder, or one .db3 or .mcap of it) or a ROS 1 .bag, read without ROS.

    rosbag:PATH?colour=TOPIC&depth=TOPIC&info=TOPIC&depth_unit=0.001&slop=0.02&registered=yes

Every option may be missing: topics are found by what they hold, the unit of depth by its encoding (16UC1 millimetres,
32FC1 metres). Messages are read one after the other, so that a bag may be larger than the memory.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tracker.errors import MissingExtraError, SourceError
from tracker.frame import Frame
from tracker.sources.approximate_time import Pairing
from tracker.sources.query import read_query
from tracker.sources.ros_frames import RosFrames
from tracker.sources.ros_images import kind_of, stamp_ns
from tracker.sources.ros_topics import IMAGE_TYPES, INFO_TYPE, OPTIONS, SLOP_S, Topic, choose_topics

if TYPE_CHECKING:
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

logger = logging.getLogger(__name__)

REORDER = 5  # messages of a topic that may be recorded in another order than they were stamped in


class RosBag:
    """Frames in the order of the colour pictures' header stamps, read anew whenever they are asked for.

    argument: PATH with options. Raises MissingExtraError without the package rosbags, SourceError where the bag cannot
    be read or does not say which topics are meant; it names the topics that there are.
    """

    def __init__(self, argument: str) -> None:
        self.name = f"rosbag:{argument}"
        path, _, query = argument.partition("?")
        given = read_query(self.name, query, OPTIONS)
        self._path = _storage(Path(path))
        self._unit_m: float | None = given.get("depth_unit")
        self._slop_ns = round(given.get("slop", SLOP_S) * 1e9)
        self._registered: bool = given.get("registered", False)
        self._messages = _Messages(self._path)
        with self._messages.opened() as reader:
            topics = self._messages.topics(reader)
        asked = {option: given.get(option) for option in ("colour", "depth", "info")}
        self.topics = choose_topics(str(self._path), topics, **asked, registered=self._registered)

    def __iter__(self) -> Iterator[Frame]:
        chosen = self.topics
        frames = RosFrames(str(self._path), chosen.colour, chosen.depth, self._unit_m, self._registered)
        pairing = Pairing[Any](self._slop_ns, REORDER)
        index = 0
        with self._messages.opened() as reader:
            frames.tell_camera(self._messages.first(reader, chosen.info))
            for topic, message in self._messages.read(reader, (chosen.colour, chosen.depth, chosen.info)):
                if topic == chosen.info:
                    frames.tell_camera(message)
                    continue
                for pair in pairing.add(0 if topic == chosen.colour else 1, stamp_ns(message), message):
                    yield frames.frame(pair.first, pair.second, index)
                    index += 1
        for pair in pairing.finish():
            yield frames.frame(pair.first, pair.second, index)
            index += 1
        self._report(pairing, index)

    def _report(self, pairing: Pairing[Any], frames: int) -> None:
        """Raises SourceError where hardly anything belonged together: the topics are not what they seem."""
        told = (
            f"{self._path}: {frames} pairs of {self.topics.colour} and {self.topics.depth} within "
            f"{self._slop_ns / 1e9:g} s, left out {pairing.unpaired[0]} and {pairing.unpaired[1]} without a partner, "
            f"{pairing.late[0]} and {pairing.late[1]} whose header's stamp was not new"
        )
        if not frames or max(pairing.late) > frames:
            raise SourceError(f"{told}; are the headers stamped, by one clock? Else say ?slop=SECONDS")
        logger.info("%s", told)


class _Messages:
    """The one place that knows the package rosbags. Whatever it raises on a damaged bag becomes a SourceError."""

    def __init__(self, path: Path) -> None:
        try:
            from rosbags import rosbag1, rosbag2
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise MissingExtraError(
                "rosbag: needs the package rosbags; install it with pip install 'conceptrack[rosbag]'"
            ) from error
        self._path, is_ros1 = path, path.suffix == ".bag"
        self._reader = rosbag1.Reader if is_ros1 else rosbag2.Reader
        # The few types that are read here are the same in all versions, and old bags of ROS 2 don't hold them.
        store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
        self._deserialize = store.deserialize_ros1 if is_ros1 else store.deserialize_cdr

    @contextmanager
    def opened(self) -> Iterator[Reader1 | Reader2]:
        with self._damage("cannot be opened"):
            reader = self._reader(self._path)
            reader.open()
        try:
            yield reader
        finally:
            with self._damage("cannot be closed"):  # what it knows of itself may be the bag's nonsense
                reader.close()

    def topics(self, reader: Reader1 | Reader2) -> list[Topic]:
        """Those that are there, with what their first messages say."""
        with self._damage("its topics cannot be read"):
            listed = [(name, str(topic.msgtype), topic.msgcount) for name, topic in reader.topics.items()]
        return [self._described(reader, *each) for each in listed]

    def _described(self, reader: Reader1 | Reader2, name: str, msgtype: str, count: int) -> Topic:
        if not count or msgtype not in (*IMAGE_TYPES, INFO_TYPE):
            return Topic(name, msgtype, count)
        message = self.first(reader, name)
        kind = kind_of(message) if msgtype in IMAGE_TYPES else None
        size = (int(message.width), int(message.height)) if hasattr(message, "width") else None
        return Topic(name, msgtype, count, kind, message.header.frame_id, size)

    def first(self, reader: Reader1 | Reader2, topic: str) -> Any:
        found = next(self.read(reader, (topic,)), None)
        if found is None:
            raise SourceError(f"{self._path}: {topic} has no message that can be read")
        return found[1]

    def read(self, reader: Reader1 | Reader2, topics: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
        """Topic and message, in the order in which they were recorded."""
        with self._damage(f"is damaged; of its topics {', '.join(topics)} were read"):
            connections = [connection for connection in reader.connections if connection.topic in topics]
            messages = reader.messages(connections=connections)
        read = 0
        while True:
            with self._damage(f"is damaged after {read} messages of {', '.join(topics)}"):
                found = next(messages, None)
                if found is None:
                    return
                connection, _, data = found
                message = self._deserialize(data, connection.msgtype)
            read += 1
            yield connection.topic, message

    @contextmanager
    def _damage(self, what: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # SQLite's, a decompressor's, anybody's: all come through
            told = f"{type(error).__name__}: {error}"
            hint = "a recording that was cut off is repaired by ros2 bag reindex, mcap recover or rosbag reindex"
            raise SourceError(f"{self._path}: {what} ({told}); expected a bag of ROS; {hint}") from error


def _storage(path: Path) -> Path:
    """The path itself, or the one file of a folder of ROS 2 whose metadata.yaml is missing, as after a crash."""
    if not path.exists():
        raise SourceError(f"{path}: no such bag")
    if path.is_dir() and not (path / "metadata.yaml").exists():
        found = sorted(file for file in path.iterdir() if file.suffix in (".db3", ".mcap"))
        if len(found) != 1:
            raise SourceError(f"{path}: no bag of ROS 2: it has no metadata.yaml and {len(found)} .db3 or .mcap files")
        return found[0]
    return path
