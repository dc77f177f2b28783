"""A rendered object followed by the tracker, and what is to be said of its poses over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from reference.onboard import onboard, read_reference_frames
from tracker.declared_symmetry import parse_symmetry
from tracker.frame import Frame
from tracker.geometry import Floats, Pose
from tracker.pipeline import ObjectTracker
from tracker.pose_filter import deviation
from tracker.saliency import open_backend
from tracker.smoothing import smooth_results
from tracker.sources.synthetic import open_scene
from tracker.symmetry import Symmetry

VIEWS = 3
SETTLED_FRAMES = 10  # in which the filter learns the motion
FAST_MPS = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Of the N frames with a pose: the true pose, that of the frame alone, after the filter, and smoothed over all of
    them; covariances (N, 6, 6) of the filtered ones; times (N,) in seconds. symmetry: of the object's model. lost: how
    many frames have no pose."""

    truth: list[Pose]
    raw: list[Pose]
    filtered: list[Pose]
    smoothed: list[Pose]
    covariances: Floats
    times_s: Floats
    symmetry: Symmetry
    lost: int

    def errors(self, poses: Sequence[Pose]) -> Floats:
        """(N, 6) turn and shift from the true poses, of all that look alike the nearest; radians and metres."""
        return np.array([deviation(self.symmetry.nearest(p, t), t) for p, t in zip(poses, self.truth, strict=True)])


def follow(scene_name: str, stride: int = 1, symmetry: str = "none") -> Followed:
    """Every `stride`-th frame of a synthetic scene, as if taken at the rate of all: that many times as fast.

    symmetry: what is declared of the object, in the grammar of `python -m reference`.
    """
    scene, backend = open_scene(scene_name), open_backend("attributes")
    (object_id, *_) = scene.object_ids
    model = onboard(read_reference_frames(scene, object_id, VIEWS), backend)
    model = replace(model, symmetry=parse_symmetry(symmetry))
    tracker, sightings = ObjectTracker(model, backend=backend), scene.sightings(object_id)

    def taken(index: int) -> Frame:
        frame = scene[index]
        return replace(frame, stamp_ns=round(frame.stamp_ns / stride))

    indices = range(0, len(scene), stride)
    results = [tracker.step(taken(index))[0] for index in indices]
    seen = [k for k, result in enumerate(results) if result.pose is not None]
    smoothed = smooth_results(results)
    return Followed(
        truth=[sightings[indices[k]].T_cam_obj for k in seen],
        raw=[pose for k in seen if (pose := results[k].raw_pose)],
        filtered=[pose for k in seen if (pose := results[k].pose)],
        smoothed=[pose for k in seen if (pose := smoothed[k].pose)],
        covariances=np.array([results[k].covariance for k in seen]),
        times_s=np.array([results[k].stamp_ns / 1e9 for k in seen]),
        symmetry=model.symmetry,
        lost=len(results) - len(seen),
    )


def steadiness(followed: Followed) -> dict[str, float]:
    """Jitter: median change of the error from frame to frame. Bias: mean of the filtered pose less the raw one. Error:
    root mean square. consistency: mean squared error of the filtered pose in the standard deviations that it states
    (NEES, Bar-Shalom et al., 2001, 5.4), of which six are expected; less is too careful, more is too sure."""
    found: dict[str, float] = {}
    for name in ("raw", "filtered", "smoothed"):
        errors = followed.errors(getattr(followed, name))
        degrees, metres = (np.linalg.norm(np.diff(errors, axis=0)[:, part], axis=1) for part in (slice(3), slice(3, 6)))
        found[f"jitter_mm_{name}"] = float(np.median(metres)) * 1e3
        found[f"jitter_degrees_{name}"] = float(np.degrees(np.median(degrees)))
        found[f"error_mm_{name}"] = float(np.sqrt((errors[:, 3:] ** 2).sum(axis=1).mean())) * 1e3
        found[f"error_degrees_{name}"] = float(np.degrees(np.sqrt((errors[:, :3] ** 2).sum(axis=1).mean())))
    off = np.array([deviation(f, r) for f, r in zip(followed.filtered, followed.raw, strict=True)]).mean(axis=0)
    found["bias_mm"] = float(np.linalg.norm(off[3:])) * 1e3
    errors = followed.errors(followed.filtered)
    squared = np.einsum("ni,ni->n", errors, np.linalg.solve(followed.covariances, errors[:, :, None])[:, :, 0])
    return {**found, "consistency": float(squared.mean())}


def lag(followed: Followed) -> dict[str, float | None]:
    """How far the filtered pose is behind the true one, along its way, where that is fast; the mean, and the most. None
    where nothing is fast."""
    way = np.gradient(np.array([pose.translation_m for pose in followed.truth]), followed.times_s, axis=0)
    speed_mps = np.linalg.norm(way, axis=1)
    fast = (speed_mps > FAST_MPS) & (np.arange(len(way)) >= SETTLED_FRAMES)
    behind_m = -(followed.errors(followed.filtered)[fast, 3:] * way[fast]).sum(axis=1) / speed_mps[fast]
    if not fast.any():
        return dict.fromkeys(("lag_mm", "lag_mm_greatest", "speed_mps_of_lag"))
    return {
        "lag_mm": float(behind_m.mean()) * 1e3,
        "lag_mm_greatest": float(np.abs(behind_m).max()) * 1e3,
        "speed_mps_of_lag": float(speed_mps[fast].mean()),
    }


def jumps(followed: Followed) -> dict[str, float]:
    """Greatest turn between frames beyond the object's own, in degrees: of the poses as they are reported, and of those
    that look alike the least."""
    reported, alike = [0.0], [0.0]
    truth, filtered, symmetry = followed.truth, followed.filtered, followed.symmetry
    for k in range(1, len(truth)):
        own = truth[k] @ truth[k - 1].inverse()
        reported.append(filtered[k].angle_to_rad(filtered[k - 1]) - truth[k].angle_to_rad(truth[k - 1]))
        expected = own @ filtered[k - 1]
        alike.append(symmetry.nearest(filtered[k], expected).angle_to_rad(expected))
    return {
        "jump_degrees_reported": float(np.degrees(max(reported))),
        "jump_degrees_alike": float(np.degrees(max(alike))),
    }
