"""A dataset of rendered scenes in BOP's layout, small enough to be tracked in a test."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import trimesh

from tests.recordings import write_picture
from tracker.sources.synthetic import SyntheticScene, open_scene


def write_bop(folder: Path, scenes: dict[int, str]) -> str:
    """scenes: number -> name of a synthetic scene. Objects get the numbers of their sorted names. Returns the dataset's
    name for `open_dataset`."""
    opened = {scene_id: open_scene(name) for scene_id, name in scenes.items()}
    names = sorted({object_id for scene in opened.values() for object_id in scene.object_ids})
    models = {}
    (folder / "models").mkdir(parents=True)
    for number, name in enumerate(names, 1):
        scene = next(scene for scene in opened.values() if name in scene.object_ids)
        shape = scene.shape(name)
        mesh = trimesh.Trimesh(1000 * shape.vertices_m, shape.triangles, process=False)
        mesh.export(folder / "models" / f"obj_{number:06d}.ply")
        models[number] = {"diameter": 1000 * shape.diameter_m}
    (folder / "models" / "models_info.json").write_text(json.dumps(models))
    for scene_id, scene in opened.items():
        _write_scene(folder / "test" / f"{scene_id:06d}", scene, names)
    return f"bop:{folder}"


def _write_scene(folder: Path, scene: SyntheticScene, names: list[str]) -> None:
    cameras, truth, info = {}, {}, {}
    sightings = {name: {s.index: s for s in scene.sightings(name)} for name in scene.object_ids}
    for frame in scene:
        k, image = frame.intrinsics, f"{frame.index:06d}"
        cam_K = [k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1]
        cameras[frame.index] = {"cam_K": cam_K, "depth_scale": 0.1}
        truth[frame.index], info[frame.index] = [], []
        write_picture(folder / "rgb" / f"{image}.png", frame.rgb)
        write_picture(folder / "depth" / f"{image}.png", (frame.depth_m * 10_000).round().astype(np.uint16))
        for place, name in enumerate(scene.object_ids):
            seen = sightings[name][frame.index]
            mask = frame.masks[name].astype(np.uint8) * 255
            file = folder / "mask_visib" / f"{image}_{place:06d}.png"
            file.parent.mkdir(exist_ok=True)
            cv2.imwrite(str(file), mask)
            T = seen.T_cam_obj
            R, t_mm = T.rotation.ravel().tolist(), (1000 * T.translation_m).tolist()
            truth[frame.index].append({"obj_id": names.index(name) + 1, "cam_R_m2c": R, "cam_t_m2c": t_mm})
            info[frame.index].append({"px_count_visib": seen.visible_px, "visib_fract": seen.visible_fraction})
    for name, content in (("scene_camera", cameras), ("scene_gt", truth), ("scene_gt_info", info)):
        (folder / f"{name}.json").write_text(json.dumps(content))
