"""A picture of what an object was onboarded from: its reference views, and where on the viewing sphere they are."""

from __future__ import annotations

import cv2
import numpy as np

from reference.quality import SEEN_WITHIN_RAD
from reference.sheet import FAINT, INK, Picture, Sheet, fitted, line_px
from tracker.concept import ConceptModel
from tracker.frame import PosedFrame
from tracker.geometry import Floats
from tracker.view import bounding_box

UNSEEN, MARK = (225, 225, 225), (213, 94, 0)  # RGB
MARGIN_PX = 12
WIDTH_PX = 1600


def view_plate(model: ConceptModel, width: int = WIDTH_PX) -> Picture:
    """(H, width, 3) uint8 RGB. On the left both halves of the viewing sphere, from outside: where a camera sees what a
    reference view saw, the brighter the nearer it is; on the right the views, by number; below, what the model is."""
    line = line_px(width)
    half, disc = (width - 3 * MARGIN_PX) // 2, (width - 3 * MARGIN_PX) // 4 - MARGIN_PX
    lines = _said(model)
    top = MARGIN_PX + 2 * line
    below = top + disc + 3 * line
    sheet = Sheet(width, below + (len(lines) + 1) * line)
    sheet.write(
        f"{model.object_id}: {len(model.references)} reference views, backend {model.backend}", MARGIN_PX, MARGIN_PX
    )
    for side, name in ((1, "from +z"), (-1, "from -z")):
        left = MARGIN_PX if side > 0 else 2 * MARGIN_PX + disc
        sheet.put(_half_sphere(model.view_directions, side, disc, line), left, top)
        right = "+x right" if side > 0 else "+x left"
        sheet.write(f"{name}, {right}, +y up", left, top + disc + 4, FAINT)
    _put_views(sheet, model.references, 2 * MARGIN_PX + half, top, half, disc + line)
    for text in lines:
        below = sheet.write(text, MARGIN_PX, below)
    return sheet.rgb


def _half_sphere(directions: Floats, side: int, size: int, line: int) -> Picture:
    """Lambert's azimuthal projection, in which equal areas of the sphere are equal areas of the disc."""
    ends = np.linspace(-1, 1, size)
    right, up = np.meshgrid(ends, -ends)
    radius = np.hypot(right, up)
    along = 1 - radius**2
    across = np.sqrt(np.maximum(2 - radius**2, 0))
    towards = np.stack((side * right * across, up * across, side * along), axis=-1)
    nearest = (towards @ directions.T).max(axis=-1)
    seen = np.clip((nearest - np.cos(SEEN_WITHIN_RAD)) / (1 - np.cos(SEEN_WITHIN_RAD)), 0, 1)
    shades = cv2.applyColorMap(np.rint(60 + 195 * seen).astype(np.uint8), cv2.COLORMAP_VIRIDIS)[:, :, ::-1]
    disc = np.where((nearest > np.cos(SEEN_WITHIN_RAD))[..., None], shades, np.array(UNSEEN, np.uint8))
    disc = np.ascontiguousarray(np.where((radius <= 1)[..., None], disc, np.uint8(255)))
    for number, direction in enumerate(directions, start=1):
        if side * direction[2] < 0:
            continue
        reach = 1 / np.sqrt(1 + side * direction[2])
        place = (np.array((side * direction[0], -direction[1])) * reach + 1) / 2 * (size - 1)
        at = (round(float(place[0])), round(float(place[1])))
        cv2.circle(disc, at, line // 2 + 2, MARK, -1, cv2.LINE_AA)
        text_at = (at[0] - line // 4 - (4 if number > 9 else 0), at[1] + line // 4 + 1)
        cv2.putText(disc, str(number), text_at, cv2.FONT_HERSHEY_SIMPLEX, line / 38, (255, 255, 255), 1, cv2.LINE_AA)
    return disc


def _put_views(sheet: Sheet, views: tuple[PosedFrame, ...], left: int, top: int, width: int, height: int) -> None:
    count = max(len(views), 1)
    columns = max(range(1, count + 1), key=lambda n: min(width // n, height // -(-count // n)))
    rows = -(-count // columns)
    cell, tall = width // columns, height // rows
    for k, view in enumerate(views):
        box = bounding_box(view.mask)
        x, y = left + k % columns * cell, top + k // columns * tall
        if box is not None:
            crop = view.frame.rgb[box.y0 : box.y1, box.x0 : box.x1]
            sheet.put(fitted(crop, cell - MARGIN_PX, tall - sheet.line_px - 4), x, y)
        sheet.write(f"{k + 1}: frame {view.frame.index}", x, y + tall - sheet.line_px, INK, cell)


def _said(model: ConceptModel) -> list[str]:
    quality = model.notes.get("quality")
    said = [f"{len(model)} points, diameter seen {model.diameter_m * 1000:.0f} mm, symmetry: {model.symmetry}"]
    if quality:
        within = f"within {np.degrees(SEEN_WITHIN_RAD):.0f} degrees of a view"
        said.append(f"{quality['coverage']:.0%} of the viewing sphere {within}")
        if len(model.view_directions) > 1:
            said[-1] += f"; {quality['shared']:.0%} of the points seen twice, agreeing to {quality['agreement']:.2f}"
        said += [f"missing: {problem}" for problem in quality["problems"]]
    return said
