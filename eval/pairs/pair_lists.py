"""Lists of pairs, written and read back.

A list has a line a pair, in the format of Oryon's `fixed_split/*/instance_list.txt` (Corsetti et al., CVPR 2024,
https://github.com/jcorsetti/oryon), which has no header:

    SPLIT, SCENE IMAGE, SCENE IMAGE, OBJECT         anchor first, then query

SPLIT is a word that nobody reads (what is written here has `cross-scene` or `same-scene` there). OBJECT is the object's
number in the dataset, as in Oryon's list of Toyota-Light (`test, 58 1224, 48 1662, 8`), or a number and the object's
name, as in that of REAL275 (`real_test, 1 50, 4 210, 6 mug_daniel_norm`), where the name decides: the number is that of
a class there. Blank lines are skipped; a pair that is listed twice counts twice, as it does for Oryon.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from eval.datasets import Dataset, Target, require
from eval.pairs import Pair, View
from tracker.errors import OutputError, SourceError
from tracker.sources.text_files import is_whole

LINE = "SPLIT, SCENE IMAGE, SCENE IMAGE, OBJECT"


def write_pairs(path: Path, pairs: Iterable[Pair], dataset: Dataset) -> None:
    """Raises OutputError where the file cannot be written."""
    try:
        path.write_text("".join(f"{_line(pair, dataset)}\n" for pair in pairs), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error


def read_pairs(path: Path, dataset: Dataset) -> list[Pair]:
    """The pairs in the order of the list; any image in which the dataset has the object's pose will do, target or not.

    Raises SourceError that names file and line where a line is damaged, or names what the dataset does not have.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        raise SourceError(f"{path}: cannot be read as a list of pairs ({error})") from error
    pairs = list(_pairs(path, lines, dataset))
    if not pairs:
        raise SourceError(f"{path}: no pair; a line is {LINE}")
    return pairs


def _line(pair: Pair, dataset: Dataset) -> str:
    number = dataset.number(pair.object_id)
    name = str(number) if pair.object_id == str(number) else f"{number} {pair.object_id}"
    places = (f"{view.scene_id} {view.target.image_id}" for view in (pair.anchor, pair.query))
    return ", ".join((pair.kind, *places, name))


def _pairs(path: Path, lines: Sequence[str], dataset: Dataset) -> Iterator[Pair]:
    truth = _Truth(dataset)
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            cells = [cell.strip() for cell in line.split(",", 3)]
            if len(cells) != 4:
                raise SourceError(f"{len(cells)} cells, expected {LINE}; got {line.strip()!r}")
            object_id = _object(cells[3], dataset)
            anchor, query = (truth.view(*_place(cell), object_id) for cell in cells[1:3])
            if (anchor.scene_id, anchor.target.image_id) == (query.scene_id, query.target.image_id):
                raise SourceError(f"anchor and query are the same image ({cells[1]})")
        except SourceError as error:
            raise SourceError(f"{path}, line {number}: {error}") from error
        yield Pair(anchor, query)


def _place(cell: str) -> tuple[int, int]:
    numbers = cell.split()
    if len(numbers) != 2 or not all(is_whole(number) for number in numbers):
        raise SourceError(f"expected SCENE IMAGE, two whole numbers, got {cell!r}")
    return int(numbers[0]), int(numbers[1])


def _object(cell: str, dataset: Dataset) -> str:
    number, _, name = cell.partition(" ")
    if not is_whole(number):
        raise SourceError(f"expected the object as NUMBER or NUMBER NAME, got {cell!r}")
    object_id = name.strip() or dataset.object_with(int(number))
    require("object", object_id, dataset.object_ids, dataset.name)
    return object_id


class _Truth:
    """What a dataset knows of an object in an image, each scene and object asked for once."""

    def __init__(self, dataset: Dataset) -> None:
        self._dataset = dataset
        self._known: dict[tuple[int, str], dict[int, Target]] = {}

    def view(self, scene_id: int, image_id: int, object_id: str) -> View:
        """Raises SourceError where the dataset does not have the scene, or not the object's pose in the image."""
        name = self._dataset.name
        require("scene", scene_id, self._dataset.scene_ids, name)
        if (scene_id, object_id) not in self._known:
            scene, image_ids = self._dataset.scene(scene_id), self._dataset.image_ids(scene_id)
            sightings = scene.sightings(object_id) if object_id in scene.object_ids else ()
            targets = [
                Target(s.index, image_ids[s.index], object_id, s.T_cam_obj, s.visible_px, s.visible_fraction)
                for s in sightings
            ]
            self._known[scene_id, object_id] = {target.image_id: target for target in targets}
        known = self._known[scene_id, object_id]
        if image_id not in known:
            raise SourceError(
                f"{name} has no pose of object {object_id!r} in image {image_id} of scene {scene_id}; it has "
                f"{len(known)} there" + (f", in images {min(known)} to {max(known)}" if known else "")
            )
        return View(scene_id, known[image_id])
