"""Reference frames of an object -> its concept model."""

from __future__ import annotations

from reference.onboard import onboard, read_reference_frames

__all__ = ["onboard", "read_reference_frames"]
