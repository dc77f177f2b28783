"""Files that are whole or absent, whatever happens while they are written."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from tracker.errors import OutputError


def write_whole(path: Path, content: str | bytes) -> None:
    """A neighbour of the file takes its place when it is complete; its folder is made where it is missing.

    Text is UTF-8. Raises OutputError where it cannot be written; what was there before is there still.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
        os.replace(partial, path)
    except OSError as error:
        with suppress(OSError):
            partial.unlink()
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
