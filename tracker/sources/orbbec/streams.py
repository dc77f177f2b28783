"""A camera that is connected, and a recording: what the SDK shows, paired and made into frames."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from tracker.errors import SourceError
from tracker.frame import Frame
from tracker.sources.approximate_time import Pair, Pairing
from tracker.sources.orbbec.conversion import Converter, Picture, colour_of, depth_of, profile_of
from tracker.sources.tolerance import Tolerance

WAIT_MS = 1000
MOST_SILENT = 5  # waits in a row that end without pictures
WITHIN_PERIODS = 0.5  # of the depth stream: a picture of the neighbour is a whole one away


class OrbbecCamera:
    """Frames as they come, until `stop`. serial: empty for the only camera that there is."""

    def __init__(self, sdk: Any, serial: str, name: str, depth_unit_m: float | None = None) -> None:
        self.name = name
        self._sdk, self._unit_m = sdk, depth_unit_m
        self._device = _asked(sdk, name, lambda: _find_device(sdk, serial, name))
        self._stopped = threading.Event()
        self._tolerance = Tolerance(name)

    def stop(self) -> None:
        """Ends the frames soon, from any thread."""
        self._stopped.set()

    @property
    def left_out(self) -> Mapping[str, int]:
        """How many frames never came out, by what became of them."""
        return {"left out: they could not be right": self._tolerance.refused}

    def __iter__(self) -> Iterator[Frame]:
        """Raises SourceError where the camera cannot be opened or shows nothing usable."""
        convert, index = Converter(self.name, self._unit_m), 0
        for frames in _shown(self._sdk, self._device, self.name, self._stopped.is_set):
            for pair in frames:
                frame = self._tolerance.made(lambda pair=pair, index=index: convert(pair, index))
                index += 1
                if frame is not None:
                    yield frame
            if self._stopped.is_set():
                return


class OrbbecRecording:
    """The frames of a file. It plays as fast as it was recorded: what comes while nobody looks may be dropped.

    Raises SourceError where the file is no recording.
    """

    def __init__(self, sdk: Any, path: Path, name: str, depth_unit_m: float | None = None) -> None:
        self.name = name
        self._sdk, self._path, self._unit_m = sdk, path, depth_unit_m
        self._context = sdk.Context()  # the SDK's own, for as long as something of it is open
        self._opened()  # that it is none is told at once

    def __iter__(self) -> Iterator[Frame]:
        device, stopped = self._opened(), self._sdk.OBPlaybackStatus.STOPPED
        convert, index = Converter(self.name, self._unit_m), 0
        for frames in _shown(self._sdk, device, self.name, lambda: device.get_playback_status() == stopped):
            for pair in frames:
                yield convert(pair, index)
                index += 1

    def _opened(self) -> Any:
        return _asked(self._sdk, str(self._path), lambda: self._sdk.PlaybackDevice(str(self._path)))


def _shown(sdk: Any, device: Any, name: str, ended: Callable[[], bool]) -> Iterator[list[Pair[Picture]]]:
    """The pairs that each set of frames decides. ended: asked where none comes; the last pictures of a file come after
    its end. Raises SourceError where it has not ended and still nothing comes."""
    align = sdk.AlignFilter(sdk.OBStreamType.COLOR_STREAM)
    pairing: Pairing[Picture] | None = None
    pipeline, silent = _asked(sdk, name, lambda: _started(sdk, device)), 0
    try:
        while silent < MOST_SILENT:
            frames = _asked(sdk, name, lambda: pipeline.wait_for_frames(WAIT_MS))
            if frames is None and ended():
                yield pairing.finish() if pairing else []
                return
            silent = silent + 1 if frames is None else 0
            if frames is None or frames.get_color_frame() is None or frames.get_depth_frame() is None:
                continue  # the first ones often lack one
            pairing = pairing or _pairing(frames.get_depth_frame())
            aligned = _asked(sdk, name, lambda frames=frames: align.process(frames))
            if aligned is not None:
                yield _added(pairing, frames.get_color_frame(), aligned.as_frame_set().get_depth_frame(), name)
        raise SourceError(f"{name}: no pictures for {MOST_SILENT * WAIT_MS / 1000:g} s")
    finally:
        pipeline.stop()


def _pairing(depth: Any) -> Pairing[Picture]:
    within_ns = round(WITHIN_PERIODS * 1e9 / max(profile_of(depth).get_fps(), 1))
    return Pairing(within_ns, least_gap_ns=within_ns)


def _added(pairing: Pairing[Picture], colour: Any, depth: Any, name: str) -> list[Pair[Picture]]:
    colour_ns, depth_ns = (int(frame.get_timestamp_us()) * 1000 for frame in (colour, depth))
    pairs = pairing.add(0, colour_ns, colour_of(colour, name))
    return pairs + pairing.add(1, depth_ns, depth_of(depth))


def _started(sdk: Any, device: Any) -> Any:
    pipeline, config = sdk.Pipeline(device), sdk.Config()
    for sensor in (sdk.OBSensorType.COLOR_SENSOR, sdk.OBSensorType.DEPTH_SENSOR):
        config.enable_stream(sensor)
    config.set_frame_aggregate_output_mode(sdk.OBFrameAggregateOutputMode.FULL_FRAME_REQUIRE)
    pipeline.start(config)
    return pipeline


def _find_device(sdk: Any, serial: str, name: str) -> Any:
    devices = sdk.Context().query_devices()
    serials = [devices.get_device_serial_number_by_index(k) for k in range(devices.get_count())]
    if serial in serials or (not serial and len(serials) == 1):
        return devices.get_device_by_index(serials.index(serial) if serial else 0)
    several = "; say which: orbbec:SERIAL" if len(serials) > 1 else ""
    raise SourceError(f"{name}: no such camera; connected are {', '.join(serials) or 'none'}{several}")


def _asked(sdk: Any, where: str, call: Callable[[], Any]) -> Any:
    """What the SDK answers; what it raises becomes a SourceError, which begins with `where`."""
    try:
        return call()
    except (sdk.OBError, RuntimeError) as error:
        raise SourceError(f"{where}: {error}") from error
