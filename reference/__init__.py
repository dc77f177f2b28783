"""Reference frames of an object -> its concept model.

The names below are the public ones. Those that need the tracker are loaded when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from reference.onboard import onboard, read_reference_frames

if TYPE_CHECKING:
    from reference.completion import Completion
    from reference.live import TurnedObject, first_sight
    from reference.segment import segment
    from reference.unposed import onboard_unposed, read_unposed_frames

_LATE = {
    "Completion": "reference.completion",
    "TurnedObject": "reference.live",
    "first_sight": "reference.live",
    "onboard_unposed": "reference.unposed",
    "read_unposed_frames": "reference.unposed",
    "segment": "reference.segment",
}

__all__ = [
    "Completion",
    "TurnedObject",
    "first_sight",
    "onboard",
    "onboard_unposed",
    "read_reference_frames",
    "read_unposed_frames",
    "segment",
]


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module 'reference' has no attribute {name!r}")
    return getattr(importlib.import_module(_LATE[name]), name)
