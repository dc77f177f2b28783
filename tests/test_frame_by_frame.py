"""The loop over frames: each is tracked, shown and written once, and no end loses what came before it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import pytest

from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.errors import SourceError
from tracker.first_masks import FirstMasks
from tracker.frame import Frame, Provenance
from tracker.frame_by_frame import FrameByFrame
from tracker.geometry import Pose
from tracker.output import PoseOutput
from tracker.pipeline import ObjectTracker
from tracker.pointing import Click
from tracker.remote_control import RemoteControl
from tracker.result import TrackResult, TrackState
from tracker.saliency import SaliencyBackend
from tracker.summary import Summary


class Kept:
    """A viewer and a writer: what each was told."""

    def __init__(self) -> None:
        self.shown: list[int] = []
        self.written: list[int] = []
        self.states: list[TrackState] = []
        self.masked: list[bool] = []

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        assert not truth
        self.shown.append(frame.index)
        self.masked.append(bool(frame.masks))
        self.states.extend(result.state for result in results)

    def close(self) -> None:
        pass

    def add(self, frame_index: int, provenance: Provenance, results: Sequence[TrackResult]) -> None:
        assert [result.object_id for result in results] == ["soup_can"], provenance.source
        self.written.append(frame_index)


def broken_after(frames: Sequence[Frame], error: BaseException) -> Iterator[Frame]:
    yield from frames
    raise error


Loop = Callable[..., FrameByFrame]


@pytest.fixture
def kept() -> Kept:
    return Kept()


@pytest.fixture
def loop(can_model: ConceptModel, attributes: SaliencyBackend, kept: Kept) -> Loop:
    def made(*, carried: bool = False, smooth: str = "off", recorded: bool = False) -> FrameByFrame:
        config = TrackerConfig(masks="carried" if carried else "given")
        return FrameByFrame(
            ObjectTracker(can_model, config, attributes),
            FirstMasks() if carried else None,
            kept,
            [PoseOutput([kept], smooth)],
            RemoteControl(),
            Summary(),
            latency_ms=None if recorded else lambda: 12.0,
            page=None,
        )

    return made


@pytest.mark.parametrize("carried", [False, True])
def test_every_frame_is_tracked_shown_and_written(
    carried: bool, loop: Loop, kept: Kept, can_frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    follow, frames, masked = loop(carried=carried), can_frames[:4], []
    step = ObjectTracker.step

    def stepped(tracker: ObjectTracker, frame: Frame) -> tuple[TrackResult, ...]:
        masked.append(bool(frame.masks))
        return step(tracker, frame)

    monkeypatch.setattr(ObjectTracker, "step", stepped)
    assert follow(frames, kept=True) is None
    assert masked == [True, not carried, not carried, not carried]
    assert all(kept.masked)
    assert kept.shown == kept.written == [frame.index for frame in frames]
    assert set(kept.states) == {TrackState.TRACKING}
    assert follow.summary.latencies_ms == [12.0] * 4
    assert follow.summary.now() == "1 tracking"


def test_of_a_recording_no_latency_is_kept_and_what_is_pointed_out_meanwhile_is_carried_out(
    loop: Loop, can_frames: list[Frame]
) -> None:
    follow = loop(recorded=True, carried=True)
    told = follow.remote.point_out("soup_can", Click(10**6, 0))
    assert follow(can_frames[:2], kept=True) is None
    assert told.done()
    assert follow.summary.latencies_ms == []


@pytest.mark.parametrize("smooth", ["off", "offline"])
def test_a_frame_that_cannot_be_read_does_not_cost_those_before_it(
    smooth: str, loop: Loop, kept: Kept, can_frames: list[Frame]
) -> None:
    broken = SourceError("frame 2 is cut off")
    assert loop(smooth=smooth)(broken_after(can_frames[:2], broken), kept=True) is broken
    assert kept.written == [frame.index for frame in can_frames[:2]]


@pytest.mark.parametrize(("is_kept", "told"), [(True, "what was tracked is kept"), (False, "nothing was to be kept")])
def test_an_interrupt_ends_it_in_its_own_way(
    is_kept: bool, told: str, loop: Loop, kept: Kept, can_frames: list[Frame], capsys: pytest.CaptureFixture[str]
) -> None:
    assert loop(smooth="offline")(broken_after(can_frames[:2], KeyboardInterrupt()), kept=is_kept) is None
    assert kept.written == [frame.index for frame in can_frames[:2]]
    assert told in capsys.readouterr().err


def test_what_is_no_fault_of_a_frame_is_raised(loop: Loop, can_frames: list[Frame]) -> None:
    with pytest.raises(ZeroDivisionError):
        loop()(broken_after(can_frames[:1], ZeroDivisionError()), kept=True)
