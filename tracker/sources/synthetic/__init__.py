"""The world of the demo and of the tests: `synthetic:tabletop?frames=60&seed=1&size=320x240&noise=1.0`.

Everything is drawn and built by this package; nothing is downloaded. Poses are exact, the camera is not.
"""

from __future__ import annotations

from tracker.sources.synthetic.request import read_request
from tracker.sources.synthetic.scene import SyntheticScene
from tracker.sources.synthetic.things.objects import ObjectShape

__all__ = ["ObjectShape", "SyntheticScene", "open_scene"]


def open_scene(argument: str) -> SyntheticScene:
    """`NAME` or `NAME?OPTION=VALUE&..` -> the scene.

    Options: frames, seed, size (WIDTHxHEIGHT), noise (0 is clean, 1 a usual camera), object (in scenes of one object).
    Raises SourceError that lists what there is where scene, option or value is not known.
    """
    return SyntheticScene(f"synthetic:{argument}", read_request(argument))
