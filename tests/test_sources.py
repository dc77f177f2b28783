"""The table of sources: what a user writes opens the source it names, and anything else lists what there is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from reference.onboard import read_reference_frames
from reference.unposed import read_unposed_frames
from tracker.errors import SourceError
from tracker.frame import Frame
from tracker.sources import (
    POSED,
    SOURCES,
    PosedSource,
    length_of,
    open_source,
    require_object,
    require_posed,
    require_recording,
)
from tracker.sources.bop import BopScene
from tracker.sources.folder import Folder
from tracker.sources.synthetic import SyntheticScene


@pytest.fixture
def every_source(bop_dataset: Path) -> dict[str, PosedSource]:
    """One of each kind; the folder shares the pictures of the BOP scene."""
    scene = bop_dataset / "test" / "000003"
    (scene / "cam_K.txt").write_text("60 0 23\n0 61 17\n0 0 1\n")
    names = (f"bop:{bop_dataset}:3", f"folder:{scene}", "synthetic:still?size=160x120&frames=3")
    return {name: require_posed(open_source(name)) for name in names}


def test_every_kind_opens_as_a_posed_source_that_is_called_as_the_user_called_it(
    every_source: dict[str, PosedSource],
) -> None:
    assert {name.partition(":")[0] for name in every_source} == set(POSED)
    assert [type(source) for source in every_source.values()] == [BopScene, Folder, SyntheticScene]
    for name, source in every_source.items():
        assert isinstance(source, PosedSource)
        assert source.name == name


def test_frames_come_by_position_and_in_the_order_of_their_stamps(every_source: dict[str, PosedSource]) -> None:
    for name, source in every_source.items():
        frames = list(source)
        assert [frame.index for frame in frames] == list(range(len(source)))
        assert (np.diff([frame.stamp_ns for frame in frames]) > 0).all()
        for frame in frames:
            again = source[frame.index]
            assert np.array_equal(again.rgb, frame.rgb)
            assert np.array_equal(again.depth_m, frame.depth_m)
            assert frame.provenance.source.startswith(name)


def test_every_sighting_is_of_a_frame_that_has_a_mask_of_the_object(every_source: dict[str, PosedSource]) -> None:
    for source in every_source.values():
        for object_id in source.object_ids:
            for sighting in source.sightings(object_id):
                assert sighting.visible_px == source[sighting.index].masks[object_id].sum()


@pytest.mark.parametrize("name", ["", "bop", "bop:", ":x", "webcam:0", "BOP:x:1", "/data/bop", "mug.concept"])
def test_a_name_that_is_no_source_is_answered_with_the_kinds_that_there_are(name: str) -> None:
    with pytest.raises(SourceError, match=f"{name!r} is not a source; .* one of {', '.join(SOURCES)}"):
        open_source(name)


@pytest.mark.parametrize("argument", ["data", "data:", "data:one", "data:-1", "data:1.5", "data:²"])
def test_a_bop_source_needs_the_number_of_a_scene(argument: str) -> None:
    with pytest.raises(SourceError, match=f"bop:{argument}: expected bop:PATH:SCENE"):
        open_source(f"bop:{argument}")


def test_a_path_may_have_colons(bop_dataset: Path) -> None:
    moved = bop_dataset.rename(bop_dataset.with_name("at 12:30:45"))
    assert length_of(open_source(f"bop:{moved}:3")) == 3


class Camera:
    """A source whose frames come once, and nobody knows how many."""

    name = "camera:7"

    def __iter__(self) -> Iterator[Frame]:
        return iter(())


def test_a_camera_has_no_length_and_whoever_needs_poses_is_told_who_has_them() -> None:
    assert length_of(Camera()) is None
    for ask in (require_posed, lambda camera: read_reference_frames(camera, "mug", 2)):
        with pytest.raises(SourceError, match=r"camera:7 has no poses of objects; .*: bop, folder, synthetic"):
            ask(Camera())
    for ask in (require_recording, lambda camera: read_unposed_frames(camera, "mug", 2)):
        with pytest.raises(SourceError, match="camera:7 has no frames by position, they come once"):
            ask(Camera())


def test_an_object_that_a_source_does_not_know_is_answered_with_those_that_it_knows(
    every_source: dict[str, PosedSource],
) -> None:
    for source in every_source.values():
        with pytest.raises(SourceError, match=f"has no poses of object 'spoon'; it has {', '.join(source.object_ids)}"):
            source.sightings("spoon")
        for object_id in source.object_ids:
            require_object(source, object_id)
    folder = next(source for source in every_source.values() if isinstance(source, Folder))
    with pytest.raises(SourceError, match="it has none"):
        folder.sightings("object")
