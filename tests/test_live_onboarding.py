"""An object that is turned before a camera becomes a model, without a mask or a pose of the source."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import reference.__main__
import reference.live
import tracker.sources
from reference.live import PATIENCE, Progress, TurnedObject, first_sight, whole_of
from tests.live_camera import LiveCamera
from tracker.concept import ConceptModel
from tracker.errors import OnboardingError, SourceError
from tracker.frame import Frame, Mask
from tracker.pipeline import ObjectTracker
from tracker.pointing import Pointer
from tracker.saliency import SaliencyBackend
from tracker.sources.synthetic import SyntheticScene, open_scene

BOX = "tea_box"
SOURCE = f"synthetic:turn?size=160x120&frames=6&object={BOX}"
Run = Callable[..., tuple[int, str]]
Turned = tuple[TurnedObject, list[Progress]]


@pytest.fixture(scope="module")
def scene() -> SyntheticScene:
    """A box turns by 114 degrees."""
    return open_scene(f"turn?object={BOX}&size=320x240")


def errors(model: ConceptModel, scene: SyntheticScene) -> list[tuple[float, float]]:
    """Metres and degrees of the model's views, if its first one is right."""
    truth, first = {s.index: s.T_cam_obj for s in scene.sightings(model.object_id)}, model.references[0]
    T_true_obj = truth[first.frame.index].inverse() @ first.T_cam_obj
    expected = [(view.T_cam_obj, truth[view.frame.index] @ T_true_obj) for view in model.references]
    return [(pose.distance_to_m(true), float(np.degrees(pose.angle_to_rad(true)))) for pose, true in expected]


@pytest.fixture(scope="module")
def turned(scene: SyntheticScene, attributes: SaliencyBackend) -> Turned:
    """Every third frame, masks taken away; 27 % of the viewing sphere are enough."""
    frames = (replace(scene[index], masks={}) for index in range(0, 72, 3))
    there = first_sight(frames, None)
    turned = TurnedObject(*there, BOX, attributes, coverage=0.27)
    return turned, [turned.progress, *(turned.see(frame) for frame in frames)]


def test_the_model_holds_more_of_the_object_at_poses_that_are_right(turned: Turned, scene: SyntheticScene) -> None:
    model = turned[0].model
    assert len(model.references) >= 2
    assert not any(view.frame.masks for view in model.references)
    assert np.all(np.array(errors(model, scene)) < (0.003, 3))


def test_a_round_thing_does_not_slip_from_view_to_view(attributes: SaliencyBackend) -> None:
    """A can that turns by 114 degrees, its masks by depth alone."""
    scene = open_scene("turn?object=soup_can&size=320x240")
    frames = (replace(scene[index], masks={}) for index in range(0, 90, 2))
    turned = TurnedObject(*first_sight(frames, None), "soup_can", attributes)
    for frame in frames:
        turned.see(frame)
    assert len(turned.model.references) >= 4
    assert np.all(np.array(errors(turned.model, scene)) < (0.003, 4))


def test_a_mask_that_ends_where_the_model_does_is_made_whole(scene: SyntheticScene) -> None:
    frame = scene[0]
    mask = frame.masks[BOX]
    half = mask & (np.arange(mask.shape[1]) < np.flatnonzero(mask.any(axis=0)).mean() + 4)
    on_the_table = half | np.roll(half, 4, axis=0)
    for partly in (half, on_the_table):
        whole = whole_of(replace(frame, masks={}), partly)
        assert (whole & mask).sum() > 0.7 * mask.sum() > 1.1 * half.sum()
        assert (whole & ~mask).sum() < 0.05 * whole.sum()


def test_a_mask_of_nothing_that_stands_apart_stays(scene: SyntheticScene) -> None:
    table = np.zeros(scene[0].depth_m.shape, bool)
    table[200:215, 20:60] = True
    assert whole_of(scene[0], table) is table
    assert not whole_of(scene[0], np.zeros_like(table)).any()


def test_its_notes_say_how_it_came_about(turned: Turned, tmp_path: Path) -> None:
    turned[0].model.save(tmp_path / "a.concept")
    notes = ConceptModel.load(tmp_path / "a.concept").notes
    assert notes["came_about"].startswith("turned before the camera, 24 frames from synthetic:turn")
    assert notes["object_frame"].startswith("centre of what the first")
    assert notes["left_out"] == []


