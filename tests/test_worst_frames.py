"""Where a run was worst: which instances, what is drawn of them, what is said of poses that are missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
import pytest

from eval.bop_results import Estimate
from eval.datasets import Target
from eval.datasets.synthetic import SyntheticDataset
from eval.frame_record import FrameRecord
from eval.instances import InstanceError, measure
from eval.worst_frames import MissingPoses, missing_poses, worst_instances
from eval.worst_pictures import ESTIMATE, LARGEST_BYTES, SIZE, TRUTH, draw_cutout, jpeg, worst_frames
from tracker.errors import FrameError, SourceError
from tracker.frame import Frame, PosedFrame
from tracker.geometry import Pose
from tracker.overlay import box_corners
from tracker.sources import Sighting
from tracker.sources.synthetic import ObjectShape, open_scene

BOX = "tea_box"
SMALL = open_scene(f"turn?size=160x120&frames=6&object={BOX}")
CORNERS = box_corners(np.array([[-0.05, -0.05, -0.05], [0.05, 0.05, 0.05]]))


def instance(image_id: int, add_m: float, symmetric: bool | None = False, object_id: str = "mug") -> InstanceError:
    missing = not np.isfinite(add_m)
    errors = (0.12, add_m, add_m / 10, 1.0, add_m, missing, 1.0, add_m, 5.0, 0.5, symmetric, None)
    return InstanceError(1, image_id, object_id, *errors)


def at(x_m: float, z_m: float = 0.6) -> Pose:
    return Pose(np.eye(3), np.array([x_m, 0.0, z_m]))


def test_the_worst_have_the_largest_add_s_where_symmetric_and_the_largest_add_elsewhere() -> None:
    rows = [instance(0, 0.01), instance(1, 0.09, True), instance(2, 0.02, None), instance(3, np.inf), instance(4, 0.01)]
    assert [row.image_id for row in worst_instances(rows)] == [2, 0, 4, 1]
    assert [row.image_id for row in worst_instances(rows, 2)] == [2, 0]
    assert len(worst_instances([instance(k, 0.01) for k in range(30)])) == 12


def test_missing_poses_are_grouped_by_the_reason_that_was_given() -> None:
    rows = [instance(k, np.inf) for k in (3, 1, 2)] + [instance(4, 0.1), instance(1, np.inf, object_id="can")]
    records = [FrameRecord(1, k, "mug", "lost", 0.0, "no depth" if k == 2 else "hidden") for k in (1, 2, 3)]
    assert missing_poses(rows, records) == [
        MissingPoses(1, "mug", "lost: hidden", (1, 3)),
        MissingPoses(1, "mug", "lost: no depth", (2,)),
        MissingPoses(1, "can", "no step of the run was about it", (1,)),
    ]
    assert {group.reason for group in missing_poses(rows, [])} == {"the results have no row of it"}


def like(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """(N, 2) rows and columns of the pixels of a colour."""
    return np.argwhere((np.abs(picture.astype(int) - colour) < 12).all(axis=2))


def test_a_cutout_shows_both_boxes_whole_and_large(globe: Callable[..., PosedFrame]) -> None:
    picture = draw_cutout(globe(at(0.1)).frame, at(0.13), at(0.1), CORNERS)
    assert picture.shape == (SIZE[1], SIZE[0], 3)
    green, red = like(picture, TRUTH), like(picture, ESTIMATE)
    for pixels in (green, red):
        assert (pixels.min(axis=0) > 3).all()
        assert (pixels.max(axis=0) < np.array(picture.shape[:2]) - 4).all()
    assert np.ptp(np.vstack((green, red)), axis=0).max() > 0.6 * SIZE[1]
    assert red[:, 1].mean() > green[:, 1].mean() + 10  # the estimate is to the right of the truth


def test_the_truth_in_a_cutout_is_where_the_object_is(globe: Callable[..., PosedFrame]) -> None:
    posed = globe(at(0.1), paint=lambda places: np.full_like(places, 250.0))
    picture = draw_cutout(posed.frame, at(0.1), at(0.1), CORNERS)
    ball = np.argwhere((picture > 240).all(axis=2)).mean(axis=0)
    box = like(picture, TRUTH)
    assert np.abs(ball - (box.min(axis=0) + box.max(axis=0)) / 2).max() < 12


@pytest.mark.parametrize("estimate", [at(50.0), at(0.0, -0.6), at(0.0, 0.012)])
def test_an_estimate_that_is_far_off_does_not_hide_the_object(estimate: Pose, globe: Callable[..., PosedFrame]) -> None:
    picture = draw_cutout(globe(at(0.0)).frame, estimate, at(0.0), CORNERS)
    assert np.ptp(like(picture, TRUTH), axis=0).max() > 30


def test_a_true_pose_behind_the_camera_has_no_cutout(globe: Callable[..., PosedFrame]) -> None:
    with pytest.raises(FrameError, match="behind the camera"):
        draw_cutout(globe(at(0.0)).frame, at(0.0), at(0.0, -1.0), CORNERS)


def test_a_picture_fits_its_bytes_whatever_is_in_it() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (SIZE[1], SIZE[0], 3), np.uint8)
    smooth = np.full((SIZE[1], SIZE[0], 3), (200, 30, 10), np.uint8)
    assert len(jpeg(noise)) <= LARGEST_BYTES
    read = cv2.imdecode(np.frombuffer(jpeg(smooth), np.uint8), cv2.IMREAD_COLOR)
    assert read is not None
    assert np.abs(read[:, :, ::-1].astype(int) - smooth).max() < 5  # and RGB stays RGB


@dataclass(frozen=True)
class Counted:
    """The small scene, with a note of every picture that is read; picture 4 cannot be."""

    name: str = "counted"
    object_ids: tuple[str, ...] = (BOX,)
    read: list[int] = field(default_factory=list)

    def __len__(self) -> int:
        return len(SMALL)

    def __getitem__(self, index: int) -> Frame:
        self.read.append(index)
        if index == 4:
            raise SourceError("rgb/000004.png: cannot be read")
        return SMALL[index]

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def sightings(self, object_id: str) -> Sequence[Sighting]:
        return SMALL.sightings(object_id)

    def shape(self, object_id: str) -> ObjectShape:
        return SMALL.shape(object_id)


def shifted(target: Target, x_m: float) -> Estimate:
    moved = replace(target.T_cam_obj, translation_m=target.T_cam_obj.translation_m + np.array([x_m, 0, 0]))
    return Estimate(1, target.image_id, 1, 0.7, moved)


def test_only_the_worst_frames_are_read_again_and_one_that_cannot_be_is_told() -> None:
    targets = SyntheticDataset(SMALL).targets(1)
    estimates = [shifted(targets[2], 0.03), shifted(targets[4], 0.05)]
    rows = measure(SyntheticDataset(SMALL), estimates).errors
    source = Counted()
    found = worst_frames(SyntheticDataset(source), rows, estimates)
    assert [w.row.image_id for w in found] == [4, 2]
    assert source.read == [4, 2]
    assert (found[0].jpeg, found[0].why_not) == (None, "rgb/000004.png: cannot be read")
    assert found[1].jpeg is not None
    assert found[1].score == 0.7
    read = cv2.imdecode(np.frombuffer(found[1].jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert read is not None
    assert read.shape == (240, 320, 3)
