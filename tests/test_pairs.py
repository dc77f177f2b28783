"""Pairs of images: the same seed, the same pairs; a list is read as it was written; every pair has its own answer."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from eval.bop_results import read_results
from eval.datasets import MaskKind, ObjectModel, Target, require
from eval.datasets.bop import BopDataset
from eval.pairs import Pair
from eval.pairs.drawing import draw_pairs
from eval.pairs.one_shot import OneShot, PairAnswer, answer_pairs, estimates_of, score_pairs
from eval.pairs.output import write_answers, write_result_files
from eval.pairs.pair_lists import read_pairs, write_pairs
from tracker.config import TrackerConfig
from tracker.errors import ConfigError, OutputError, SourceError
from tracker.frame import Frame, PosedFrame
from tracker.geometry import Pose
from tracker.result import TrackResult, TrackState
from tracker.saliency import SaliencyBackend
from tracker.sources import Sighting
from tracker.sources.synthetic import SyntheticScene, open_scene

BOX, CAN = "tea_box", "soup_can"
Keys = list[tuple[str, int, int, int, int]]


@dataclass
class Scenes:
    """The box turns in scenes 1 and 2, a can in scene 4 alone; the box is hardly to be seen in image 3 of scene 2."""

    name: str = "memory:scenes"
    target_rule: str = "all"
    model_frame: str = "its own"
    scene_ids: tuple[int, ...] = (1, 2, 4)
    object_ids: tuple[str, ...] = (CAN, BOX)
    size: str = "240x180"

    def scene(self, scene_id: int, masks: MaskKind = "visib") -> SyntheticScene:  # noqa: ARG002
        require("scene", scene_id, self.scene_ids, self.name)
        return turning(CAN if scene_id == 4 else BOX, self.size)

    def image_ids(self, scene_id: int) -> Sequence[int]:  # noqa: ARG002
        return (10, 20, 30, 40)

    def targets(self, scene_id: int) -> list[Target]:
        (object_id,) = self.scene(scene_id).object_ids
        return [
            Target(s.index, image_id, object_id, s.T_cam_obj, *visible(scene_id, s))
            for s, image_id in zip(self.scene(scene_id).sightings(object_id), self.image_ids(scene_id), strict=True)
        ]

    def model(self, object_id: str) -> ObjectModel:
        shape = self.scene(4 if object_id == CAN else 1).shape(object_id)
        return ObjectModel(shape.points_m, shape.diameter_m, shape.symmetric)

    def number(self, object_id: str) -> int:
        return self.object_ids.index(object_id) + 1

    def object_with(self, number: int) -> str:
        require("object number", number, (1, 2), self.name)
        return self.object_ids[number - 1]


@cache
def turning(object_id: str, size: str) -> SyntheticScene:
    return open_scene(f"turn?size={size}&frames=4&object={object_id}")


def visible(scene_id: int, sighting: Sighting) -> tuple[int, float]:
    return (500, 0.2) if (scene_id, sighting.index) == (2, 3) else (sighting.visible_px, sighting.visible_fraction)


def keys(pairs: Sequence[Pair]) -> Keys:
    views = [(p.anchor.scene_id, p.anchor.target.image_id, p.query.scene_id, p.query.target.image_id) for p in pairs]
    return [(pair.object_id, *view) for pair, view in zip(pairs, views, strict=True)]


def test_the_same_seed_gives_the_same_pairs_and_others_give_others() -> None:
    drawn = keys(draw_pairs(Scenes(), "cross-scene", 8, seed=3))
    assert drawn == keys(draw_pairs(Scenes(), "cross-scene", 8, seed=3))
    assert drawn != keys(draw_pairs(Scenes(), "cross-scene", 8, seed=4))
    assert drawn[:5] == keys(draw_pairs(Scenes(), "cross-scene", 5, seed=3))


def test_cross_scene_pairs_are_all_those_of_different_scenes_and_no_pair_comes_twice() -> None:
    drawn = keys(draw_pairs(Scenes(), "cross-scene", 1000, seed=0))
    assert len(drawn) == len(set(drawn)) == 4 * 4 + 3 * 4
    assert {name for name, *_ in drawn} == {BOX}
    assert all({scene_a, scene_q} == {1, 2} for _, scene_a, _, scene_q, _ in drawn)


def test_same_scene_pairs_are_of_two_images_of_one_scene() -> None:
    drawn = draw_pairs(Scenes(), "same-scene", 1000, seed=0)
    assert len(set(keys(drawn))) == len(drawn) == 4 * 3 + 3 * 3 + 4 * 3
    assert {pair.kind for pair in drawn} == {"same-scene"}
    assert all(a == q and image_a != image_q for _, a, image_a, q, image_q in keys(drawn))


def test_an_anchor_shows_the_object_well_and_a_query_may_be_any_target() -> None:
    drawn = keys(draw_pairs(Scenes(), "cross-scene", 1000, seed=0))
    assert not [key for key in drawn if key[1:3] == (2, 40)]
    assert [key for key in drawn if key[3:] == (2, 40)]
    with pytest.raises(SourceError, match=r"none of 4 targets shows its object well enough for an anchor"):
        draw_pairs(Scenes(size="64x64"), "same-scene", 5, seed=0, scene_ids=[4])


def test_only_what_is_asked_for_is_drawn_and_an_object_of_one_scene_has_no_cross_scene_pair() -> None:
    assert {key[1] for key in keys(draw_pairs(Scenes(), "same-scene", 99, 0, scene_ids=[2]))} == {2}
    assert {key[0] for key in keys(draw_pairs(Scenes(), "same-scene", 99, 0, object_ids=[CAN]))} == {CAN}
    with pytest.raises(SourceError, match=r"no cross-scene pair: none of 4 .* try the kind same-scene"):
        draw_pairs(Scenes(), "cross-scene", 5, 0, object_ids=[CAN])
    with pytest.raises(SourceError, match="no object 'spoon'"):
        draw_pairs(Scenes(), "cross-scene", 5, 0, object_ids=["spoon"])


@pytest.mark.parametrize("kind", ["cross-scene", "same-scene"])
def test_a_list_is_read_as_it_was_written(kind: str, tmp_path: Path) -> None:
    drawn = draw_pairs(Scenes(), "same-scene" if kind == "same-scene" else "cross-scene", 9, seed=1)
    write_pairs(tmp_path / "pairs.csv", drawn, Scenes())
    assert all(line.startswith(f"{kind}, ") for line in (tmp_path / "pairs.csv").read_text().splitlines())
    again = read_pairs(tmp_path / "pairs.csv", Scenes())
    assert keys(again) == keys(drawn)
    for one, other in zip(drawn, again, strict=True):
        for mine, read in ((one.anchor, other.anchor), (one.query, other.query)):
            assert np.array_equal(mine.target.T_cam_obj.matrix, read.target.T_cam_obj.matrix)
            assert mine.target.index == read.target.index


def test_lists_are_those_of_oryon_with_a_number_or_a_number_and_a_name(tmp_path: Path, bop_dataset: Path) -> None:
    (tmp_path / "real.txt").write_text(f"real_test, 1 10, 2 20, 6 {BOX}\n\nreal_test, 2 10, 1 40, 6 {BOX}\n")
    assert keys(read_pairs(tmp_path / "real.txt", Scenes())) == [(BOX, 1, 10, 2, 20), (BOX, 2, 10, 1, 40)]
    (tmp_path / "light.txt").write_text("test, 3 2, 3 5, 7\ntest, 3 2, 3 10, 4")
    pairs = read_pairs(tmp_path / "light.txt", BopDataset(bop_dataset))
    assert keys(pairs) == [("7", 3, 2, 3, 5), ("4", 3, 2, 3, 10)]
    write_pairs(tmp_path / "again.txt", pairs, BopDataset(bop_dataset))
    assert (tmp_path / "again.txt").read_text() == "same-scene, 3 2, 3 5, 7\nsame-scene, 3 2, 3 10, 4\n"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("test, 1 10, 2 20", "3 cells, expected SPLIT, SCENE IMAGE, SCENE IMAGE, OBJECT"),
        ("test, 1 10, 2, 2", "SCENE IMAGE, two whole numbers, got '2'"),
        ("test, 1 ten, 2 20, 2", "two whole numbers, got '1 ten'"),
        ("test, 1 10, 2 -20, 2", "two whole numbers, got '2 -20'"),
        ("test, 1 10, 2 20, tea_box", "NUMBER or NUMBER NAME, got 'tea_box'"),
        ("test, 1 10, 2 20, 3", "no object number 3; it has 1, 2"),
        ("test, 1 10, 2 20, 2 spoon", "no object 'spoon'; it has soup_can, tea_box"),
        ("test, 1 10, 3 20, 2", "no scene 3; it has 1, 2, 4"),
        ("test, 1 10, 2 25, 2", "no pose of object 'tea_box' in image 25 of scene 2; .* images 10 to 40"),
        ("test, 1 10, 4 20, 2", "no pose of object 'tea_box' in image 20 of scene 4; it has 0 there"),
        ("test, 1 10, 1 10, 2", "the same image"),
    ],
)
def test_a_damaged_line_is_told_with_its_file_and_number(line: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "pairs.csv"
    path.write_text(f"test, 1 10, 2 20, 2\n\n{line}\n")
    with pytest.raises(SourceError, match=f"pairs.csv, line 3: .*{words}"):
        read_pairs(path, Scenes())


def test_a_list_without_a_pair_or_that_is_not_there_is_refused(tmp_path: Path) -> None:
    (tmp_path / "empty.csv").write_text("\n")
    (tmp_path / "latin.csv").write_bytes(b"\xff\xfe\xe9")
    for name in ("empty.csv", "latin.csv", "absent.csv"):
        with pytest.raises(SourceError, match=name):
            read_pairs(tmp_path / name, Scenes())
    with pytest.raises(OutputError, match="cannot be written"):
        write_pairs(tmp_path / "no" / "pairs.csv", draw_pairs(Scenes(), "same-scene", 1, 0), Scenes())


@dataclass(frozen=True)
class Anchor:
    """Stands for a model: what it would have been made of."""

    frame: PosedFrame

    @property
    def object_id(self) -> str:
        return self.frame.object_id


@dataclass
class Oracle:
    """A method that looks up the truth."""

    model: Anchor
    config: TrackerConfig
    lost: frozenset[int]
    seen: list[int] = field(default_factory=list)

    def step(self, frame: Frame) -> tuple[TrackResult, ...]:
        self.seen.append(frame.index)
        object_id = self.model.object_id
        truth = turning(object_id, "240x180").sightings(object_id)[frame.index].T_cam_obj
        pose, state = (None, TrackState.LOST) if frame.index in self.lost else (truth, TrackState.TRACKING)
        return (
            TrackResult(frame.stamp_ns, object_id, pose, state, 0.5, None, "looked up", pose, None, {"total": 2.0}),
        )


@dataclass
class Oracles:
    """Opens one a pair, and makes the models."""

    made: list[Anchor] = field(default_factory=list)
    opened: list[Oracle] = field(default_factory=list)
    lost: frozenset[int] = frozenset()

    def onboard(self, frames: Sequence[PosedFrame], *_: object) -> Anchor:
        (frame,) = frames
        self.made.append(Anchor(frame))
        return self.made[-1]

    def open(self, name: str, models: Sequence[Anchor], config: TrackerConfig, _: object) -> Oracle:
        assert name == "ours"
        (model,) = models
        self.opened.append(Oracle(model, config, self.lost))
        return self.opened[-1]


@pytest.fixture
def oracles(monkeypatch: pytest.MonkeyPatch) -> Oracles:
    oracles = Oracles()
    monkeypatch.setattr("eval.pairs.one_shot.open_method", oracles.open)
    monkeypatch.setattr("eval.pairs.one_shot.onboard", oracles.onboard)
    return oracles


@pytest.fixture(scope="module")
def one_shot(attributes: SaliencyBackend) -> OneShot:
    return OneShot(attributes)


def test_a_method_that_knows_the_truth_has_no_error_and_a_lost_query_is_missing(
    oracles: Oracles, one_shot: OneShot
) -> None:
    oracles.lost = frozenset({2})
    pairs = draw_pairs(Scenes(), "cross-scene", 12, seed=0)
    answered = answer_pairs(Scenes(), pairs, one_shot)
    for pair, answer in zip(pairs, answered.answers, strict=True):
        expected = pair.query.target.T_cam_obj @ pair.anchor.target.T_cam_obj.inverse()
        assert (answer.T_query_anchor is None) == (pair.query.target.index == 2)
        if answer.T_query_anchor is not None:
            assert np.allclose(answer.T_query_anchor.matrix, expected.matrix, atol=1e-12)
    scores = score_pairs(Scenes(), pairs, answered.answers, {"kind": "cross-scene"})
    missing = sum(pair.query.target.index == 2 for pair in pairs)
    assert 0 < missing < 12
    assert (scores.pooled["instances"], scores.pooled["missing"]) == (12, missing)
    assert scores.protocol["kind"] == "cross-scene"
    assert scores.protocol["reference_frames"] == "an anchor is never its own query"
    assert max(row.add_m for row in scores.instances if not row.missing) < 1e-9


def test_each_method_gets_a_model_of_the_anchor_alone_and_one_query_and_no_prior(
    oracles: Oracles, one_shot: OneShot
) -> None:
    pairs = draw_pairs(Scenes(), "same-scene", 12, seed=0)
    answer_pairs(Scenes(), pairs, one_shot)
    given = [(o.model.object_id, o.model.frame.frame.index, *o.seen) for o in oracles.opened]
    assert sorted(given) == sorted((p.object_id, p.anchor.target.index, p.query.target.index) for p in pairs)
    assert not any(oracle.config.prior for oracle in oracles.opened)
    anchors = {(p.anchor.scene_id, p.anchor.target.index): p.anchor.target for p in pairs}
    assert len(oracles.made) == len(anchors) < 12
    for made in oracles.made:
        poses = [t.T_cam_obj for t in anchors.values() if t.index == made.frame.frame.index]
        assert any(np.array_equal(made.frame.T_cam_obj.matrix, pose.matrix) for pose in poses)
        assert np.array_equal(made.frame.mask, made.frame.frame.masks[made.object_id])


@pytest.mark.usefixtures("oracles")
def test_a_query_of_several_pairs_is_an_instance_of_each(one_shot: OneShot, tmp_path: Path) -> None:
    lines = [f"x, 1 {image}, 2 20, 2\n" for image in (10, 30)] + ["x, 4 10, 4 20, 1\n", "x, 1 10, 2 30, 2\n"]
    (tmp_path / "list.txt").write_text("".join(lines))
    pairs = read_pairs(tmp_path / "list.txt", Scenes())
    answers = list(answer_pairs(Scenes(), pairs, one_shot).answers)
    off = Pose(np.eye(3), np.array([0.03, 0, 0]))
    relative = answers[1].T_query_anchor
    assert relative is not None
    answers[1] = replace(answers[1], T_query_anchor=off @ relative)
    scores = score_pairs(Scenes(), pairs, answers, {})
    assert [round(row.add_m, 9) for row in scores.instances] == [0, 0.03, 0, 0]
    assert [(row.object_id, row.image_id) for row in scores.instances] == [(BOX, 20), (BOX, 20), (CAN, 20), (BOX, 30)]
    assert list(scores.per_object) == [CAN, BOX]
    assert scores.per_object[BOX]["instances"] == 3

    files = write_result_files(tmp_path, estimates_of(pairs, answers, Scenes()))
    assert [path.name for path in files] == ["results-1.csv", "results-2.csv"]
    first, second = map(read_results, files)
    assert [(e.scene_id, e.image_id, e.object_id) for e in first] == [(2, 20, 2), (4, 20, 1), (2, 30, 2)]
    assert [e.T_cam_obj.distance_to_m(pairs[1].query.target.T_cam_obj) for e in second] == [pytest.approx(0.03)]

    write_answers(tmp_path / "poses.jsonl", pairs, answers, scores.instances)
    told = [json.loads(line) for line in (tmp_path / "poses.jsonl").read_text().splitlines()]
    assert [(line["pair"], line["anchor"]["image"], line["query"]["image"]) for line in told] == [
        (1, 10, 20), (2, 30, 20), (3, 10, 20), (4, 10, 30),
    ]  # fmt: skip
    assert told[1]["errors"]["add_m"] == pytest.approx(0.03)
    assert np.allclose(told[1]["T_query_anchor"], (off @ relative).matrix)


def test_queries_that_are_in_one_pair_each_are_one_result_file(tmp_path: Path) -> None:
    pairs = draw_pairs(Scenes(), "same-scene", 1, 0)
    answers = [PairAnswer(Pose.identity(), 1.0, "", {})]
    assert write_result_files(tmp_path, estimates_of(pairs, answers, Scenes())) == [tmp_path / "results.csv"]
    assert len(read_results(tmp_path / "results.csv")) == 1
    nothing = [PairAnswer(None, 0.0, "lost", {})]
    assert write_result_files(tmp_path, estimates_of(pairs, nothing, Scenes())) == [tmp_path / "results.csv"]
    assert read_results(tmp_path / "results.csv") == []


def test_an_anchor_of_which_no_model_can_be_made_costs_its_pairs_and_is_told(
    attributes: SaliencyBackend, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "list.txt").write_text("x, 1 10, 2 20, 2\nx, 1 10, 2 30, 2\n")
    tiny = Scenes(size="64x64")
    pairs = read_pairs(tmp_path / "list.txt", tiny)
    with caplog.at_level(logging.WARNING):
        answered = answer_pairs(tiny, pairs, OneShot(attributes))
    assert list(answered.refused) == [f"1/{BOX}/10"]
    for answer in answered.answers:
        assert answer.T_query_anchor is None
        assert answer.reason == f"no model of the anchor: {answered.refused[f'1/{BOX}/10']}"
        assert not answer.timings_ms
    scores = score_pairs(tiny, pairs, answered.answers, {})
    assert (scores.pooled["missing"], scores.pooled["add_auc"]) == (2, 0)
    write_answers(tmp_path / "poses.jsonl", pairs, answered.answers, scores.instances)
    (first, _) = [json.loads(line) for line in (tmp_path / "poses.jsonl").read_text().splitlines()]
    assert (first["T_query_anchor"], first["errors"]["add_m"], first["errors"]["iou"]) == (None, None, 0.0)


def test_neighbouring_views_are_found_to_some_millimetres_and_again_in_another_order(
    one_shot: OneShot, tmp_path: Path
) -> None:
    (tmp_path / "list.txt").write_text("x, 1 10, 1 20, 2\nx, 1 30, 2 40, 2\nx, 1 10, 2 30, 2\n")
    pairs = read_pairs(tmp_path / "list.txt", Scenes())
    answered = answer_pairs(Scenes(), pairs, one_shot)
    assert answered.refused == {}
    scores = score_pairs(Scenes(), pairs, answered.answers, {})
    assert max(row.add_m for row in scores.instances) < 0.005
    backwards = answer_pairs(Scenes(), pairs[::-1], one_shot)
    for one, other in zip(answered.answers, backwards.answers[::-1], strict=True):
        assert one.T_query_anchor is not None
        assert other.T_query_anchor is not None
        assert np.array_equal(one.T_query_anchor.matrix, other.T_query_anchor.matrix)


def test_a_method_that_needs_a_start_cannot_answer_a_pair(attributes: SaliencyBackend) -> None:
    with pytest.raises(ConfigError, match="method icp goes on from a pose"):
        OneShot(attributes, method="icp")
    assert not OneShot(attributes, TrackerConfig(prior=True)).config.prior
