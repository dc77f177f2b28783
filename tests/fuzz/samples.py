"""Small files of every kind, whole: what damage starts from. Each function fills an empty folder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import trimesh

from eval.bop_results import Estimate, write_results
from eval.calibration.rows import write_poses
from eval.frame_record import FrameRecord
from eval.kept_units import KeptUnits
from eval.summary import TrackingCounts
from eval.track_run import fingerprint_of
from eval.tracked import Tracked
from reference.vocabulary import Vocabulary, VocabularySet, write_vocabulary
from tests import ros_bags, test_nocs, test_tum, test_ycb_video
from tests.conftest import draw_globe
from tests.drawn_bop import draw_bop
from tests.recordings import CORNERS_M, pose, write_matrix, write_obj, write_picture, write_text
from tests.test_calibration import POSE
from tests.test_concept import model
from tracker.config import TrackerConfig, dump_config
from tracker.geometry import Intrinsics
from tracker.saved_run import SavedRun

DECIDED_BY = {"scene": 3, "what": "a test"}
PIXELS = np.random.default_rng(0).integers(0, 256, (36, 48, 3), np.uint8)


def bop(folder: Path) -> None:
    """With models of both kinds of PLY, symmetries and a list of targets."""
    draw_bop(folder)
    (folder / "models").mkdir()
    mesh = trimesh.convex.convex_hull(1000 * CORNERS_M)
    (folder / "models" / "obj_000004.ply").write_bytes(bytes(mesh.export(file_type="ply", encoding="ascii")))
    mesh.export(folder / "models" / "obj_000007.ply")
    turn = [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    turns = {"symmetries_discrete": [turn], "symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}]}
    write_text(
        folder / "models" / "models_info.json", json.dumps({"4": {"diameter": 74.8}, "7": {"diameter": 74.8, **turns}})
    )
    targets = [
        {"im_id": image_id, "inst_count": 1, "obj_id": number, "scene_id": 3}
        for image_id, number in ((2, 4), (5, 7), (10, 4))
    ]
    write_text(folder / "test_targets_bop19.json", json.dumps(targets))


def results(folder: Path) -> None:
    write_results(folder / "method_set-test.csv", [Estimate(3, k, 4, 0.5, pose(k / 100), 0.1) for k in range(5)])


def pairs(folder: Path) -> None:
    bop(folder / "bop")
    write_text(folder / "pairs.csv", "same-scene, 3 2, 3 5, 4\nsame-scene, 3 5, 3 10, 4 4\n\ntest, 3 2, 3 5, 7\n")


def ycb_video(folder: Path) -> None:
    test_ycb_video.write_image(folder / "data" / "0048", 1, [14, 13])
    write_text(folder / "keyframe.txt", "0048/000001\n")
    write_text(folder / "image_sets" / "classes.txt", "\n".join(f"{k:03d}_thing" for k in range(1, 15)) + "\n")
    for k in (13, 14):
        write_obj(folder / "models" / f"{k:03d}_thing" / "textured.obj")
    write_text(folder / "models" / "014_thing" / "points.xyz", "\n".join(" ".join(map(str, p)) for p in CORNERS_M))


def nocs(folder: Path) -> None:
    test_nocs.write_image(folder / "real_test" / "scene_1", 0)
    for name in (test_nocs.MUG, test_nocs.CAN):
        write_matrix(test_nocs.pose_file(folder, 1, name, 0), pose(0.1).matrix)
        write_obj(folder / "obj_models" / "real_test" / f"{name}.obj")
        write_text(folder / "obj_models" / "real_test" / f"{name}.txt", "0.06 0.04 0.02")


def pictures(folder: Path) -> None:
    write_picture(folder / "depth.png", PIXELS[:, :, 0].astype(np.uint16) * 20)
    write_picture(folder / "colour.png", PIXELS)
    write_picture(folder / "colour.jpg", PIXELS)
    cv2.imwrite(str(folder / "labels.png"), PIXELS[:, :, 1])


def tum(folder: Path) -> None:
    stamps = [test_tum.stamp(k) for k in range(3)]
    test_tum.write(folder, stamps, stamps)
    write_text(folder / "camera.txt", "60 61 # focal lengths\n23.5 17\n")


def associated(folder: Path) -> None:
    tum(folder)
    stamps = [test_tum.stamp(k) for k in range(3)]
    write_text(folder / "associations.txt", "".join(f"{s} rgb/{s}.png {s} depth/{s}.png\n" for s in stamps))


def pictures_in_a_folder(folder: Path) -> None:
    """FoundationPose's layout."""
    for k in range(2):
        write_picture(folder / "rgb" / f"{k}.png", PIXELS)
        write_picture(folder / "depth" / f"{k}.png", np.full((36, 48), 800 + k, np.uint16))
        write_picture(folder / "masks" / f"{k}.png", np.full((36, 48), 255, np.uint8))
        write_matrix(folder / "annotated_poses" / f"{k}.txt", pose(0.1).matrix)
    write_text(folder / "cam_K.txt", "60 0 23.5\n0 61 17\n0 0 1\n")


def concept_model(folder: Path) -> None:
    camera = Intrinsics(60.0, 61.0, 23.5, 17.0, 48, 36)
    views = tuple(draw_globe(pose(k / 100), camera, index=k) for k in range(2))
    replace(model(20), references=views).save(folder / "a.concept")


def settings(folder: Path) -> None:
    write_text(folder / "config.yaml", dump_config(TrackerConfig()))
    write_text(folder / "preset.yaml", (Path(__file__).parents[2] / "eval" / "presets" / "voxels.yaml").read_text())


def vocabulary(folder: Path) -> None:
    both = (Vocabulary("mug", ("red handle", "rim"), "default", "a model"), Vocabulary("can", ("lid", "grün")))
    write_vocabulary(folder / "vocabulary.yaml", VocabularySet("seed", both))


def answer(folder: Path) -> None:
    write_text(folder / "answer.txt", '```json\n["handle", "rim", "bottom of the cup", "größte Fläche"]\n```')


def saved_run(folder: Path) -> None:
    SavedRun("bop:here:1", ("a.concept",), "large", "cpu", ("a=1,2",)).save(folder)


def judged(folder: Path) -> None:
    write_poses(folder / "poses.json", {"seeds": 2}, [POSE, POSE])


def kept_unit(folder: Path) -> None:
    record = FrameRecord(3, 1, "mug", "tracking", 0.9, "")
    counts = {"mug": TrackingCounts(3, 1, 1)}
    tracked = Tracked([Estimate(3, 1, 4, 0.5, pose(0.1))], {(3, "mug", 2)}, counts, [{"a": 1.0}], {}, [record])
    KeptUnits(folder).keep(DECIDED_BY, tracked)
    (folder / fingerprint_of(DECIDED_BY)).rename(folder / "unit")


def bag(kind: str, folder: Path) -> None:
    """kind: one of `ros_bags.BAGS`."""
    ros_bags.write_bag(folder, kind, ros_bags.Camera(frames=2).messages())
