"""Every reader of files: what it reads, how that is damaged, and how everything in it is asked for."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from eval.bop_results import read_results
from eval.calibration.rows import read_poses
from eval.datasets import open_dataset
from eval.datasets.bop import BopDataset
from eval.kept_units import KeptUnits
from eval.pairs.pair_lists import read_pairs
from eval.preset import read_preset
from eval.track_run import fingerprint_of
from reference.prompts import labels_in
from reference.vocabulary import read_vocabulary
from tests.fuzz import samples
from tests.fuzz.damage import Damage, damaged
from tests.fuzz.formats import changed_mat, changed_model, changed_ply, changed_png, changed_sqlite
from tests.fuzz.trees import changed_json, changed_yaml
from tests.fuzz.words import reworded
from tracker.concept import ConceptModel
from tracker.config import read_config
from tracker.errors import TrackerError
from tracker.saved_run import SavedRun
from tracker.sources import FrameSource, PosedSource, open_source
from tracker.sources.image_files import read_depth_m, read_labels, read_mask, read_rgb


@dataclass(frozen=True, slots=True)
class Reader:
    """sample: fills a folder. files: patterns of those in it of which one is damaged at a time. read: of the folder and
    the damaged file. refusal: what it may raise."""

    sample: Callable[[Path], None]
    files: tuple[str, ...]
    damage: Damage
    read: Callable[[Path, Path], object]
    refusal: type[Exception] = TrackerError


def _dataset(kind: str, folder: Path, file: Path) -> None:  # noqa: ARG001
    dataset, seen = open_dataset(f"{kind}:{folder}"), set()
    for scene_id in dataset.scene_ids:
        dataset.image_ids(scene_id)
        seen |= {target.object_id for target in dataset.targets(scene_id)}
        _source(dataset.scene(scene_id))
    for object_id in seen:
        dataset.object_with(dataset.number(object_id))
        dataset.model(object_id).symmetries.motions()


def _bop_models(folder: Path, file: Path) -> None:  # noqa: ARG001
    dataset = BopDataset(folder)
    dataset.targets(3)
    for object_id in ("4", "7"):
        dataset.model(object_id).symmetries.motions()


def _source(source: FrameSource | PosedSource) -> None:
    frames: Iterable = source
    for _ in frames:
        pass
    for object_id in getattr(source, "object_ids", ()):
        source.sightings(object_id)  # pyright: ignore[reportAttributeAccessIssue]


def _opened(name: str, folder: Path, file: Path) -> None:  # noqa: ARG001
    _source(open_source(name.format(folder)))


def _model(folder: Path, file: Path) -> None:  # noqa: ARG001
    model = ConceptModel.load(file)
    for label in model.labels:
        model.locate(label)


def _picture(folder: Path, file: Path) -> None:  # noqa: ARG001
    {"depth": partial(read_depth_m, metres_per_unit=0.001), "colour": read_rgb, "labels": read_labels}[file.stem](file)
    read_mask(file)


def _unit(folder: Path, file: Path) -> None:  # noqa: ARG001
    name = fingerprint_of(samples.DECIDED_BY)
    shutil.copytree(folder / "unit", folder / name)  # what is damaged is removed
    kept = KeptUnits(folder).read(name)
    shutil.rmtree(folder / name, ignore_errors=True)
    if kept:
        [(record.confidence < 1, record.state.upper(), record.scene_id + 1) for record in kept.records]
        [counts + counts for counts in kept.counts.values()]
        [sum(times.values()) for times in kept.timings_ms]
        [why.upper() for why in kept.refused.values()]


def _bop(*files: str, damage: Damage = changed_json) -> Reader:
    return Reader(samples.bop, files, damage, partial(_dataset, "bop"))


READERS: dict[str, Reader] = {
    "bop-truth": _bop("test/*/scene_gt.json"),
    "bop-camera": _bop("test/*/scene_camera.json"),
    "bop-info": _bop("test/*/scene_gt_info.json"),
    "bop-models-info": Reader(samples.bop, ("models/models_info.json",), changed_json, _bop_models),
    "bop-targets": Reader(samples.bop, ("test_targets_bop19.json",), changed_json, _bop_models),
    "bop-ply": Reader(samples.bop, ("models/*.ply",), changed_ply, _bop_models),
    "bop-pictures": _bop("test/*/*/*.png", damage=changed_png),
    "bop-csv": Reader(samples.results, ("*.csv",), reworded, lambda _, file: read_results(file)),
    "pair-list": Reader(
        samples.pairs, ("pairs.csv",), reworded, lambda folder, file: read_pairs(file, BopDataset(folder / "bop"))
    ),
    "ycb-video-mat": Reader(samples.ycb_video, ("data/*/*.mat",), changed_mat, partial(_dataset, "ycb-video")),
    "ycb-video-text": Reader(
        samples.ycb_video, ("*.txt", "*/*.txt", "models/*/*"), reworded, partial(_dataset, "ycb-video")
    ),
    "nocs-text": Reader(samples.nocs, ("**/*.txt", "**/*.obj"), reworded, partial(_dataset, "nocs")),
    "picture": Reader(samples.pictures, ("*",), changed_png, _picture),
    "tum": Reader(samples.tum, ("*.txt",), reworded, partial(_opened, "tum:{}")),
    "tum-associations": Reader(samples.associated, ("associations.txt",), reworded, partial(_opened, "tum:{}")),
    "folder": Reader(
        samples.pictures_in_a_folder, ("*.txt", "annotated_poses/*.txt"), reworded, partial(_opened, "folder:{}")
    ),
    "concept-model": Reader(samples.concept_model, ("*.concept",), changed_model, _model),
    "config": Reader(samples.settings, ("config.yaml",), changed_yaml, lambda _, file: read_config(file)),
    "preset": Reader(samples.settings, ("preset.yaml",), changed_yaml, lambda _, file: read_preset(str(file))),
    "vocabulary": Reader(
        samples.vocabulary, ("*.yaml",), changed_yaml, lambda _, file: read_vocabulary(str(file)).vocabularies
    ),
    "language-model": Reader(
        samples.answer, ("*",), reworded, lambda _, file: labels_in(file.read_text(errors="replace"), 4), ValueError
    ),
    "run": Reader(samples.saved_run, ("run.json",), changed_json, lambda folder, _: SavedRun.load(folder)),
    "calibration": Reader(samples.judged, ("poses.json",), changed_json, lambda _, file: read_poses(file)),
    "kept-unit": Reader(samples.kept_unit, ("unit/unit.json",), changed_json, _unit),
    "bag-sqlite3": Reader(
        partial(samples.bag, "sqlite3"), ("recording/*.db3",), changed_sqlite, partial(_opened, "rosbag:{}/recording")
    ),
    "bag-metadata": Reader(
        partial(samples.bag, "sqlite3"), ("recording/*.yaml",), changed_yaml, partial(_opened, "rosbag:{}/recording")
    ),
    "bag-mcap": Reader(
        partial(samples.bag, "mcap"), ("recording/*.mcap",), damaged, partial(_opened, "rosbag:{}/recording")
    ),
    "bag-ros1": Reader(partial(samples.bag, "ros1"), ("*.bag",), damaged, partial(_opened, "rosbag:{}/recording.bag")),
}
