"""Bags of three kinds give the same frames, whatever was dropped, late or skewed; damage is named with the file."""

from __future__ import annotations

import sqlite3
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.ros_bags import (
    BAGS,
    CAMERA_INFO,
    COLOUR,
    COMPRESSED,
    DEPTH,
    IMAGE,
    INFO,
    PERIOD_NS,
    START_NS,
    Camera,
    Recorded,
    camera_info,
    colour_picture,
    compressed,
    config_header,
    depth_picture,
    encoded,
    image,
    write_bag,
)
from tracker.errors import MissingExtraError, SourceError
from tracker.frame import Frame
from tracker.sources import length_of, open_source
from tracker.sources.ros_topics import Chosen
from tracker.sources.rosbag import RosBag


def numbers(frames: list[Frame]) -> list[int]:
    """Which pictures they are, by their colour; their depth is of the same."""
    for frame in frames:
        k = int(frame.rgb[0, 0, 0])
        assert (frame.rgb == colour_picture(k)).all()
        assert frame.depth_m == pytest.approx(depth_picture(k) / 1000)
        assert frame.stamp_ns == START_NS + k * PERIOD_NS
    assert [frame.index for frame in frames] == list(range(len(frames)))
    return [int(frame.rgb[0, 0, 0]) for frame in frames]


@pytest.mark.parametrize("kind", BAGS)
def test_every_kind_of_bag_gives_the_frames_that_were_recorded_as_often_as_they_are_asked_for(
    kind: str, tmp_path: Path
) -> None:
    path = write_bag(tmp_path, kind, Camera(4).messages())
    source = open_source(f"rosbag:{path}")
    assert isinstance(source, RosBag)
    assert source.topics == Chosen(COLOUR, DEPTH, INFO)
    assert (source.name, length_of(source)) == (f"rosbag:{path}", None)
    for _ in range(2):
        assert numbers(list(source)) == [0, 1, 2, 3]


@pytest.mark.parametrize("kind", BAGS)
def test_skew_drops_and_disorder_leave_the_pairs_that_belong_together(kind: str, tmp_path: Path) -> None:
    camera = Camera(12, skew_ns=4_000_000, without_colour=(3, 4), without_depth=(4, 7, 11))
    messages = camera.messages()
    infos, pictures = messages[:1], messages[1:]
    order = np.argsort(np.arange(len(pictures)) + np.random.default_rng(5).uniform(0, 4, len(pictures)))
    assert list(order) != sorted(order)
    shuffled = [Recorded(p.topic, p.msgtype, p.message, START_NS + k) for k, p in enumerate(pictures[i] for i in order)]
    frames = list(RosBag(str(write_bag(tmp_path, kind, [*infos, *shuffled]))))
    assert numbers(frames) == [0, 1, 2, 5, 6, 8, 9, 10]
    assert {frame.provenance.colour_depth_skew_ns for frame in frames} == {-4_000_000}


def test_a_slop_may_be_given_and_nothing_within_it_is_an_error_that_counts(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "mcap", Camera(4, skew_ns=10_000_000).messages())
    assert numbers(list(RosBag(f"{path}?slop=0.011"))) == [0, 1, 2, 3]
    with pytest.raises(SourceError, match=r"0 pairs of .* within 0\.009 s, left out 4 and 4 without a partner"):
        list(RosBag(f"{path}?slop=0.009"))


def test_headers_that_are_not_stamped_are_an_error(tmp_path: Path) -> None:
    messages = Camera(6).messages()
    for each in messages:
        each.message.header.stamp.sec = each.message.header.stamp.nanosec = 0
    with pytest.raises(SourceError, match=r"5 and 5 whose header's stamp was not new; are the headers stamped"):
        list(RosBag(str(write_bag(tmp_path, "sqlite3", messages))))


def test_compressed_topics_are_read_and_a_unit_may_be_given(tmp_path: Path) -> None:
    png = encoded(colour_picture(1)[:, :, ::-1], ".png")
    inverse = config_header() + encoded(depth_picture(1), ".png")
    messages = [
        Recorded(INFO, CAMERA_INFO, camera_info(), 1),
        Recorded(f"{COLOUR}/compressed", COMPRESSED, compressed(png, "rgb8; png compressed bgr8"), 2),
        Recorded(f"{DEPTH}/compressedDepth", COMPRESSED, compressed(inverse, "16UC1; compressedDepth png"), 3),
    ]
    path = write_bag(tmp_path, "ros1", messages)
    (frame,) = RosBag(f"{path}?depth_unit=0.0001")
    assert (frame.rgb == colour_picture(1)).all()
    assert frame.depth_m == pytest.approx(depth_picture(1) / 10_000)


