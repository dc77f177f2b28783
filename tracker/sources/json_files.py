"""JSON on disk that came from elsewhere."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tracker.errors import SourceError

# What it comes to where a value is of another type or size than it should be.
DAMAGE = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError)


def read_json(path: Path) -> Any:
    """Raises SourceError that names the file where it cannot be read, or is not JSON."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SourceError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise SourceError(f"{path}: not JSON ({error})") from error
