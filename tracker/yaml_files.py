"""YAML on disk: settings, presets and vocabularies, which people write and hand on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from tracker.errors import ConfigError

LARGEST_FILE = 1_000_000  # bytes; none that a person writes has a tenth of it, and the parser is slow


def read_yaml(path: Path) -> Any:
    """Plain values, nothing that could run. Raises ConfigError that names the file where it cannot be read."""
    try:
        with path.open("rb") as file:
            raw = file.read(LARGEST_FILE + 1)
        if len(raw) > LARGEST_FILE:
            raise ConfigError(f"{path}: larger than such a file can be, expected at most {LARGEST_FILE} bytes")
        return yaml.safe_load(raw.decode())
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read as YAML ({error.strerror})") from error
    except (yaml.YAMLError, RecursionError, ValueError, TypeError, LookupError, AttributeError) as error:
        # the last four for values that are not what their tags or looks say, such as 2001-99-99 or !!bool x
        raise ConfigError(f"{path}: cannot be read as YAML ({error!s:.500})") from error
