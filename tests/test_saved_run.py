"""A run that was saved comes out the same when it is done again."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from tracker.concept import ConceptModel
from tracker.config import TrackerConfig, dump_config
from tracker.errors import OutputError, SourceError
from tracker.pipeline import ObjectTracker
from tracker.pointing import parse_pointer
from tracker.saved_run import CONFIG, FILE, Replay, SavedRun
from tracker.sources import open_source

SOURCE = "synthetic:turn?size=320x240&object=soup_can"


@pytest.fixture
def saved(can_model: ConceptModel, tmp_path: Path) -> Path:
    """A folder of a run in which a pixel on the can was pointed out."""
    can_model.save(tmp_path / "can.concept")
    first = next(iter(open_source(SOURCE)))
    row, column = np.argwhere(first.masks[can_model.object_id]).mean(axis=0).round().astype(int)
    SavedRun(SOURCE, (str(tmp_path / "can.concept"),), at=(f"{column},{row}",)).save(tmp_path)
    (tmp_path / CONFIG).write_text(dump_config(TrackerConfig(masks="carried", seed=3)))
    return tmp_path


def test_it_comes_out_the_same_again(saved: Path, can_model: ConceptModel) -> None:
    replay = Replay(saved)
    tracker = ObjectTracker(can_model, TrackerConfig(masks="carried", seed=3))
    tracker.point_out(can_model.object_id, parse_pointer(SavedRun.load(saved).at[0]))
    again = list(islice(replay, 3))
    assert [frame.index for frame, _ in again] == [0, 1, 2]
    for frame, (result,) in again:
        (expected,) = tracker.step(replace(frame, masks={}))
        assert (result.state, result.reason) == (expected.state, expected.reason)
        assert result.pose is not None
        assert expected.pose is not None
        assert np.allclose(result.pose.matrix, expected.pose.matrix, atol=1e-12)


def test_what_was_written_is_read_and_models_are_found_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    SavedRun("bop:here:1", ("a.concept", "b.concept"), "large", "cpu", ("a=1,2",)).save(tmp_path)
    run = SavedRun.load(tmp_path)
    assert run == SavedRun("bop:here:1", (f"{tmp_path}/a.concept", f"{tmp_path}/b.concept"), "large", "cpu", ("a=1,2",))


@pytest.mark.parametrize(
    "text", [None, "no json", "[]", '{"source": "a"}', '{"source": "a", "models": [], "at": [], "x": 1}',
     '{"source": 5, "models": [], "at": []}', '{"source": "a", "models": "b.concept", "at": []}',
     '{"source": "a", "models": [1], "at": []}', "[" * 5000]
)  # fmt: skip
def test_a_folder_without_a_whole_run_is_refused(text: str | None, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / FILE).write_text(text)
    with pytest.raises(OutputError, match=r"run\.json.*python -m tracker --out"):
        SavedRun.load(tmp_path)


def test_a_camera_cannot_be_played_again(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Camera:
        name, left_out = "camera", {}

        def __iter__(self):
            return iter(())

        def stop(self) -> None: ...

    monkeypatch.setattr("tracker.saved_run.open_source", lambda _: Camera())
    with pytest.raises(SourceError, match="--record"):
        Replay(saved)
