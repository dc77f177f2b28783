"""Poses in the formats of the field, each a file or a folder beside poses.jsonl. A frame without a pose writes nothing.

    ob_in_cam/NAME.txt      the 4x4 matrix T_cam_obj of every frame, as FoundationPose writes it; NAME is the picture's,
                            or its number; where there are several objects ob_in_cam/OBJECT/NAME.txt
    tum/OBJECT.txt          a trajectory, `stamp tx ty tz qx qy qz qw` a frame: seconds, and T_cam_obj in metres
    results.csv             BOP's rows; scene and image are the dataset's, else scene 1 and the number of the frame

https://github.com/NVlabs/FoundationPose/blob/main/run_demo.py
https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from tracker.bop_rows import HEADER, Estimate, as_row, check_estimates
from tracker.errors import ConfigError
from tracker.frame import Provenance
from tracker.geometry import Pose
from tracker.result import TrackResult

SCENE_WITHOUT_NUMBER = 1


class MatrixFiles:
    """A file a frame and object. object_ids: all that there are."""

    def __init__(self, folder: Path, object_ids: Sequence[str]) -> None:
        _require_file_names("ob-in-cam", object_ids)
        root, several = folder / "ob_in_cam", len(object_ids) > 1
        self._folders = {object_id: root / object_id if several else root for object_id in object_ids}
        for path in self._folders.values():
            path.mkdir(parents=True)

    def add(self, frame_index: int, provenance: Provenance, results: Sequence[TrackResult]) -> None:
        name = provenance.name or f"{frame_index:06d}"
        for result, pose in _found(results):
            rows = (" ".join(repr(float(value)) for value in row) for row in pose.matrix)
            (self._folders[result.object_id] / f"{name}.txt").write_text("\n".join(rows) + "\n")


class Trajectories:
    """A file an object, written to as the frames come."""

    def __init__(self, folder: Path, object_ids: Sequence[str]) -> None:
        _require_file_names("tum", object_ids)
        self._files = {object_id: folder / "tum" / f"{object_id}.txt" for object_id in object_ids}
        (folder / "tum").mkdir()
        for object_id, path in self._files.items():
            path.write_text(f"# {object_id} in camera coordinates: stamp tx ty tz qx qy qz qw\n")

    def add(self, frame_index: int, provenance: Provenance, results: Sequence[TrackResult]) -> None:  # noqa: ARG002
        for result, pose in _found(results):
            seconds, rest_ns = divmod(result.stamp_ns, 10**9)  # more digits than a float holds
            w, *xyz = pose.quaternion_wxyz
            numbers = " ".join(repr(float(value)) for value in (*pose.translation_m, *xyz, w))
            with self._files[result.object_id].open("a") as file:
                file.write(f"{seconds}.{rest_ns:09d} {numbers}\n")


class BopRows:
    """One file, written to as the frames come. A row's time is that of all objects of its image together."""

    def __init__(self, folder: Path, object_ids: Sequence[str]) -> None:
        named = [object_id for object_id in object_ids if not (object_id.isascii() and object_id.isdigit())]
        if named:
            raise ConfigError(
                f"--write bop: BOP's rows have numbers for objects, a model is of {named[0]!r}; make it of an object "
                "that is called by its number (--object of python -m reference)"
            )
        self._path = folder / "results.csv"
        self._path.write_text(HEADER)

    def add(self, frame_index: int, provenance: Provenance, results: Sequence[TrackResult]) -> None:
        scene_id, image_id = provenance.bop_image or (SCENE_WITHOUT_NUMBER, frame_index)
        time_s = sum(result.timings_ms["total"] for result in results) / 1000
        estimates = [
            Estimate(scene_id, image_id, int(result.object_id), result.confidence, pose, time_s)
            for result, pose in _found(results)
        ]
        check_estimates(self._path, estimates)
        with self._path.open("a") as file:
            file.writelines(as_row(estimate) for estimate in estimates)


FORMATS: dict[str, Callable[[Path, Sequence[str]], MatrixFiles | Trajectories | BopRows]] = {
    "ob-in-cam": MatrixFiles,
    "tum": Trajectories,
    "bop": BopRows,
}


def open_pose_files(
    formats: Sequence[str], folder: Path, object_ids: Sequence[str]
) -> list[MatrixFiles | Trajectories | BopRows]:
    """A writer a format, each once. Raises ConfigError where a format does not exist or cannot name the objects."""
    unknown = [name for name in formats if name not in FORMATS]
    if unknown:
        raise ConfigError(f"no format {unknown[0]!r} of poses; there are {', '.join(FORMATS)}")
    return [FORMATS[name](folder, object_ids) for name in dict.fromkeys(formats)]


def _found(results: Iterable[TrackResult]) -> list[tuple[TrackResult, Pose]]:
    return [(result, result.pose) for result in results if result.pose is not None]


def _require_file_names(name: str, object_ids: Iterable[str]) -> None:
    for object_id in object_ids:
        if Path(object_id).name != object_id or object_id in ("", "..") or "\0" in object_id:
            raise ConfigError(f"--write {name}: object {object_id!r} cannot be the name of a file")
