"""One damaged input through one reader, and what may come of it."""

from __future__ import annotations

import traceback
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.fuzz.readers import READERS, Reader
from tracker.errors import TrackerError


@dataclass(frozen=True, slots=True)
class Finding:
    """What should not have come out. what: one line. trace: where it came from."""

    reader: str
    number: int
    what: str
    trace: str = ""


class Attempts:
    """Inputs of one reader, in a folder of its own, which is filled here.

    Every input follows from seed, reader and number alone, whatever was tried before.
    """

    def __init__(self, name: str, seed: int, folder: Path) -> None:
        self._name, self._seed, self._folder = name, seed, folder
        self._reader: Reader = READERS[name]
        self._reader.sample(folder)
        found = {file for pattern in self._reader.files for file in folder.glob(pattern) if file.is_file()}
        self._whole = {file: file.read_bytes() for file in sorted(found)}
        self._reader.read(folder, min(found))  # raises where the sample itself is refused
        self.refused = 0

    def damaged(self, number: int) -> tuple[Path, bytes]:
        """The file and what is in it at this input."""
        rng = np.random.default_rng((self._seed, zlib.crc32(self._name.encode()), number))
        file = list(self._whole)[rng.integers(len(self._whole))]
        return file, self._reader.damage(self._whole[file], rng)

    def __call__(self, number: int) -> Finding | None:
        """None where it was taken, or refused as it should be."""
        file, content = self.damaged(number)
        with _replaced(file, content, self._whole[file]):
            try:
                self._reader.read(self._folder, file)
            except self._reader.refusal as error:
                self.refused += 1
                if not self._names(str(error), file):
                    return Finding(self._name, number, f"does not name {file.name}: {error!s:.400}", where_from(error))
            except Exception as error:  # whatever it is, it is what is looked for
                return Finding(self._name, number, f"{error!r:.400} from {file.name}", where_from(error))
        return None

    def _names(self, text: str, file: Path) -> bool:
        """The file, or the place in the recording that it belongs to. An answer of a language model has no name."""
        return self._reader.refusal is not TrackerError or file.name in text or str(self._folder) in text


@contextmanager
def _replaced(file: Path, content: bytes, whole: bytes) -> Iterator[None]:
    file.write_bytes(content)
    try:
        yield
    finally:
        file.write_bytes(whole)


def where_from(error: Exception) -> str:
    return "".join(traceback.format_exception(error)[-12:])
