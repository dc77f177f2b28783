"""The SDK, the cameras that are connected, and the streams of one."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tracker.errors import MissingExtraError, SourceError
from tracker.sources.realsense.request import Options
from tracker.system_libraries import system_libraries_of

USUAL_SIZE, USUAL_FPS = (640, 480), 30
# by preference: what needs no conversion first; the SDK's name -> `raw_frame.COLOUR_ORDERS`
COLOUR_FORMATS: Mapping[str, str] = {
    "rgb8": "rgb", "bgr8": "bgr", "rgba8": "rgba", "bgra8": "bgra", "yuyv": "yuyv", "uyvy": "uyvy", "y8": "gray",
}  # fmt: skip
Profile = Any  # the SDK is not there when types are checked


def load_sdk() -> Any:
    """The module pyrealsense2. Raises MissingExtraError that names the extra, MissingLibraryError without libusb."""
    try:
        with system_libraries_of("pyrealsense2"):
            return importlib.import_module("pyrealsense2")
    except ImportError as error:
        raise MissingExtraError(
            f"a RealSense camera or recording needs pyrealsense2 ({error}): pip install 'conceptrack[realsense]'"
        ) from error


class Finder:
    """Finds the camera anew at every call: one that was unplugged and comes back is another device to the SDK."""

    def __init__(self, sdk: Any, serial: str | None, name: str) -> None:
        self._sdk, self._serial, self._name = sdk, serial, name

    def __call__(self) -> Any:
        """The device. Raises SourceError that lists the cameras that are connected where it is not one of them."""
        try:
            found = {self._info(device): device for device in self._sdk.context().query_devices()}
        except RuntimeError as error:
            raise SourceError(f"{self._name}: the cameras cannot be listed ({error})") from error
        if self._serial is None and len(found) == 1:
            return next(iter(found.values()))
        if self._serial in found:
            return found[self._serial]
        connected = ", ".join(found) or "none"
        if self._serial is None and found:
            raise SourceError(f"{self._name}: there are several cameras, name one of them: {connected}")
        wanted = f"no camera {self._serial!r}" if self._serial else "no camera"
        raise SourceError(f"{self._name}: there is {wanted}; connected: {connected}")

    def _info(self, device: Any) -> str:
        serial_number = self._sdk.camera_info.serial_number
        return device.get_info(serial_number) if device.supports(serial_number) else "without a serial number"


@dataclass(frozen=True, slots=True)
class Streams:
    """The colour and the depth stream of a device, and what is opened for them: sensors with their profiles.

    depth_unit_m: as the depth sensor states it for all frames, None where it does not.
    """

    colour: Profile
    depth: Profile
    opened: tuple[tuple[Any, tuple[Profile, ...]], ...]
    depth_unit_m: float | None

    def start(self, on_frame: Callable[[Any], None]) -> None:
        """on_frame is called in threads of the SDK. Raises the SDK's RuntimeError where a stream cannot be opened."""
        for sensor, profiles in self.opened:
            sensor.open(list(profiles))
        for sensor, _ in self.opened:
            sensor.start(on_frame)

    def stop(self) -> None:
        """After it nothing is called any more. A camera that is gone cannot be stopped, which is as good."""
        for sensor, _ in self.opened:
            for end in (sensor.stop, sensor.close):
                try:
                    end()
                except RuntimeError:  # not started, or unplugged
                    continue


def choose_streams(sdk: Any, device: Any, options: Options, name: str) -> Streams:
    """The streams that fit best. Raises SourceError that lists those there are where none is as it is asked for."""
    sensors = list(device.query_sensors())
    chosen: dict[str, tuple[Any, Profile]] = {}
    for stream, formats in (("depth", ("z16",)), ("color", tuple(COLOUR_FORMATS))):
        there = [
            (sensor, profile.as_video_stream_profile())
            for sensor in sensors
            for profile in sensor.get_stream_profiles()
            if profile.stream_type() == getattr(sdk.stream, stream)
        ]
        fitting = [(s, p) for s, p in there if p.format().name in formats and _is_asked_for(p, options)]
        if not fitting:
            listed = ", ".join(sorted({_described(p) for _, p in there})) or "none"
            asked = f"width={options.width} height={options.height} fps={options.fps}".replace("=None", "=any")
            raise SourceError(
                f"{name}: there is no {stream} stream with {asked} in {', '.join(formats)}; it has {listed}"
            )
        chosen[stream] = min(fitting, key=lambda found: _distance(found[1], formats))
    opened = tuple((s, tuple(p for owner, p in chosen.values() if owner is s)) for s in sensors)
    depth_sensor, units = chosen["depth"][0], sdk.option.depth_units
    return Streams(
        colour=chosen["color"][1],
        depth=chosen["depth"][1],
        opened=tuple((sensor, profiles) for sensor, profiles in opened if profiles),
        depth_unit_m=float(depth_sensor.get_option(units)) if depth_sensor.supports(units) else None,
    )


def _is_asked_for(profile: Profile, options: Options) -> bool:
    there = {"width": profile.width(), "height": profile.height(), "fps": profile.fps()}
    return all(getattr(options, key) in (None, value) for key, value in there.items())


def _distance(profile: Profile, formats: Sequence[str]) -> tuple[int, ...]:
    width, height = USUAL_SIZE
    size = abs(profile.width() - width) + abs(profile.height() - height)
    return size, abs(profile.fps() - USUAL_FPS), formats.index(profile.format().name)


def _described(profile: Profile) -> str:
    return f"{profile.width()}x{profile.height()} at {profile.fps()} in {profile.format().name}"
