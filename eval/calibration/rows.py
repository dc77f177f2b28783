"""Poses that were judged: what spoke for each, and whether it is right. Kept in a file, a fit can be repeated."""

from __future__ import annotations

import json
import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from eval.environment import environment
from eval.track_run import code_fingerprint
from tracker.confidence import Grounds
from tracker.errors import ConfigError
from tracker.frame import Mask
from tracker.geometry import Floats
from tracker.sources.json_files import DAMAGE
from tracker.whole_file import write_whole

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class JudgedPose:
    """Of one object in one frame. scene: which kind. run: which tracking of which scene, among all."""

    scene: str
    run: str
    object_id: str
    index: int
    right: bool
    grounds: Grounds


@dataclass(frozen=True, slots=True, eq=False)
class TrainingSet:
    """N rows: their measures (N, M), whether they are right (N,), their weights (N,), and of which kind of scene and
    which object they are (N,)."""

    measures: Floats
    right: Mask
    weights: Floats
    scenes: np.ndarray
    object_ids: np.ndarray


def training_set(poses: Sequence[JudgedPose]) -> TrainingSet:
    """An object in a run has the same weight as any other, whether it has few poses or many: those of a run are alike.

    Raises ConfigError where there is no pose.
    """
    if not poses:
        raise ConfigError("there is no pose to fit to")
    counts = Counter((pose.run, pose.object_id) for pose in poses)
    return TrainingSet(
        measures=np.stack([pose.grounds.measures() for pose in poses]),
        right=np.array([pose.right for pose in poses], bool),
        weights=np.array([1 / counts[pose.run, pose.object_id] for pose in poses]),
        scenes=np.array([pose.scene for pose in poses]),
        object_ids=np.array([pose.object_id for pose in poses]),
    )


def write_poses(path: Path, protocol: Mapping[str, Any], poses: Sequence[JudgedPose]) -> None:
    """As JSON, whole or not at all. Raises OutputError."""
    content = {
        "protocol": dict(protocol),
        "code": code_fingerprint(),
        "environment": environment(),
        "poses": [asdict(pose) for pose in poses],
    }
    write_whole(path, json.dumps(content, allow_nan=False) + "\n")


def read_poses(path: Path) -> list[JudgedPose]:
    """Warns where other code has found the poses: it may have measured what spoke for them in another way.

    Raises ConfigError that names the file where it cannot be read, or is of something else.
    """
    try:
        content = json.loads(path.read_text())
        poses = TypeAdapter(list[JudgedPose]).validate_python(content["poses"])
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error})") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise ConfigError(f"{path}: poses.{where}: {first['msg']}; expected what --json wrote") from error
    except (RecursionError, *DAMAGE) as error:
        raise ConfigError(f"{path}: expected a JSON file that --json wrote, with 'poses' ({error!r})") from error
    if content.get("code") != code_fingerprint():
        log.warning("%s: other source code than this has found its poses; track anew for weights of this one", path)
    return poses
