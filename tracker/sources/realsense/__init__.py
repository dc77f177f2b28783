"""Intel RealSense cameras and their recordings: `realsense`, `realsense:SERIAL`, `realsense:FILE.db3`, `.bag`.

Options: `realsense:SERIAL?width=640&height=480&fps=30&filters=spatial,temporal,hole&depth_unit=0.0001&reconnect=60`,
of a recording filters and depth_unit. pyrealsense2 (extra `realsense`) is imported when one is opened.
"""

from __future__ import annotations

from tracker.sources.realsense.camera import RealSenseCamera
from tracker.sources.realsense.devices import Finder, load_sdk
from tracker.sources.realsense.playback import RealSenseFile
from tracker.sources.realsense.request import read_request

__all__ = ["RealSenseCamera", "RealSenseFile", "open_realsense"]


def open_realsense(argument: str) -> RealSenseCamera | RealSenseFile:
    """`""`, `SERIAL` or `FILE`, each with `?OPTION=VALUE&..`, -> the source.

    Raises MissingExtraError without pyrealsense2, and SourceError where there is no such camera (it lists those that
    there are), no such file, another kind of file, or no such option.
    """
    name = f"realsense:{argument}" if argument else "realsense"
    request = read_request(argument)
    sdk = load_sdk()
    if request.file is not None:
        return RealSenseFile(sdk, request.file, request.options, name)
    find = Finder(sdk, request.serial, name)
    find()  # one that is not there is told at once
    return RealSenseCamera(sdk, find, request.options, name)
