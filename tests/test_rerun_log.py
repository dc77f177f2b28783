"""What is sent to Rerun: read back from a file, with Rerun's own reader."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracker.concept import ConceptModel
from tracker.errors import ConfigError, MissingExtraError, OutputError
from tracker.frame import Frame
from tracker.geometry import Intrinsics, Pose
from tracker.rerun_log import RerunLog
from tracker.result import Surface, TrackResult, TrackState
from tracker.saliency import Saliency
from tracker.view import Box

rerun = pytest.importorskip("rerun")
CAMERA = Intrinsics(300.0, 310.0, 79.5, 59.5, 160, 120)
FRAME_NS = 33_333_333
NAME = "a thing/1"


@pytest.fixture(autouse=True)
def strict() -> None:
    """What Rerun does not understand is an error, not a warning."""
    rerun.set_strict_mode(True)


@pytest.fixture(scope="module")
def model() -> ConceptModel:
    points = np.random.default_rng(0).uniform(-0.05, 0.05, (60, 3))
    ones, nothing = np.ones(len(points), np.float32), np.zeros((len(points), 3), np.float32)
    saliency = np.zeros((len(points), 2), np.float32)
    saliency[:20, 0], saliency[20:, 1] = 0.7, 0.6
    return ConceptModel(
        NAME, points, points, nothing, saliency, ones.astype(np.int32), ones, np.eye(3)[:1], 0.2, ("rim", "dark blue"),
        "none", "none",
    )  # fmt: skip


def frame(index: int) -> Frame:
    rgb = np.full((120, 160, 3), (200, 40, 20), np.uint8)
    return Frame(rgb, np.full((120, 160), 0.75, np.float32), CAMERA, index * FRAME_NS, {}, index)


def pose(index: int) -> Pose:
    return Pose(np.eye(3), np.array((0.01 * index, 0, 0.5)))


def found(index: int, surface: Surface | None = None) -> TrackResult:
    raw = Pose(np.eye(3), np.array((0.01 * index, 0.001, 0.5)))
    timings = {"view": 2.0, "total": 3.0}
    return TrackResult(
        index * FRAME_NS, NAME, pose(index), TrackState.TRACKING, 0.9, None, "found by search", raw, None, timings,
        surface,
    )  # fmt: skip


def lost(index: int, reason: str = "out of view") -> TrackResult:
    timings = {"total": 1.0}
    return TrackResult(index * FRAME_NS, NAME, None, TrackState.LOST, 0.0, None, reason, None, None, timings)


def asked(model: ConceptModel) -> Surface:
    """A view whose pixels are 2 by 2 of the frame's, of which 4 by 4 show the object: the left half its rim."""
    depth_m = np.zeros((12, 12), np.float32)
    depth_m[4:8, 4:8] = 0.5
    x0, y0 = 60, 40
    camera = Intrinsics(150.0, 155.0, (79.5 - x0 - 0.5) / 2, (59.5 - y0 - 0.5) / 2, 12, 12)
    maps = np.zeros((2, 12, 12), np.float32)
    maps[0, :, :6], maps[1, :, 6:] = 1, 1
    return Surface(model, depth_m, camera, Saliency(model.labels, maps, Box(x0, y0, x0 + 24, y0 + 24)))


def recorded(path: Path, model: ConceptModel, results: Sequence[TrackResult], truth: int = 0) -> dict[str, list[Any]]:
    """By entity its rows, each a dict of what was logged there, with the stamp of the frame (None: static)."""
    viewer = RerunLog([model], path / "a.rrd")
    for index, result in enumerate(results):
        viewer.show(frame(index), [result], {NAME: pose(index)} if index < truth else {})
    viewer.close()
    from rerun.chunk import RrdReader

    rows: dict[str, list[Any]] = {}
    for chunk in RrdReader(path / "a.rrd").stream():
        assert set(chunk.timeline_names) <= {"stamp"}
        rows.setdefault(chunk.entity_path, []).extend(plain(chunk.to_record_batch()))
    for entity in rows:
        rows[entity].sort(key=lambda row: (row.get("stamp") is not None, row.get("stamp")))
    return rows


def plain(batch: Any) -> list[dict[str, Any]]:
    """Rows of Arrow's, times as whole nanoseconds: Python's own have no more than microseconds."""
    import pyarrow as pa

    times = pa.types.is_temporal
    columns = [column.cast(pa.int64()) if times(column.type) else column for column in batch.columns]
    return pa.RecordBatch.from_arrays(columns, names=batch.schema.names).to_pylist()


def stamps(rows: Sequence[dict[str, Any]], component: str) -> list[int]:
    """Numbers of the frames in which a component was logged."""
    return [round(row["stamp"] / FRAME_NS) for row in rows if row.get(component) is not None]