def test_a_camera_that_changes_in_the_bag_is_used_from_then_on(tmp_path: Path) -> None:
    zoomed = camera_info(START_NS + 2 * PERIOD_NS, k=(90.0, 0, 23.5, 0, 91, 17, 0, 0, 1))
    messages = [*Camera(4).messages(), Recorded(INFO, CAMERA_INFO, zoomed, START_NS + 2 * PERIOD_NS)]
    path = write_bag(tmp_path, "mcap", sorted(messages, key=lambda each: each.received_ns))
    assert [frame.intrinsics.fx for frame in RosBag(str(path))] == [60, 60, 90, 90]


def test_topics_are_named_by_options(tmp_path: Path) -> None:
    messages = [
        each for m in Camera(2).messages() for each in (m, Recorded(f"/second{m.topic}", m.msgtype, m.message, 7))
    ]
    messages.sort(key=lambda each: each.received_ns)
    path = write_bag(tmp_path, "mcap", messages)
    with pytest.raises(SourceError, match=rf"several topics could be the colour: .*{COLOUR} .*/second{COLOUR} "):
        RosBag(str(path))
    asked = f"{path}?colour=/second{COLOUR}&depth=/second{DEPTH}&info=/second{INFO}"
    assert RosBag(asked).topics == Chosen(f"/second{COLOUR}", f"/second{DEPTH}", f"/second{INFO}")
    with pytest.raises(SourceError, match=f"colour=/third is not there; the topics are .*{DEPTH}"):
        RosBag(f"{path}?colour=/third")
    with pytest.raises(
        SourceError, match="no option 'color'; there is colour, depth, info, depth_unit, slop, registered"
    ):
        RosBag(f"{path}?color={COLOUR}")


@pytest.mark.parametrize("kind", BAGS)
def test_a_bag_without_the_topics_says_what_it_has(kind: str, tmp_path: Path) -> None:
    messages = [m for m in Camera(2).messages() if m.topic != DEPTH]
    path = write_bag(tmp_path, kind, messages)
    with pytest.raises(SourceError, match=rf"{path}: no topic has depth pictures; .*{COLOUR} \(rgb8 48x36 in .*, 2\)"):
        RosBag(str(path))


def test_depth_of_another_camera_is_refused_when_the_bag_is_opened(tmp_path: Path) -> None:
    messages = [m for m in Camera(2).messages() if m.topic != DEPTH]
    messages.append(Recorded("/depth", IMAGE, image(depth_picture(0), "16UC1", frame_id="depth"), START_NS))
    with pytest.raises(SourceError, match=r"/depth .* is registered to the colour .*aligned_depth_to_color"):
        RosBag(str(write_bag(tmp_path, "mcap", messages)))


def data_file(path: Path) -> Path:
    """The file that holds the messages."""
    return path if path.is_file() else next(p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))


@pytest.mark.parametrize("kind", BAGS)
@pytest.mark.parametrize("kept", [0.0, 0.02, 0.5, 0.98])
def test_a_bag_that_was_cut_off_is_named_and_frames_before_the_damage_are_kept(
    kind: str, kept: float, tmp_path: Path
) -> None:
    path = write_bag(tmp_path, kind, Camera(30).messages())
    file = data_file(path)
    whole = file.read_bytes()
    file.write_bytes(whole[: int(len(whole) * kept)])
    frames: list[Frame] = []
    with pytest.raises(SourceError, match=rf"{path}.*: .*(expected a bag of ROS|no message that can be read)"):
        frames.extend(RosBag(str(path)))
    numbers(frames)


@pytest.mark.parametrize("name", ["film.bag", "film.db3", "film.mcap", "film.mp4"])
def test_a_file_of_another_kind_is_named(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(b"\x00\x00\x00 ftypisom" * 50)
    with pytest.raises(SourceError, match=f"{name}: cannot be opened .*expected a bag of ROS"):
        RosBag(str(tmp_path / name))
    if name == "film.db3":
        (tmp_path / name).unlink()
        with sqlite3.connect(tmp_path / name) as other:
            other.execute("CREATE TABLE songs (title TEXT)")
        with pytest.raises(SourceError, match=f"{name}: cannot be opened .*missing tables"):
            RosBag(str(tmp_path / name))


def test_a_path_that_is_not_there_and_a_folder_without_a_bag_are_named(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=f"{tmp_path}/nothing: no such bag"):
        RosBag(str(tmp_path / "nothing"))
    with pytest.raises(SourceError, match=rf"{tmp_path}: no bag of ROS 2: it has no metadata\.yaml and 0"):
        RosBag(str(tmp_path))


@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_the_one_file_of_a_bag_is_enough(kind: str, tmp_path: Path) -> None:
    path = write_bag(tmp_path, kind, Camera(3).messages())
    assert numbers(list(RosBag(str(data_file(path))))) == [0, 1, 2]
    (path / "metadata.yaml").unlink()  # as after a crash
    assert numbers(list(RosBag(str(path)))) == [0, 1, 2]


def test_without_the_package_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_bag(tmp_path, "mcap", Camera(1).messages())
    for module in [name for name in sys.modules if name.partition(".")[0] == "rosbags"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'conceptrack\[rosbag\]'"):
        RosBag(str(path))
