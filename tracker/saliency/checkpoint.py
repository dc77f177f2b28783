"""Where a network's weights are: in a folder, in the cache, or on the hub, from where they are fetched on request."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tracker.errors import ConfigError
from tracker.sources.json_files import DAMAGE

logger = logging.getLogger(__name__)

FILES = ("*.json", "*.safetensors", "*.model", "*.txt")  # nothing that could hold code
RANDOM = "random_weights"  # key in config.json of weights that mean nothing, so that a report can say so
BLOCKS, BLOCK_BYTES = 64, 4096  # of a weight file that go into its identity


@dataclass(frozen=True, slots=True)
class Published:
    """A model on the hub. gigabytes: to download."""

    name: str
    gigabytes: float


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """Weights on this machine. folder: with config.json, safetensors and a tokenizer. config: that file's content.
    identity: alike for copies of the same weights, and for no others. called: what a report calls them."""

    folder: Path
    config: Mapping[str, Any]
    identity: str
    called: str


def find_checkpoint(
    weights: str | None, sizes: Mapping[str, Published], default: str, model_types: Sequence[str]
) -> Checkpoint:
    """weights: a size, a name on the hub or a folder; None is the default size.

    Raises ConfigError where there are no such weights, or where they are of another architecture.
    """
    published = sizes.get(weights or default)
    name = published.name if published else str(weights)
    folder = Path(name).expanduser()
    if not folder.is_dir():
        if published is None and (name.count("/") != 1 or name.startswith((".", "/", "~"))):
            raise ConfigError(
                f"there are no weights {name!r}: expected a folder, a name on the hub, or one of {', '.join(sizes)}"
            )
        folder = _from_hub(name, published.gigabytes if published else None)
    return _checked(folder, name, model_types)


def _from_hub(name: str, gigabytes: float | None) -> Path:
    from huggingface_hub import snapshot_download
    from huggingface_hub.errors import HfHubHTTPError, HFValidationError, LocalEntryNotFoundError, OfflineModeIsEnabled

    size = f"about {gigabytes:g} GB" if gigabytes else "of unknown size"
    try:
        return Path(snapshot_download(name, local_files_only=True, allow_patterns=list(FILES)))
    except LocalEntryNotFoundError:
        logger.warning("fetching %s, %s", name, size)
    except HFValidationError as error:
        raise ConfigError(f"{name!r} is neither a folder nor a name on the hub ({error})") from error
    try:
        return Path(snapshot_download(name, allow_patterns=list(FILES)))
    except (HfHubHTTPError, LocalEntryNotFoundError, OfflineModeIsEnabled, OSError) as error:
        raise ConfigError(
            f"the weights {name} ({size}) are not on this machine and cannot be fetched now "
            f"({type(error).__name__}); where there is a network, run: hf download {name}"
        ) from error


def _checked(folder: Path, name: str, model_types: Sequence[str]) -> Checkpoint:
    path = folder / "config.json"
    try:
        config = json.loads(path.read_text(encoding="utf-8"))
        model_type = config["model_type"]
    except (OSError, RecursionError, *DAMAGE) as error:
        raise ConfigError(f"{path}: not the configuration of a model ({error!r})") from error
    if model_type not in model_types:
        raise ConfigError(f"{folder}: weights of a {model_type!r}, expected {' or '.join(map(repr, model_types))}")
    files = sorted(folder.rglob("*.safetensors"))
    if not files:
        raise ConfigError(f"{folder}: has no weights, expected files that end in .safetensors")
    digest = hashlib.sha256(path.read_bytes())
    for file in files:
        _sample(file, digest)
    called = f"random weights ({name})" if config.get(RANDOM) else name
    return Checkpoint(folder, config, digest.hexdigest(), called)


def _sample(file: Path, digest: Any) -> None:
    """Size and some blocks, evenly spread: a whole file of gigabytes would take longer than the tracking."""
    size = file.stat().st_size
    digest.update(str(size).encode())
    with file.open("rb") as content:
        for k in range(BLOCKS):
            content.seek(k * max(size - BLOCK_BYTES, 0) // (BLOCKS - 1))
            digest.update(content.read(BLOCK_BYTES))
