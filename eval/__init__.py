"""Running the tracker on datasets with known poses, and scoring its results or anybody's."""

from __future__ import annotations
