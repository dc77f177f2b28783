"""A camera whose pictures are topics of a running ROS 2: what it shows now, and which topic is silent."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from tracker.errors import SourceError
from tracker.frame import Frame
from tracker.handover import Handover
from tracker.sources.approximate_time import Pair, Pairing
from tracker.sources.ros_frames import RosFrames
from tracker.sources.ros_images import stamp_ns
from tracker.sources.tolerance import Tolerance

logger = logging.getLogger(__name__)

NODE = "conceptrack"
POLL_S = 0.1
SILENT_S = 3.0  # a camera shows something every second at the least
AGAIN_S = 10.0  # before the same is warned of again
LEAST_GAP_NS = 8_000_000  # no usual camera shows more than 120 pictures a second
IN_FLIGHT = 2


@dataclass(frozen=True, slots=True)
class Topics:
    """Names of topics."""

    colour: str
    depth: str
    info: str

    def __iter__(self) -> Iterator[str]:
        return iter((self.colour, self.depth, self.info))


class Ros2Camera:
    """Frames as they come, until `stop`. ros: as `load_ros` gives it. `node` may publish meanwhile.

    The two images alone are synchronised; of CameraInfo the last one counts. now_s: of the watchdog.
    """

    def __init__(
        self,
        ros: Any,
        topics: Topics,
        name: str,
        slop_ns: int,
        *,
        depth_unit_m: float | None = None,
        registered: bool = False,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name, self.ros = name, ros
        self.frame_id = ""
        self._topics, self._now_s = topics, now_s
        self._frames = RosFrames(name, topics.colour, topics.depth, depth_unit_m, registered)
        self._pairing: Pairing[Any] = Pairing(slop_ns, least_gap_ns=LEAST_GAP_NS)
        self._door: Handover[Pair[Any]] = Handover(IN_FLIGHT, newest=True)
        self._stopped = threading.Event()
        self._tolerance = Tolerance(name)
        self._watchdog = Watchdog(topics, now_s())
        self._own_context = not ros.rclpy.ok()
        if self._own_context:  # an interrupt is for the program, which keeps what was tracked
            ros.rclpy.init(signal_handler_options=ros.signals.SignalHandlerOptions.NO)
        self.node = ros.rclpy.create_node(NODE)
        # Best effort hears reliable publishers too, the other way round nothing would come.
        quality = ros.qos.qos_profile_sensor_data
        for topic, take in zip(topics, (self._take_colour, self._take_depth, self._take_info), strict=True):
            heard = partial(self._heard, topic, take)
            self.node.create_subscription(_type_of(ros, topic, topics), topic, heard, quality)

    def stop(self) -> None:
        """Ends the frames soon, from any thread."""
        self._stopped.set()

    @property
    def left_out(self) -> Mapping[str, int]:
        """How many frames never came out, by what became of them."""
        return {
            "without a partner: colour without depth of its time": self._pairing.unpaired[0],
            "dropped: newer ones had come before they could be read": self._door.dropped,
            "left out: they could not be right": self._tolerance.refused,
        }

    def __iter__(self) -> Iterator[Frame]:
        """Raises SourceError where so many frames in a row cannot be right."""
        index = 0
        spinning = threading.Thread(target=self._spin, name="ros2", daemon=True)
        spinning.start()
        try:
            while not self._stopped.is_set():
                pair = self._door.get(POLL_S)
                self._warn()
                if pair is None:
                    if self._door.ended:
                        return
                    continue
                frame = self._tolerance.made(lambda pair=pair, index=index: self._frame(pair, index))
                index += 1
                if frame is not None:
                    yield frame
        finally:
            self._stopped.set()
            spinning.join()
            self.node.destroy_node()
            if self._own_context:
                self.ros.rclpy.try_shutdown()

    def _spin(self) -> None:
        error: BaseException | None = None
        try:
            while not self._stopped.is_set() and self.ros.rclpy.ok():
                self.ros.rclpy.spin_once(self.node, timeout_sec=POLL_S)
        except Exception as raised:  # whoever reads the frames is told
            error = raised if isinstance(raised, SourceError) else SourceError(f"{self.name}: {raised}")
            error.__cause__ = raised
        self._door.end(error)

    def _frame(self, pair: Pair[Any], index: int) -> Frame:
        self.frame_id = pair.first.header.frame_id
        return self._frames.frame(pair.first, pair.second, index)

    def _heard(self, topic: str, take: Callable[[Any], None], message: Any) -> None:
        self._watchdog.heard(topic, self._now_s())
        take(message)

    def _take_colour(self, message: Any) -> None:
        self._pass_on(self._pairing.add(0, stamp_ns(message), message))

    def _take_depth(self, message: Any) -> None:
        self._pass_on(self._pairing.add(1, stamp_ns(message), message))

    def _take_info(self, message: Any) -> None:
        self._frames.tell_camera(message)

    def _pass_on(self, pairs: list[Pair[Any]]) -> None:
        for pair in pairs:
            if self._frames.knows_camera:
                self._watchdog.paired(self._now_s())
                self._door.put(pair)

    def _warn(self) -> None:
        for warning in self._watchdog.warnings(self._now_s(), self.node.count_publishers):
            logger.warning("%s: %s", self.name, warning)


class Watchdog:
    """Says which topic is silent, as a subscription that does not fit its publisher fails without a word."""

    def __init__(self, topics: Topics, start_s: float) -> None:
        self._heard_s = dict.fromkeys(topics, start_s)
        self._info, self._info_came = topics.info, False
        self._paired_s, self._warned_s = start_s, float("-inf")
        self._images = (topics.colour, topics.depth)

    def heard(self, topic: str, now_s: float) -> None:
        self._heard_s[topic] = now_s
        self._info_came |= topic == self._info

    def paired(self, now_s: float) -> None:
        self._paired_s = now_s

    def warnings(self, now_s: float, publishers: Callable[[str], int]) -> list[str]:
        """Sentences, none where there is nothing to say or it was said just now. publishers: how many a topic has."""
        if now_s - self._paired_s < SILENT_S or now_s - self._warned_s < AGAIN_S:
            return []
        # CameraInfo may come once and never again.
        silent = [topic for topic in self._images if now_s - self._heard_s[topic] >= SILENT_S]
        silent += [self._info] if not self._info_came else []
        self._warned_s = now_s
        if not silent:
            return [f"{' and '.join(self._images)} come, but not within the slop of each other: say ?slop=SECONDS"]
        return [_silence(topic, now_s - self._heard_s[topic], publishers(topic)) for topic in silent]


def _silence(topic: str, since_s: float, publishers: int) -> str:
    nothing = f"nothing on {topic} for {since_s:.0f} s"
    if not publishers:
        return f"{nothing}: nobody publishes it; ros2 topic list has the names that there are"
    return f"{nothing}, though {publishers} publish it: do type and QoS fit (ros2 topic info --verbose {topic})?"


def _type_of(ros: Any, topic: str, topics: Topics) -> Any:
    if topic == topics.info:
        return ros.sensor_msgs.CameraInfo
    compressed = topic.rpartition("/")[2] in ("compressed", "compressedDepth")
    return ros.sensor_msgs.CompressedImage if compressed else ros.sensor_msgs.Image
