"""Frames with random faults through the tracker: whatever comes, what it says is lawful."""

from __future__ import annotations

import zlib
from dataclasses import replace
from functools import cached_property

import numpy as np

from reference.onboard import onboard
from tests.fuzz.attempt import Finding, where_from
from tests.fuzz.frames import FAULTS, parts_of
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import FrameError, LateFrameError
from tracker.frame import Frame, PosedFrame
from tracker.pipeline import ObjectTracker
from tracker.result import TrackResult, TrackState
from tracker.saliency import open_backend
from tracker.sources.synthetic import open_scene

NAME = "tracker"
CAN = "soup_can"
RUN = 25  # frames of a tracker
PERIOD_NS = 33_333_333
ROUNDING = 1e-5  # of a rotation that was found in single precision
MAY_FOLLOW = {
    TrackState.INITIALISING: {TrackState.INITIALISING, TrackState.TRACKING},
    TrackState.TRACKING: {TrackState.TRACKING, TrackState.LOST},
    TrackState.LOST: {TrackState.LOST, TrackState.TRACKING},
}


class Scenes:
    """seen: frames that show the can. unseen: frames of other rooms and objects, none of which shows it."""

    def __init__(self, seen: int = 24, unseen: int = 3) -> None:
        turn = open_scene(f"turn?size=160x120&object={CAN}")
        self.seen = [turn[index] for index in range(20, 20 + seen)]
        leave, box = open_scene("leave?size=160x120"), open_scene("turn?size=160x120&object=cereal_box")
        others = [leave[40 + 5 * k] for k in range(unseen)] + [box[10 * k] for k in range(unseen)]
        self.unseen = [replace(frame, masks={CAN: next(iter(frame.masks.values()))}) for frame in others]

    @cached_property
    def model(self) -> ConceptModel:
        turn = open_scene(f"turn?size=320x240&object={CAN}")
        poses = [sighting.T_cam_obj for sighting in turn.sightings(CAN)]
        frames = [PosedFrame(frame := turn[k], CAN, poses[k], frame.masks[CAN]) for k in (53, 5, 86)]
        return onboard(frames, open_backend("attributes"))


class FaultyFrames:
    """Frame by frame; a new tracker every `RUN` frames, so that each run follows from seed and number alone."""

    def __init__(self, seed: int, scenes: Scenes) -> None:
        self._seed, self._scenes, self._next = seed, scenes, -1
        self.refused = 0
        self.tracked = 0

    def __call__(self, number: int) -> Finding | None:
        """None where the frame was refused at the door, or what the tracker says of it is lawful."""
        if number != self._next or number % RUN == 0:
            self._begin(number // RUN)
            for earlier in range(number // RUN * RUN, number):
                self._step(earlier)
        self._next = number + 1
        return self._step(number)

    def _begin(self, run: int) -> None:
        self._rng = rng = np.random.default_rng((self._seed, zlib.crc32(NAME.encode()), run))
        prior = bool(rng.random() < 0.8)
        masks = "carried" if prior and rng.random() < 0.6 else "given"
        config = TrackerConfig(prior=prior, masks=masks)
        self._tracker = ObjectTracker(self._scenes.model, config)
        self._state, self._last_ns = TrackState.INITIALISING, -1
        self._time_ns = 10**9

    def _step(self, number: int) -> Finding | None:
        rng = self._rng
        shown = rng.random() < 0.7
        frames = self._scenes.seen if shown else self._scenes.unseen
        self._time_ns = max(self._time_ns, self._last_ns) + PERIOD_NS
        chosen = frames[number % RUN % len(frames)] if shown else frames[rng.integers(len(frames))]
        parts = parts_of(replace(chosen, stamp_ns=self._time_ns, index=number))
        faults = [FAULTS[k] for k in sorted(set(rng.integers(len(FAULTS), size=rng.integers(4)).tolist()))]
        what = f"{'can' if shown else 'no can'}, {', '.join(fault.__name__ for fault in faults) or 'no fault'}"
        for fault in faults:
            fault(parts, rng)
        try:
            frame = Frame(**parts)
        except FrameError:
            self.refused += 1
            return None
        except Exception as error:  # whatever it is, it is what is looked for
            return Finding(NAME, number, f"the door: {error!r:.300} ({what})", where_from(error))
        late = frame.stamp_ns <= self._last_ns
        try:
            (result,) = self._tracker.step(frame)
        except LateFrameError as error:
            self.refused += 1
            return None if late else Finding(NAME, number, f"{error!r} ({what})", where_from(error))
        except Exception as error:  # likewise
            return Finding(NAME, number, f"{error!r:.300} ({what})", where_from(error))
        wrong = complaint(result, frame, self._state, shown) or ("a late frame was taken" if late else None)
        self._state, self._last_ns = result.state, frame.stamp_ns
        self.tracked += result.pose is not None
        return Finding(NAME, number, f"{wrong} ({what})") if wrong else None


def complaint(result: TrackResult, frame: Frame, before: TrackState, shown: bool) -> str | None:
    """What is not lawful in a result, None if nothing is."""
    posed = result.state is TrackState.TRACKING
    if (result.stamp_ns, result.object_id) != (frame.stamp_ns, CAN):
        return "it is of another frame or object"
    if result.state not in MAY_FOLLOW[before]:
        return f"{result.state.value} follows {before.value}"
    if posed != (result.pose is not None) or posed != (result.raw_pose is not None):
        return f"{result.state.value} with the poses {result.pose} and {result.raw_pose}"
    if not 0 <= result.confidence <= 1 or (not posed and result.confidence):
        return f"{result.state.value} with confidence {result.confidence}"
    if not result.reason:
        return f"{result.state.value} without a reason"
    if posed and not shown:
        return f"a pose of what is not there, confidence {result.confidence:.2f}, {result.reason}"
    return _numbers(result) if posed else None


def _numbers(result: TrackResult) -> str | None:
    """Of a result with poses."""
    assert result.pose is not None
    assert result.raw_pose is not None
    for pose in (result.pose, result.raw_pose):
        if not np.isfinite(pose.matrix).all() or np.abs(pose.rotation @ pose.rotation.T - np.eye(3)).max() > ROUNDING:
            off = np.abs(pose.rotation @ pose.rotation.T - np.eye(3)).max()
            return f"no rigid motion, |R R^T - 1| = {off:.2g}: {pose.matrix.tolist()}"
    covariance = result.covariance
    if covariance is None or not np.isfinite(covariance).all() or np.linalg.eigvalsh(covariance).min() < -1e-9:
        return f"no covariance: {covariance}"
    return None
