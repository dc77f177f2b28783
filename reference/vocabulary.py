"""Concepts in language: what there is to look for on an object, as short labels in a file that a person can edit."""

from __future__ import annotations

import re
import reprlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tracker.errors import ConfigError
from tracker.whole_file import write_whole
from tracker.yaml_files import read_yaml

SHIPPED = Path(__file__).with_name("vocabularies")
LONGEST_LABEL = 64
LONGEST_TEXT = 200
KEYS = ("name", "vocabularies")
KEYS_OF_A_VOCABULARY = ("category", "ids", "kind", "source", "labels")
HEADER = "# Concepts to look for on objects: short labels, all different. Edit them as you like.\n"


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """The concepts of one category of objects.

    category: what the objects are, such as "mug". labels: the L concepts, distinct whatever their case. kind: of prompt
    that they answer ("default", "geometric", "affordance", "adjective") or would. source: where they come from:
    "shipped", the name of a language model, a paper, a file. ids: the objects of a dataset that they are for.
    Raises ConfigError where a text is empty, too long or has control characters, and where there are no labels.
    """

    category: str
    labels: tuple[str, ...]
    kind: str = "default"
    source: str = "shipped"
    ids: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        named = [("category", self.category), ("kind", self.kind), ("source", self.source)]
        for what, text in [*named, *(("ids", one) for one in self.ids)]:
            if complaint := complaint_about_text(text, LONGEST_TEXT):
                raise ConfigError(f"{what}: {complaint}")
        if complaint := complaint_about_labels(self.labels):
            raise ConfigError(f"labels: {complaint}")

    @property
    def answers_to(self) -> frozenset[str]:
        """Its category and its ids, as `plain_name` writes them."""
        return frozenset(plain_name(name) for name in (self.category, *self.ids)) - {""}


@dataclass(frozen=True, slots=True)
class VocabularySet:
    """Vocabularies that belong together, such as those of a dataset's objects. Raises ConfigError where there are none
    and where two of them answer to one name."""

    name: str
    vocabularies: tuple[Vocabulary, ...]

    def __post_init__(self) -> None:
        if complaint := complaint_about_text(self.name, LONGEST_TEXT):
            raise ConfigError(f"name: {complaint}")
        if not self.vocabularies:
            raise ConfigError("vocabularies: there are none, expected at least one")
        claims = Counter(name for vocabulary in self.vocabularies for name in vocabulary.answers_to)
        if twice := sorted(name for name, times in claims.items() if times > 1):
            raise ConfigError(f"vocabularies: several answer to {_listed(twice)}, expected one for each object")

    def for_object(self, object_id: str, category: str | None = None) -> Vocabulary:
        """The vocabulary of a dataset's object, by its id ("5"), its name ("006_mustard_bottle") or its category
        ("mustard bottle"). A set of one vocabulary without ids has it for every object.

        category: what the dataset says that the object is an instance of ("mug" of "mug_daniel_norm"); it is asked for
        where there is none for the object itself. It is never guessed from the name: a camera_case is no camera.

        Raises ConfigError that lists the objects that there are.
        """
        if len(self.vocabularies) == 1 and not self.vocabularies[0].ids:
            return self.vocabularies[0]
        for wanted in map(plain_name, (object_id, *((category,) if category else ()))):
            for vocabulary in self.vocabularies:
                if wanted in vocabulary.answers_to:
                    return vocabulary
        known = (" = ".join((*vocabulary.ids, vocabulary.category)) for vocabulary in self.vocabularies)
        asked = f"object {object_id!r}{f' of category {category!r}' if category else ''}"
        raise ConfigError(f"vocabulary {self.name!r} has none for {asked}; there are {', '.join(known)}")


def plain_name(name: str) -> str:
    """A name whatever its case and whether its words are parted by spaces, hyphens or underscores."""
    return " ".join(re.split(r"[\s_-]+", name.casefold())).strip()


