"""Reference frames of an object -> its concept model."""

from __future__ import annotations