def test_every_frame_is_there_with_camera_pictures_and_poses(model: ConceptModel, tmp_path: Path) -> None:
    rows = recorded(tmp_path, model, [found(k) for k in range(4)], truth=4)
    thing = r"/world/objects/a\ thing\/1"
    assert stamps(rows["/world/camera/rgb"], "EncodedImage:blob") == [0, 1, 2, 3]
    assert stamps(rows["/world/camera/depth"], "DepthImage:buffer") == [0, 1, 2, 3]
    assert rows["/world/camera"][0]["Pinhole:image_from_camera"][0] == [300, 0, 0, 0, 310, 0, 79.5, 59.5, 1]
    depth = np.frombuffer(bytes(rows["/world/camera/depth"][0]["DepthImage:buffer"][0]), np.uint16)
    assert depth.tolist() == [750] * (160 * 120)
    for entity, y_m in ((thing, 0.0), (thing.replace("objects", "raw"), 0.001), (thing.replace("objects", "truth"), 0)):
        shifts = [r["Transform3D:translation"][0] for r in rows[entity] if r.get("Transform3D:translation")]
        assert np.allclose(shifts, [(0.01 * k, y_m, 0.5) for k in range(4)])


def test_points_tell_their_strongest_concept(model: ConceptModel, tmp_path: Path) -> None:
    rows = recorded(tmp_path, model, [found(0)])
    (points,) = rows[r"/world/objects/a\ thing\/1/points"]
    assert points["Points3D:class_ids"] == [1] * 20 + [2] * 40
    (names,) = rows["/"]
    told = [entry["class_description"]["info"] for entry in names["AnnotationContext:context"][0]]
    assert [(info["id"], info["label"]) for info in told] == [(1, "rim"), (2, "dark blue")]


def test_what_is_lost_is_taken_away_and_comes_back(model: ConceptModel, tmp_path: Path) -> None:
    rows = recorded(tmp_path, model, [found(0), lost(1), lost(2, "hidden"), found(3)], truth=2)
    thing = r"a\ thing\/1"
    assert stamps(rows[f"/world/objects/{thing}"], "Clear:is_recursive") == [1]
    assert stamps(rows[f"/world/raw/{thing}"], "Clear:is_recursive") == [1]
    assert stamps(rows[f"/world/truth/{thing}"], "Clear:is_recursive") == [2]
    assert stamps(rows[f"/world/objects/{thing}/points"], "Points3D:positions") == [0, 3]
    assert stamps(rows[f"/world/objects/{thing}/box"], "Boxes3D:half_sizes") == [0, 3]
    assert [r["StateChange:state"][0] for r in rows[f"/state/{thing}"] if r.get("StateChange:state")] == [
        "tracking", "lost", "tracking",
    ]  # fmt: skip
    reasons = [row["TextLog:text"][0] for row in rows[f"/reason/{thing}"]]
    assert [reason.rpartition(", ")[2] for reason in reasons] == ["found by search", "out of view", "hidden",
                                                                  "found by search"]  # fmt: skip
    assert [r["Scalars:scalars"] for r in rows[f"/confidence/{thing}"]] == [[0.9], [0], [0], [0.9]]


def test_a_stage_that_did_not_run_took_no_time(model: ConceptModel, tmp_path: Path) -> None:
    rows = recorded(tmp_path, model, [found(0), lost(1)])
    assert [row["Scalars:scalars"] for row in rows["/timings/view"]] == [[2.0], [0.0]]
    assert [row["Scalars:scalars"] for row in rows["/timings/total"]] == [[3.0], [1.0]]


def test_concepts_are_shown_where_they_were_asked_and_no_longer(model: ConceptModel, tmp_path: Path) -> None:
    rows = recorded(tmp_path, model, [found(0), found(1, asked(model)), found(2), found(3)])
    concepts = rows["/world/camera/concepts"]
    assert stamps(concepts, "SegmentationImage:buffer") == [1]
    assert stamps(concepts, "Clear:is_recursive") == [2]
    (buffer,) = [row["SegmentationImage:buffer"][0] for row in concepts if row.get("SegmentationImage:buffer")]
    classes = np.frombuffer(bytes(buffer), np.uint16).reshape(120, 160)
    expected = np.zeros((120, 160), np.uint16)
    expected[48:56, 68:72], expected[48:56, 72:76] = 1, 2
    assert (classes == expected).all()


def test_it_opens_arranged(model: ConceptModel, tmp_path: Path) -> None:
    recorded(tmp_path, model, [found(0)])
    from rerun.chunk import RrdReader

    reader = RrdReader(tmp_path / "a.rrd")
    (blueprint,) = reader.blueprints()
    kinds = set()
    for chunk in reader.stream(store=blueprint):
        for row in plain(chunk.to_record_batch()):
            kinds.update(row.get("ViewBlueprint:class_identifier") or ())
    assert kinds == {"2D", "3D", "TimeSeries", "TextLog", "StateTimeline"}


def test_without_a_display_there_is_no_window_and_the_file_is_named(
    model: ConceptModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ConfigError, match=r"no display.*--rrd"):
        RerunLog([model], window=True)


def test_a_file_that_cannot_be_written_is_an_error(model: ConceptModel, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"absent.a\.rrd"):
        RerunLog([model], tmp_path / "absent" / "a.rrd")


def test_without_the_package_the_extra_is_named(
    model: ConceptModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingExtraError, match=r"conceptrack\[rerun\]"):
        RerunLog([model], tmp_path / "a.rrd")


def test_it_is_not_imported_until_it_is_used() -> None:
    asked = "import sys, tracker.rerun_log; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", asked], check=False).returncode == 0  # noqa: S603
