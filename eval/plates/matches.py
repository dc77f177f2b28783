"""A picture of which points of a frame were taken for which of a model, and which of these matches were right."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from eval.plates.cutout import Cutout, corners_of, cut_out
from reference.sheet import FAINT, Picture, Sheet, line_px
from tracker.cloud import PointCloud, lift
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import FrameError
from tracker.frame import Frame, Mask, PosedFrame
from tracker.geometry import Floats, Pose
from tracker.matching import Correspondences, Matcher
from tracker.saliency import Query, SaliencyBackend
from tracker.view import bounding_box, view_object

INLIER, OUTLIER = (0, 158, 115), (213, 94, 0)  # RGB, of Okabe and Ito
SAME_PLACE = 0.1  # of the diameter: as near as the matcher counts a place as the same
DRAWN = {True: 60, False: 20}  # of the right and of the wrong ones
SHOWS = 0.2  # least cosine between a surface and the direction to the camera that shows it
MARGIN_PX = 12


def match_plate(
    frame: Frame, mask: Mask, T_cam_obj: Pose, model: ConceptModel, backend: SaliencyBackend, config: TrackerConfig,
    width: int,
) -> Picture:  # fmt: skip
    """(H, width, 3) uint8 RGB: the object in the frame, and in the reference view that shows most of the same side.

    mask: its pixels. T_cam_obj: its pose, which tells right from wrong. Raises FrameError where there is nothing to
    match, or the model has no reference views.
    """
    view = view_object(frame, mask, model.diameter_m, config.view)
    if view is None or not model.references:
        raise FrameError(f"object {model.object_id!r}, frame {frame.index}: there is nothing to match, or no reference")
    (saliency,) = backend([Query(view, model.labels)])
    cloud = lift(view, saliency, config.cloud)
    matches = Matcher(model, config.matching, config.torch_device)(cloud)
    right = _right(matches, cloud, model, T_cam_obj)
    reference = _nearest_view(model, T_cam_obj)
    line, half = line_px(width), (width - 3 * MARGIN_PX) // 2
    top, height = MARGIN_PX + 2 * line, half * 3 // 4
    sheet = Sheet(width, top + height + 3 * line)
    title = f"{model.object_id}, frame {frame.index}: {len(matches)} matches of {len(cloud)} points to {len(model)}, "
    title += f"{np.count_nonzero(right)} within {SAME_PLACE:.0%} of the diameter"
    sheet.write(title, MARGIN_PX, MARGIN_PX)
    seen = cut_out(frame, corners_of(mask), half, height)
    known = cut_out(_on_paper(reference), corners_of(reference.mask), half, height)
    lefts = MARGIN_PX, 2 * MARGIN_PX + half
    for left, cutout in zip(lefts, (seen, known), strict=True):
        sheet.put(cutout.rgb, left, top)
    ends = _ends(matches, cloud, model, reference, seen, known)
    ends += np.array([(lefts[0], top), (lefts[1], top)])
    shown = _shown(matches, model, reference)
    for good, colour in ((False, OUTLIER), (True, INLIER)):
        chosen = np.flatnonzero(shown & (right == good))
        chosen = chosen[np.linspace(0, len(chosen) - 1, min(len(chosen), DRAWN[good])).astype(int)]
        for (x0, y0), (x1, y1) in np.rint(ends[chosen]).astype(int).tolist():
            cv2.line(sheet.rgb, (x0, y0), (x1, y1), colour, 1, cv2.LINE_AA)
            for end in ((x0, y0), (x1, y1)):
                cv2.circle(sheet.rgb, end, max(2, line // 6), colour, -1, cv2.LINE_AA)
    below = top + height + 4
    sheet.write("this frame", lefts[0], below, FAINT)
    sheet.write(f"reference view, frame {reference.frame.index}", lefts[1], below, FAINT)
    sheet.write(f"up to {DRAWN[True]} right matches", lefts[0], below + line, INLIER)
    sheet.write(f"up to {DRAWN[False]} wrong ones", lefts[1], below + line, OUTLIER)
    return sheet.rgb


def _right(matches: Correspondences, cloud: PointCloud, model: ConceptModel, T_cam_obj: Pose) -> npt.NDArray[np.bool_]:
    """(M,) those whose ends are at the same place under the pose, or one that looks the same."""
    seen, known = cloud.points[matches.query_index], model.points[matches.model_index]
    found = [pose.inverse() @ seen for pose in model.symmetry.equivalents(T_cam_obj)]
    off_m = np.min([np.linalg.norm(_place(each, model) - _place(known, model), axis=1) for each in found], axis=0)
    return np.asarray(off_m < SAME_PLACE * model.diameter_m, bool)


def _place(points: Floats, model: ConceptModel) -> Floats:
    """Where points (N, 3) are on the object; if it is a solid of revolution, how far along the axis and off it."""
    axis = model.symmetry.axis
    if axis is None:
        return points
    arms = points - model.symmetry.origin_m
    along = arms @ axis
    return np.stack((along, np.linalg.norm(arms - along[:, None] * axis, axis=1)), axis=1)


def _nearest_view(model: ConceptModel, T_cam_obj: Pose) -> PosedFrame:
    here = T_cam_obj.inverse().translation_m
    cameras = [reference.T_cam_obj.inverse().translation_m for reference in model.references]
    cosines = [here @ there / (np.linalg.norm(here) * np.linalg.norm(there)) for there in cameras]
    return model.references[int(np.argmax(cosines))]


def _on_paper(reference: PosedFrame) -> Frame:
    """The reference frame, white where nothing was kept of it."""
    rgb = reference.frame.rgb.copy()
    box = bounding_box(reference.mask)
    if box is not None:
        kept = rgb[box.y0 : box.y1, box.x0 : box.x1].copy()
        rgb[:] = 255
        rgb[box.y0 : box.y1, box.x0 : box.x1] = kept
    return replace(reference.frame, rgb=rgb)


def _shown(matches: Correspondences, model: ConceptModel, reference: PosedFrame) -> npt.NDArray[np.bool_]:
    """(M,) those whose model point the reference view shows."""
    points_cam = reference.T_cam_obj @ model.points[matches.model_index]
    normals_cam = model.normals[matches.model_index] @ reference.T_cam_obj.rotation.T
    towards = -(normals_cam * points_cam).sum(axis=1) / np.linalg.norm(points_cam, axis=1)
    return np.asarray(towards > SHOWS, bool)


def _ends(
    matches: Correspondences, cloud: PointCloud, model: ConceptModel, reference: PosedFrame, seen: Cutout, known: Cutout
) -> Floats:
    """(M, 2, 2): of every match the pixel in either cutout."""
    here = seen.camera.project(cloud.points[matches.query_index])
    there = known.camera.project(reference.T_cam_obj @ model.points[matches.model_index])
    return np.stack((here, there), axis=1)
