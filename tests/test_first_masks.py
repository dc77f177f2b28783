"""Every object is pointed out once, in the first frame that shows enough of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tracker.first_masks import LEAST_PX, FirstMasks
from tracker.frame import Frame
from tracker.geometry import Intrinsics


def test_each_object_is_pointed_out_once_where_enough_of_it_is_seen() -> None:
    little, much = np.zeros((40, 40), bool), np.zeros((40, 40), bool)
    little.flat[: LEAST_PX - 1], much.flat[:LEAST_PX] = True, True
    camera = Intrinsics(40, 40, 20, 20, 40, 40)
    frame = Frame(np.zeros((40, 40, 3), np.uint8), np.ones((40, 40), np.float32), camera, 0)
    given = [{"mug": much, "can": little}, {"mug": much, "can": much}, {"mug": much, "can": much}, {}]
    first = FirstMasks()
    seen = [set(first(replace(frame, masks=masks)).masks) for masks in given]
    assert seen == [{"mug"}, {"can"}, set(), set()]
    assert set(FirstMasks()(replace(frame, masks=given[2])).masks) == {"mug", "can"}
    assert set(FirstMasks(["can"])(replace(frame, masks=given[2])).masks) == {"mug"}
