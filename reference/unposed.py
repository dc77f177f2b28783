"""Reference frames whose poses nobody knows -> a concept model, in an object frame that the first of them sets."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reference.growing import GrowingModel, Registration, name_of
from reference.keyframes import LEAST_VISIBLE_PX
from reference.onboard import surface_of, warn_of_problems
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import OnboardingError
from tracker.frame import Frame, Mask, PosedFrame
from tracker.geometry import Pose
from tracker.saliency import SaliencyBackend
from tracker.sources import FrameSource, require_recording
from tracker.symmetry import Symmetry

logger = logging.getLogger(__name__)

# On rendered objects frames are found within 3 mm and 5 degrees at this confidence. What is 10 degrees and more off
# comes with less, though with 0.96 to 0.977 where the side that both show is plain.
LEAST_CONFIDENCE = 0.98

GIVEN, CENTRED = "as given in the first reference frame", "centre of what the first reference frame shows, camera axes"


def read_unposed_frames(source: FrameSource, object_id: str, views: int) -> list[tuple[Frame, Mask]]:
    """Of each of so many equal stretches of a recording the frame nearest to its middle that shows the object well,
    with its mask. Poses that the source may have are not looked at. Raises OnboardingError where no frame does,
    SourceError where the source has no frames by position."""
    source = require_recording(source)
    limits = np.linspace(0, len(source), views + 1)
    chosen = []
    for first, end in zip(np.ceil(limits[:-1]), np.ceil(limits[1:]), strict=True):
        middle = (first + end - 1) / 2
        for index in sorted(range(int(first), int(end)), key=lambda index: abs(index - middle)):
            frame = source[index]
            if np.count_nonzero(frame.masks.get(object_id, False)) >= LEAST_VISIBLE_PX:
                chosen.append((frame, frame.masks[object_id]))
                break
    if not chosen:
        named = sorted(source[0].masks) if len(source) else []
        raise OnboardingError(
            f"none of the {len(source)} frames of {source.name} has a mask of object {object_id!r} with "
            f"{LEAST_VISIBLE_PX} pixels or more; the first one has masks of {', '.join(named) or 'nothing'}"
        )
    return chosen


def centred(frame: Frame, mask: Mask, object_id: str, config: TrackerConfig) -> PosedFrame:
    """With the pose that sets an object frame: the centre of the points that it shows, with the camera's axes. Raises
    OnboardingError where it shows too little."""
    here = PosedFrame(frame, object_id, Pose.identity(), mask)
    return replace(here, T_cam_obj=Pose(np.eye(3), surface_of(here, config.view, config.cloud).mean(axis=0)))


def onboard_unposed(
    frames: Sequence[tuple[Frame, Mask]],
    object_id: str,
    backend: SaliencyBackend,
    config: TrackerConfig | None = None,
    vocabulary: Sequence[str] | None = None,
    symmetry: Symmetry | None = None,
    T_cam_obj: Pose | None = None,
    least_confidence: float = LEAST_CONFIDENCE,
) -> ConceptModel:
    """One concept model from frames and masks (H, W) of one object, in no certain order, without known poses.

    The object frame is set by the first frame: T_cam_obj is the object's pose in it, by default a translation to the
    centre of the points that it shows, with the camera's axes. vocabulary, symmetry: as for `onboard`, in that object
    frame. config: of the tracker by which frames are registered; its views and clouds make the model too.
    least_confidence: under which no frame joins. The model's notes hold the `object_frame` and, by name and with the
    reason, the frames that were `left_out`; its references hold the poses that were found.

    Raises OnboardingError where the first frame makes no model, or several were given and none of them joins it.
    """
    if not frames:
        raise OnboardingError("onboarding needs at least one reference frame")
    config = (config or TrackerConfig()).model_copy(update={"prior": False, "masks": "given"})
    (frame, mask), given = frames[0], T_cam_obj is not None
    first = PosedFrame(frame, object_id, T_cam_obj, mask) if T_cam_obj else centred(frame, mask, object_id, config)
    registration = Registration(backend, config, vocabulary, symmetry, least_confidence)
    growing = GrowingModel(registration, [first], registration.model([first]))
    growing.take([PosedFrame(frame, object_id, Pose.identity(), mask) for frame, mask in frames[1:]])
    growing.settle()
    if growing.left_out and len(growing.frames) == 1:
        raise OnboardingError(
            f"no frame could be joined to {name_of(frame)}, object {object_id!r}: {'; '.join(growing.left_out)}. Give "
            "frames that show more of the same side, or the first one alone"
        )
    for left_out in growing.left_out:
        logger.warning("model of object %r: left out %s", object_id, left_out)
    warn_of_problems(growing.model)
    notes = {"object_frame": GIVEN if given else CENTRED, "left_out": list(growing.left_out)}
    return replace(growing.model, notes={**growing.model.notes, **notes})
