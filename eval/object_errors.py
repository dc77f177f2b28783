"""All errors of the poses of one object that need no picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eval.box_overlap import NOCS_STEPS, box_iou
from eval.datasets import ObjectModel
from eval.metrics import add, adds, rotation_error_deg, translation_error_m
from eval.symmetric_errors import mspd, mssd, symmetric_rotation_error_deg
from tracker.geometry import Intrinsics, Pose


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """The errors of one pose.

    add_m, adds_m: ADD and ADD-S. rotation_deg, translation_m: of the object frames. symmetric_rotation_deg: the least
    over the declared symmetries. mssd_m, mspd_px: see `eval.symmetric_errors`; mspd_px is NaN where no camera is known.
    iou: 3D IoU of the posed boxes, in [0, 1].
    """

    add_m: float
    adds_m: float
    rotation_deg: float
    translation_m: float
    symmetric_rotation_deg: float
    mssd_m: float
    mspd_px: float
    iou: float


def missing_pose(with_camera: bool) -> PoseErrors:
    """What a pose that was not given has: infinite errors and no overlap."""
    return PoseErrors(*(np.inf,) * 6, mspd_px=np.inf if with_camera else np.nan, iou=0.0)


def pose_errors(
    model: ObjectModel, estimated: Sequence[Pose], truth: Sequence[Pose], cameras: Sequence[Intrinsics] | None
) -> list[PoseErrors]:
    """Of every pair of poses, both `T_cam_obj`, in the camera of its image."""
    points_m, motions = model.points_m, model.symmetries.motions()
    columns = (
        add(points_m, estimated, truth),
        adds(points_m, estimated, truth),
        rotation_error_deg(estimated, truth),
        translation_error_m(estimated, truth),
        symmetric_rotation_error_deg(model.symmetries, estimated, truth),
        mssd(points_m, motions, estimated, truth),
        np.full(len(truth), np.nan) if cameras is None else mspd(points_m, motions, estimated, truth, cameras),
        box_iou(points_m, model.symmetries.motions(NOCS_STEPS), estimated, truth),
    )
    return [PoseErrors(*map(float, row)) for row in zip(*columns, strict=True)]
