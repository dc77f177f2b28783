"""What stands beside the tracker in the same table: methods of others, on the same frames, models and masks.

A method is made of the same concept models as the tracker, of which it may use the points, normals, colours and
reference views: no CAD model, and after onboarding no true pose but the one that `place` tells.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import ConfigError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.result import TrackResult
from tracker.saliency import SaliencyBackend
from tracker.system_libraries import system_libraries_of


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
    settings: JSON-ready; empty where the run's configuration holds them."""

    open: Opener
    start: Literal["needed", "used", "ignored"]
    concepts: bool
    settings: dict[str, Any]

    def stated(
        self, config: TrackerConfig, backend: SaliencyBackend, vocabulary: str | None, initialisation: str
    ) -> dict[str, object]:
        """What a report's protocol says of the method and its start, JSON-ready."""
        unused = "not used by the method"
        told = "gt: each object's true pose is told once a scene, in the first frame where it is visible"
        if initialisation != "gt":
            told = "estimated: no true pose is given after onboarding"
        elif self.start == "ignored":
            told += "; the method searches every frame anew and ignores it"
        return {
            "method_settings": self.settings or "the run's configuration",
            "backend": f"{backend.name} ({backend.fingerprint})" if self.concepts else unused,
            "weights": backend.weights if self.concepts else unused,
            "vocabulary": (vocabulary or "the backend's own") if self.concepts else unused,
            "prior": "on" if self.start == "needed" or (self.start == "used" and config.prior) else "off",
            "initialisation": told,
        }


def _ours() -> MethodKind:
    from tracker.pipeline import ObjectTracker

    return MethodKind(ObjectTracker, "used", True, {})


def _sift() -> MethodKind:
    with system_libraries_of("open3d"):
        from eval.peers.sift import SiftConfig, open_sift

    return MethodKind(open_sift, "ignored", False, SiftConfig().model_dump(mode="json"))


def _fpfh() -> MethodKind:
    with system_libraries_of("open3d"):
        from eval.peers.fpfh import FpfhConfig, open_fpfh

    return MethodKind(open_fpfh, "ignored", False, FpfhConfig().model_dump(mode="json"))


def _icp() -> MethodKind:
    with system_libraries_of("open3d"):
        from eval.peers.icp import IcpConfig, open_icp

    return MethodKind(open_icp, "needed", False, IcpConfig().model_dump(mode="json"))


def _colored_icp() -> MethodKind:
    with system_libraries_of("open3d"):
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
