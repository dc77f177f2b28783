"""How well many poses of a model explain what is seen, at a glance: each by a few points, all at once.

It is `tracker.verification` for thousands of poses in the time of a few: rougher, as a model does not hide itself here,
and what is explained is told from areas.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from tracker.appearance import ViewAppearance
from tracker.concept import ConceptModel
from tracker.geometry import Intrinsics, Pose
from tracker.lighting import LIGHTNESS_SHARE
from tracker.threads import one_thread
from tracker.umeyama import Motions, rigid
from tracker.verification import FACING_LEAST, REACH, JudgedSurface, VerificationConfig, most_shown, worth
from tracker.view import ObjectView

POINTS = 256  # at most
BLOCK = 500_000  # points that are looked at at a time
PACKED = 0.87  # points as far apart as they can be have about this times their distance squared each, as hexagons do


class Glance:
    """For one model. Motions are from its points less `centre_m` to camera coordinates."""

    def __init__(
        self, model: ConceptModel, surface: JudgedSurface, config: VerificationConfig, device: torch.device
    ) -> None:
        self._config, self._device = config, device
        self._sigma_m = config.sigma_m(model.diameter_m)
        self.centre_m = model.points.mean(axis=0)
        self._points = self._tensor(surface.points[:POINTS] - self.centre_m)
        self._normals, self._lab = self._tensor(surface.normals[:POINTS]), self._tensor(surface.lab[:POINTS])

    def motions(self, poses: Sequence[Pose]) -> Motions:
        """The same as poses T_cam_obj."""
        rotation = self._tensor(np.array([pose.rotation for pose in poses]).reshape(-1, 3, 3))
        translation = self._tensor(np.array([(pose @ self.centre_m[None])[0] for pose in poses]).reshape(-1, 3))
        return rigid(rotation, translation)

    @one_thread()
    def __call__(
        self, motions: Motions, view: ObjectView, appearance: ViewAppearance, *, masked: bool, points: int = POINTS
    ) -> torch.Tensor:
        """(B,) in [0, 1], about what `Evidence.score` is, `of_itself` where the view is not known to be of the object.
        points: so many are looked at."""
        few = min(points, len(self._points))
        apart = torch.cdist(self._points[:few], self._points[:few]).fill_diagonal_(torch.inf)
        area_m2 = PACKED * float(apart.amin(dim=1).mean()) ** 2
        scene = _Scene(view, appearance, self._device)
        parts = motions.rotation.split(max(1, BLOCK // few)), motions.translation.split(max(1, BLOCK // few))
        found = [self._part(R, t, few, area_m2, scene) for R, t in zip(*parts, strict=True)]
        agreed, area_px, shown = (torch.cat(column).cpu().numpy() for column in zip(*found, strict=True))
        if masked:
            scores = agreed * worth(np.minimum(area_px / max(np.count_nonzero(view.has_depth), 1), 1))
        else:
            scores = agreed * np.sqrt(np.minimum(shown / most_shown(self._normals[:few].cpu().numpy()), 1))
        return torch.from_numpy(scores).to(self._device)

    def _part(
        self, rotation: torch.Tensor, translation: torch.Tensor, few: int, area_m2: float, scene: _Scene
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """(B,) each: the share of what should be seen that is, in place and in colour; how many pixels of the view that
        covers; and the points that are in place, each by how much it faces the camera."""
        at = rotation @ self._points[:few].T + translation.unsqueeze(2)  # (B, 3, N)
        facing = -((rotation @ self._normals[:few].T) * at).sum(dim=1) / at.norm(dim=1)
        depth_m = at[:, 2].clamp_min(1e-3)
        pixel, on_object = scene.on_object(at, depth_m)
        measured_m = torch.where(on_object, scene.depth_m[pixel], scene.frame_depth_m(at, depth_m))
        behind_m = torch.where(measured_m > 0, measured_m - depth_m, 0)
        reach_m = REACH * self._sigma_m
        due = (facing > FACING_LEAST) & (at[:, 2] > 0) & (on_object | (behind_m > -reach_m))  # else something hides it
        in_place = due & on_object & (measured_m > 0) & (behind_m.abs() < reach_m)
        weights = facing * in_place
        shown = weights.sum(dim=1)
        lab = scene.lab[pixel] - self._lab[:few]
        lab -= ((lab * weights.unsqueeze(2)).sum(dim=1) / shown.clamp_min(1e-6).unsqueeze(1)).unsqueeze(1)  # the light
        lab[:, :, 0] *= LIGHTNESS_SHARE
        unlike = (behind_m / self._sigma_m).square()
        unlike += self._config.colour_share * lab.square().sum(dim=2) / self._config.lab_sigma**2
        agreed = (weights * (-unlike / 2).exp()).sum(dim=1) / (facing * due).sum(dim=1).clamp_min(1e-6)
        return agreed, (weights * area_m2 * (scene.camera.fx / depth_m) ** 2).sum(dim=1), shown

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(array, np.float32)).to(self._device)


class _Scene:
    """What the camera saw: depth_m, inside: (h * w,), lab: (h * w, 3), of the view."""

    def __init__(self, view: ObjectView, appearance: ViewAppearance, device: torch.device) -> None:
        self.camera, self._frame_camera = view.camera, view.frame.intrinsics
        self.depth_m = torch.from_numpy(view.depth_m).to(device).flatten()
        self.lab = torch.from_numpy(appearance.fine.lab).to(device).reshape(-1, 3)
        self._inside = torch.from_numpy(view.inside).to(device).flatten()
        self._frame_depth_m = torch.from_numpy(view.frame.depth_m).to(device).flatten()

    def on_object(self, at: torch.Tensor, depth_m: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Pixels (B, N) of the view that points (B, 3, N) project to, and whether they are the object's."""
        pixel, within = _pixels(self.camera, at, depth_m)
        return pixel, within & self._inside[pixel]

    def frame_depth_m(self, at: torch.Tensor, depth_m: torch.Tensor) -> torch.Tensor:
        """(B, N) depth of the frame where points (B, 3, N) project to, 0 outside."""
        pixel, within = _pixels(self._frame_camera, at, depth_m)
        return self._frame_depth_m[pixel] * within


def _pixels(camera: Intrinsics, at: torch.Tensor, depth_m: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Row-major indices (B, N) of the nearest pixels, clipped to the picture, and whether they are in it."""
    columns = (at[:, 0] / depth_m * camera.fx + camera.cx).round().long()
    rows = (at[:, 1] / depth_m * camera.fy + camera.cy).round().long()
    within = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    return rows.clamp(0, camera.height - 1) * camera.width + columns.clamp(0, camera.width - 1), within
