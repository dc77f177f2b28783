"""Scenes that are finished, on disk: each a folder that is whole or absent, named by what decided its content.

FOLDER/FINGERPRINT/estimates.csv  BOP's result file, which comes back bit for bit
                   unit.json      counts, times, records, reference frames, refused objects, and what decided them
                   overlay.mp4    where a video was asked for
                   frames/        where pictures were asked for
"""

from __future__ import annotations

import json
import logging
import os
import shutil
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from pydantic import TypeAdapter

from eval.bop_results import read_results, write_results
from eval.frame_record import FrameRecord
from eval.instances import ObjectInImage
from eval.summary import TrackingCounts
from eval.track_run import fingerprint_of
from eval.tracked import Tracked
from tracker.errors import OutputError
from tracker.sources.json_files import DAMAGE
from tracker.viewer import FRAMES, RECORDING, VIDEO

log = logging.getLogger(__name__)

ESTIMATES, UNIT = "estimates.csv", "unit.json"
_REFERENCES = TypeAdapter(list[ObjectInImage])
_COUNTS = TypeAdapter(dict[str, TrackingCounts])
_TIMINGS = TypeAdapter(list[dict[str, float]])
_REFUSED = TypeAdapter(dict[str, str])
_RECORDS = TypeAdapter(list[FrameRecord])


class KeptUnits:
    """What is finished, in a folder that is made with the first unit that is kept."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def names(self) -> list[str]:
        """Fingerprints of what is kept."""
        try:
            return sorted(path.name for path in self.folder.iterdir() if not path.name.startswith("."))
        except FileNotFoundError:
            return []

    def drawn(self, fingerprint: str) -> list[Path]:
        """What there is of a video, pictures and a recording for Rerun."""
        return [path for name in (VIDEO, FRAMES, RECORDING) if (path := self.folder / fingerprint / name).exists()]

    def read(self, fingerprint: str) -> Tracked | None:
        """None where it is not kept, and, with a warning, where what is kept is damaged: it is made again then."""
        folder = self.folder / fingerprint
        if not folder.is_dir():
            return None
        try:
            content = json.loads((folder / UNIT).read_text(encoding="utf-8"))
            estimates = read_results(folder / ESTIMATES)
            if fingerprint_of(content["decided_by"]) != fingerprint or len(estimates) != content["estimates"]:
                raise ValueError("it is not what was written")
            return Tracked(
                estimates=estimates,
                reference_frames=set(_REFERENCES.validate_python(content["references"])),
                counts=_COUNTS.validate_python(content["counts"]),
                timings_ms=_TIMINGS.validate_python(content["timings_ms"]),
                refused=_REFUSED.validate_python(content["refused"]),
                records=_RECORDS.validate_python(content["records"]),
            )
        except (OSError, RecursionError, *DAMAGE, OutputError) as error:
            log.warning("%s: cannot be used (%s) and is tracked again", folder, error)
            shutil.rmtree(folder, ignore_errors=True)
            return None

    def stage(self, fingerprint: str) -> Path:
        """A new folder for a unit that is being worked on; `keep` moves it into place, `discard` removes it."""
        staged = self._staged(fingerprint)
        try:
            shutil.rmtree(staged, ignore_errors=True)
            staged.mkdir(parents=True)
        except OSError as error:
            raise OutputError(f"{staged}: cannot be written ({error.strerror})") from error
        return staged

    def keep(self, decided_by: Mapping[str, object], tracked: Tracked) -> None:
        """Write a finished unit and show it under its name when it is complete. Raises OutputError."""
        fingerprint = fingerprint_of(decided_by)
        staged = self._staged(fingerprint)
        if not staged.is_dir():
            self.stage(fingerprint)
        content = {
            "decided_by": decided_by,
            "estimates": len(tracked.estimates),
            "references": sorted(tracked.reference_frames),
            "counts": {object_id: asdict(counts) for object_id, counts in tracked.counts.items()},
            "timings_ms": tracked.timings_ms,
            "refused": tracked.refused,
            "records": [asdict(record) for record in tracked.records],
        }
        write_results(staged / ESTIMATES, tracked.estimates)
        try:
            (staged / UNIT).write_text(json.dumps(content, allow_nan=False), encoding="utf-8")
            staged.rename(self.folder / fingerprint)
        except OSError as error:
            if not (self.folder / fingerprint).is_dir():  # else another run was first, with the same
                raise OutputError(f"{self.folder / fingerprint}: cannot be written ({error.strerror})") from error
            shutil.rmtree(staged, ignore_errors=True)

    def discard(self, fingerprint: str) -> None:
        """Remove what was staged and did not come to be kept, and the folder where it holds nothing else."""
        shutil.rmtree(self._staged(fingerprint), ignore_errors=True)
        if self.folder.is_dir() and not any(self.folder.iterdir()):
            self.folder.rmdir()

    def _staged(self, fingerprint: str) -> Path:
        return self.folder / f".{fingerprint}.{os.getpid()}.partial"
