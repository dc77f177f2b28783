"""A scene in BOP's layout, drawn by hand: every pixel says where it is from."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np


def draw_bop(path: Path) -> None:
    """A dataset in BOP's layout with scene 3 of the split `test`: images 2, 5 and 10 of 48 x 36 pixels.

    Object 4 is in all images, object 7 in the first two, and twice in image 5. Pixel (row, column) of image I has the
    colour (I, row, column) and a depth of 500 + I millimetres, in units of a millimetre, in image 10 of a tenth of one.
    Object 4 is the columns 10 to 19 (15 to 19 can be seen), object 7 the columns 20 to 29, its copy the last ones.
    """
    folder = path / "test" / "000003"
    for name in ("rgb", "depth", "mask", "mask_visib"):
        (folder / name).mkdir(parents=True)
    present = {2: (4, 7), 5: (7, 4, 7), 10: (4,)}
    cameras, truth, info = {}, {}, {}
    for image_id, object_ids in present.items():
        rows, columns = np.indices((36, 48)).astype(np.uint8)
        bgr = np.dstack((columns, rows, np.full_like(rows, image_id)))
        cv2.imwrite(str(folder / "rgb" / f"{image_id:06d}.png"), bgr)
        unit_mm = 0.1 if image_id == 10 else 1.0
        depth = np.full((36, 48), round((500 + image_id) / unit_mm), np.uint16)
        depth[:, :5] = 0
        cv2.imwrite(str(folder / "depth" / f"{image_id:06d}.png"), depth)
        cameras[image_id] = {"cam_K": [60.0, 0, 23 + image_id / 10, 0, 61.0, 17, 0, 0, 1], "depth_scale": unit_mm}
        truth[image_id], info[image_id] = [], []
        for place, object_id in enumerate(object_ids):
            first = 40 if (image_id, place) == (5, 2) else {4: 10, 7: 20}[object_id]
            whole = (columns >= first) & (columns < first + 10)
            seen = whole & (columns >= 15)
            name = f"{image_id:06d}_{place:06d}.png"
            cv2.imwrite(str(folder / "mask" / name), whole.astype(np.uint8) * 255)
            cv2.imwrite(str(folder / "mask_visib" / name), seen.astype(np.uint8) * 255)
            turn = [0, -1, 0, 1, 0, 0, 0, 0, 1]
            truth[image_id].append({"obj_id": object_id, "cam_R_m2c": turn, "cam_t_m2c": [first, image_id, 500]})
            fraction = float(seen.sum() / whole.sum())
            info[image_id].append({"px_count_visib": int(seen.sum()), "visib_fract": fraction})
    for name, content in (("scene_camera", cameras), ("scene_gt", truth), ("scene_gt_info", info)):
        (folder / f"{name}.json").write_text(json.dumps(content))
