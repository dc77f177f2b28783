"""Answers of language models, kept where a person can read and edit them."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from reference.llm import Endpoint, ask_for_labels
from reference.prompts import check_request
from reference.vocabulary import Vocabulary, VocabularySet, plain_name, read_vocabulary, write_vocabulary
from tracker.errors import OutputError

logger = logging.getLogger(__name__)


def cached_vocabulary(
    category: str,
    kind: str,
    count: int,
    endpoint: Endpoint,
    picture: np.ndarray | None = None,
    folder: str | Path | None = None,
) -> Vocabulary:
    """As `ask_for_labels`, but asked once: the answer is kept in a YAML file that a person can edit, one for each
    category, kind, count and model, and taken from there from then on.

    folder: where, None for ~/.cache/conceptrack/vocabularies (under XDG_CACHE_HOME where that is set).
    Raises ConfigError also where the file has been edited into something that is no vocabulary.
    """
    check_request(category, kind, count)
    path = Path(folder or cache_folder(os.environ)) / f"{cache_slug(category, kind, count, endpoint.model)}.yaml"
    if path.exists():
        return read_vocabulary(str(path)).for_object(category)
    vocabulary = ask_for_labels(category, kind, count, endpoint, picture)
    try:
        write_vocabulary(path, VocabularySet(category, (vocabulary,)))
    except OutputError as error:  # the answer is good, it will only be asked for again
        logger.warning("%s", error)
    return vocabulary


def cache_folder(environment: Mapping[str, str]) -> Path:
    """Where answers are kept; a relative XDG_CACHE_HOME does not count, as its specification says."""
    given = Path(environment.get("XDG_CACHE_HOME", ""))
    return (given if given.is_absolute() else Path.home() / ".cache") / "conceptrack" / "vocabularies"


def cache_slug(category: str, kind: str, count: int, model: str) -> str:
    """A file name without its ending: what can be read of all four, and a hash that tells apart what cannot. Of the
    letters a to z, digits and hyphens only, so whatever the texts are it names a file and no other folder."""
    identity = [plain_name(category), kind, count, model]
    words = re.sub(r"[^a-z0-9]+", "-", "-".join(map(str, identity)).lower()).strip("-")
    digest = hashlib.sha256(json.dumps(identity).encode()).hexdigest()
    return f"{words[:80]}-{digest[:12]}".lstrip("-")