def test_coverage_grows_with_the_views_until_it_is_enough(turned: Turned) -> None:
    progress = turned[1]
    assert (progress[0].views, progress[0].grown, progress[0].enough) == (1, False, False)
    assert all(now.result.pose is not None for now in progress)
    for before, now in pairwise(progress):
        assert now.coverage >= before.coverage
        assert now.grown == (now.views > before.views) == (now.coverage > before.coverage)
    first = next(k for k, now in enumerate(progress) if now.grown)
    done = next(k for k, now in enumerate(progress) if now.enough)
    assert progress[first].coverage >= 0.27
    assert done > first + 10  # a view that joined has to prove itself


def test_the_model_tracks_the_object_afterwards(turned: Turned, scene: SyntheticScene) -> None:
    model, truth = turned[0].model, scene.sightings(BOX)
    follow = ObjectTracker(model)
    T_true_obj = truth[0].T_cam_obj.inverse() @ model.references[0].T_cam_obj
    for index in (76, 80, 84):
        (result,) = follow.step(scene[index])
        assert result.pose is not None
        assert result.pose.distance_to_m(truth[index].T_cam_obj @ T_true_obj) < 0.003


def test_so_many_views_are_enough(scene: SyntheticScene, attributes: SaliencyBackend) -> None:
    frame = scene[0]
    assert TurnedObject(frame, frame.masks[BOX], BOX, attributes, views=1).progress.enough


def test_a_camera_may_begin_with_frames_that_show_nothing(scene: SyntheticScene) -> None:
    dark = replace(scene[0], depth_m=np.zeros_like(scene[0].depth_m))
    frame, mask = first_sight(iter([dark, dark, scene[0], scene[1]]), None)
    assert frame is scene[0] or frame.index == 0
    assert mask.any()
    frames = iter([dark] * (PATIENCE + 5))
    with pytest.raises(OnboardingError, match="0 pixels have depth"):
        first_sight(frames, None)
    assert len(list(frames)) == 5
    with pytest.raises(OnboardingError, match="there are no frames"):
        first_sight(iter([]), None)


# The command


@pytest.fixture
def run(tmp_path: Path, program: Callable[..., tuple[int, str]]) -> Run:
    """`python -m reference` in this process: its exit code and what it says."""
    out = ("--object", "box", "--out", tmp_path / "box.concept")
    return lambda source, *options: program(reference.__main__.main, source, *out, *options)


@pytest.fixture
def camera(scene: SyntheticScene, monkeypatch: pytest.MonkeyPatch) -> LiveCamera:
    """What every source's name opens; it has shown a frame."""
    live = LiveCamera().show(scene[0])
    monkeypatch.setattr(tracker.sources, "open_source", lambda _: live)
    return live


def test_a_recording_without_masks_is_read_to_its_end(run: Run, tmp_path: Path) -> None:
    code, said = run(SOURCE, "--at", "nearest")
    assert code == 0, said
    assert "turned before the camera, 6 frames" in said
    assert "viewing sphere" in said
    model = ConceptModel.load(tmp_path / "box.concept")
    assert model.object_id == "box"
    assert len(model.references) == 1


def test_a_camera_needs_nothing_said(run: Run, camera: LiveCamera, tmp_path: Path) -> None:
    camera.show(None)
    code, said = run("realsense", "--views", 1)
    assert code == 0, said
    assert (tmp_path / "box.concept").exists()


@pytest.mark.parametrize("ending", [KeyboardInterrupt(), SourceError("camera:7: the camera is gone for 60.0 s")])
def test_what_ends_it_early_costs_nothing_that_is_known(
    ending: BaseException, run: Run, camera: LiveCamera, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ended(frames: Iterator[Frame], there: Pointer | None) -> tuple[Frame, Mask]:
        first = first_sight(frames, there)
        camera.show(replace(first[0], stamp_ns=first[0].stamp_ns + 1))
        return first

    def see(*_: object) -> Progress:
        raise ending

    monkeypatch.setattr(reference.live, "first_sight", ended)
    monkeypatch.setattr(TurnedObject, "see", see)
    code, said = run("realsense")
    assert code == 0, said
    assert "what is known of the object by now is kept" in said
    assert ConceptModel.load(tmp_path / "box.concept").object_id == "box"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--at", "80,112"), "what is there"),
        (("--at", "over there"), "'over there' points nowhere; expected a pixel"),
        (("--at", "nearest", "--unposed"), "--unposed takes the source's masks"),
        (("--at", "nearest", "--coverage", "60"), "--coverage: expected a number from 0 to 1, got 60"),
        (("--at", "nearest", "--symmetry", "z:inf"), "nobody knows of an object that is turned"),
    ],
)
def test_what_cannot_be_is_refused_and_leaves_no_file(
    options: tuple[str, ...], words: str, run: Run, tmp_path: Path
) -> None:
    code, said = run(SOURCE, *options)
    assert code == 1
    assert words in said
    assert list(tmp_path.iterdir()) == []
