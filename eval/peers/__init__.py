"""What stands beside the tracker in the same table: methods of others, on the same frames, models and masks.

A method is made of the same concept models as the tracker, of which it may use the points, normals, colours and
reference views: no CAD model, and after onboarding no true pose but the one that `place` tells.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.result import TrackResult
from tracker.saliency import SaliencyBackend


class Method(Protocol):
    """Follows the objects of some models through the frames of one camera, as `tracker.pipeline.ObjectTracker` does."""

    def step(self, frame: Frame) -> tuple[TrackResult, ...]:
        """Every model's result, in their order."""
        ...

    def place(self, object_id: str, T_cam_obj: Pose, stamp_ns: int) -> None:
        """Tell where an object is at a time. A method that searches every frame anew has no use for it.

        Raises ConfigError where there is no model of the object, FrameError where the time is past.
        """
        ...


Opener = Callable[[Sequence[ConceptModel], TrackerConfig, SaliencyBackend], Method]


@dataclass(frozen=True, slots=True)
class MethodKind:
    """open: makes one. start: what it does with a pose that it is told: "needed", it cannot do without; "used";
    "ignored", it searches every frame anew. concepts: whether it uses the models' concepts, and so the backend.
    settings: for the protocol of a report, JSON-ready; empty where the run's configuration holds them."""

    open: Opener
    start: str
    concepts: bool
    settings: dict[str, Any]


def _ours() -> MethodKind:
    from tracker.pipeline import ObjectTracker

    return MethodKind(ObjectTracker, "used", True, {})


def _sift() -> MethodKind:
    from eval.peers.sift import SiftConfig, open_sift

    return MethodKind(open_sift, "ignored", False, SiftConfig().model_dump(mode="json"))


def _fpfh() -> MethodKind:
    from eval.peers.fpfh import FpfhConfig, open_fpfh

    return MethodKind(open_fpfh, "ignored", False, FpfhConfig().model_dump(mode="json"))


def _icp() -> MethodKind:
    from eval.peers.icp import IcpConfig, open_icp

    return MethodKind(open_icp, "needed", False, IcpConfig().model_dump(mode="json"))


def _colored_icp() -> MethodKind:
    from eval.peers.colored_icp import ColoredIcpConfig, open_colored_icp

    return MethodKind(open_colored_icp, "needed", False, ColoredIcpConfig().model_dump(mode="json"))


METHODS: dict[str, Callable[[], MethodKind]] = {
    "ours": _ours,
    "sift": _sift,
    "fpfh": _fpfh,
    "icp": _icp,
    "colored-icp": _colored_icp,
}


def method_kind(name: str) -> MethodKind:
    """Raises ConfigError that lists the methods that there are."""
    if name not in METHODS:
        raise ConfigError(f"there is no method {name!r}; expected one of {', '.join(METHODS)}")
    return METHODS[name]()


def open_method(name: str, models: Sequence[ConceptModel], config: TrackerConfig, backend: SaliencyBackend) -> Method:
    """The method of this name for these models. A peer uses the configuration's view and cloud, none of the rest.

    Raises ConfigError that lists the methods that there are.
    """
    return method_kind(name).open(models, config, backend)