def complaint_about_text(text: Any, longest: int) -> str | None:
    """What is wrong with a piece of text that has to be short and on one line, None if nothing is."""
    if not isinstance(text, str):
        return f"got {reprlib.repr(text)}, expected text (in a YAML file, quotes make anything text)"
    if not text.strip():
        return "got an empty text"
    if len(text) > longest:
        return f"{reprlib.repr(text)} has {len(text)} characters, expected at most {longest}"
    if not text.isprintable() or text != text.strip():
        return f"{reprlib.repr(text)} has control characters or spaces around it"
    return None


def complaint_about_labels(labels: Any, count: int | None = None) -> str | None:
    """What is wrong with labels, None if nothing is. count: how many there have to be, None for any number."""
    if not isinstance(labels, list | tuple) or not labels:
        return f"got {reprlib.repr(labels)}, expected a list of at least one label"
    for place, label in enumerate(labels, 1):
        if complaint := complaint_about_text(label, LONGEST_LABEL):
            return f"label {place}: {complaint}"
    times = Counter(label.casefold() for label in labels)
    if twice := [label for label, number in times.items() if number > 1]:
        return f"{_listed(twice)} appears more than once, expected labels that all differ"
    if count is not None and len(labels) != count:
        return f"got {len(labels)} labels, expected exactly {count}"
    return None


def shipped_vocabularies() -> tuple[str, ...]:
    """Names of the sets that come with the project."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.yaml")))


def read_vocabulary(name_or_path: str) -> VocabularySet:
    """A shipped set by its name, or one from a YAML file by its path.

    Raises ConfigError that names the file and the place in it, or lists the shipped sets where there is no such file.
    """
    shipped = shipped_vocabularies()
    path = SHIPPED / f"{name_or_path}.yaml" if name_or_path in shipped else Path(name_or_path)
    try:
        found = path.is_file()
    except OSError as error:  # a name that no file can have
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from error
    if not found:
        raise ConfigError(f"there is no vocabulary {name_or_path!r}; expected a file, or one of {', '.join(shipped)}")
    content = read_yaml(path)
    entries = _mapping(content, KEYS, f"{path}: the file").get("vocabularies")
    if not isinstance(entries, list):
        raise ConfigError(f"{path}: vocabularies: got {reprlib.repr(entries)}, expected a list")
    source = "shipped" if path.parent == SHIPPED else path.name
    vocabularies = tuple(_vocabulary(entry, f"{path}: vocabulary {n}", source) for n, entry in enumerate(entries, 1))
    try:
        return VocabularySet(content.get("name", path.stem), vocabularies)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error


def write_vocabulary(path: str | Path, vocabularies: VocabularySet) -> None:
    """Write a set as YAML, one label a line, whole or not at all. Raises OutputError where it cannot be written."""
    path = Path(path)
    entries = [
        {key: list(value) if isinstance(value := getattr(one, key), tuple) else value for key in KEYS_OF_A_VOCABULARY}
        for one in vocabularies.vocabularies
    ]
    content = {"name": vocabularies.name, "vocabularies": entries}
    text = HEADER + yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    write_whole(path, text)


def _vocabulary(entry: Any, where: str, source: str) -> Vocabulary:
    entry = _mapping(entry, KEYS_OF_A_VOCABULARY, where)
    lists = {key: entry.get(key, []) for key in ("ids", "labels")}
    for key, value in lists.items():
        if not isinstance(value, list):
            raise ConfigError(f"{where}: {key}: got {reprlib.repr(value)}, expected a list")
    # BOP's ids are numbers, and a person would write them as such
    ids = tuple(str(one) if isinstance(one, int) and not isinstance(one, bool) else one for one in lists["ids"])
    rest = {key: entry[key] for key in ("kind", "source") if key in entry}
    try:
        return Vocabulary(entry.get("category"), tuple(lists["labels"]), **{"source": source, **rest, "ids": ids})
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error


def _mapping(content: Any, keys: tuple[str, ...], where: str) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise ConfigError(f"{where}: got {reprlib.repr(content)}, expected a mapping with {', '.join(keys)}")
    if unknown := [key for key in content if key not in keys]:
        raise ConfigError(f"{where}: there is no key {_listed(unknown)}; there are {', '.join(keys)}")
    return content


def _listed(names: list[Any]) -> str:
    return ", ".join(reprlib.repr(name) for name in names[:5])
