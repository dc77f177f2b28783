"""Orbbec cameras and their recordings, by the package pyorbbecsdk, which is imported when one is opened.

    orbbec, orbbec:SERIAL          a camera that is connected, until it is stopped
    orbbec:FILE.bag                a recording of the Orbbec viewer or SDK, once from its beginning to its end

Option depth_unit: metres per unit whatever the camera says. The SDK registers depth to colour; the two are paired by
their stamps here, as in a recording the colour may come with the depth of its neighbour.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from tracker.errors import MissingExtraError, SourceError
from tracker.sources.orbbec.streams import OrbbecCamera, OrbbecRecording
from tracker.sources.query import number, read_query

__all__ = ["OrbbecCamera", "OrbbecRecording", "open_orbbec"]

OPTIONS = {"depth_unit": number(1e-6, 1.0, "metres per unit of the depth")}


def open_orbbec(argument: str) -> OrbbecCamera | OrbbecRecording:
    """`SERIAL`, `FILE.bag` or nothing, with options.

    Raises MissingExtraError without the package, SourceError where there is no such camera or file.
    """
    target, _, query = argument.partition("?")
    name = f"orbbec:{argument}" if target else f"orbbec{argument}"
    unit_m = read_query(name, query, OPTIONS).get("depth_unit")
    is_file = "/" in target or Path(target).suffix != ""
    if is_file and not Path(target).is_file():
        raise SourceError(f"{target}: no such recording")
    sdk = _sdk()
    return OrbbecRecording(sdk, Path(target), name, unit_m) if is_file else OrbbecCamera(sdk, target, name, unit_m)


def _sdk() -> Any:
    try:
        # Not an extra: its metadata ask for numpy below 2 and one release of open3d, neither of which it needs.
        sdk = importlib.import_module("pyorbbecsdk")
    except ImportError as error:
        raise MissingExtraError(
            f"orbbec: needs the package pyorbbecsdk2 ({error}); install it with pip install --no-deps pyorbbecsdk2"
        ) from error
    # It makes a folder Log where it runs otherwise, and a file of another kind never returns (2.1.2).
    sdk.Context.set_logger_level(sdk.OBLogLevel.NONE)
    return sdk
