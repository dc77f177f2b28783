"""What errors ask of pictures: every image is read once, and none where its camera is told without it."""

from __future__ import annotations

import numpy as np
import pytest

from eval.datasets import open_dataset
from eval.pictures import Cameras, PosePair, surface_errors
from tracker.frame import Frame
from tracker.sources.synthetic import SyntheticScene


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Indices of the frames that were read."""
    indices: list[int] = []
    whole = SyntheticScene.__getitem__

    def counted(self: SyntheticScene, index: int) -> Frame:
        indices.append(index)
        return whole(self, index)

    monkeypatch.setattr(SyntheticScene, "__getitem__", counted)
    return indices


def test_every_image_is_read_once_for_all_its_objects(read: list[int]) -> None:
    dataset = open_dataset("synthetic:tabletop?frames=2&size=160x120&noise=0")
    models = {object_id: dataset.model(object_id) for object_id in dataset.object_ids}
    targets = sorted(dataset.targets(1), key=lambda target: target.object_id)  # not in the order of images
    pairs = [PosePair(1, t.index, t.object_id, t.T_cam_obj, t.T_cam_obj, k) for k, t in enumerate(targets)]
    errors = surface_errors(dataset, pairs, models)
    assert read == [0, 1]
    assert sorted(errors) == list(range(len(targets)))
    assert not np.any(list(errors.values()))


def test_a_camera_is_told_without_its_picture(read: list[int]) -> None:
    dataset = open_dataset("synthetic:tabletop?frames=2&size=160x120")
    cameras = Cameras(dataset)
    told = cameras(1, 1)
    assert read == []
    assert dataset.scene(1)[1].intrinsics == told
