"""What tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The recordings that are not part of the project; tests that use them carry the marker `shared_data`."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"the shared recordings are not at {SHARED_DATA}")
    return SHARED_DATA
