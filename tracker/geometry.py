"""Rigid motions and the pinhole camera. Metres, radians, `points_cam = T_cam_obj @ points_obj`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import overload

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform, Rotation

from tracker.errors import FrameError

Floats = npt.NDArray[np.floating]

MOST_PIXELS = 1 << 25  # 8K: what a file can make a reader allocate is bounded by it
ROTATION_TOLERANCE = 1e-3  # what rounding in text files costs; anything worse is another convention


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """An element of SE(3). Name it `T_to_from`: it maps coordinates of `from` to coordinates of `to`.

    rotation: (3, 3) orthonormal, determinant +1. translation_m: (3,) metres.
    """

    rotation: Floats
    translation_m: Floats

    @classmethod
    def identity(cls) -> Pose:
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_matrix(cls, matrix: npt.ArrayLike) -> Pose:
        """From a (4, 4) or (3, 4) matrix. Raises FrameError unless it is a rigid motion up to rounding."""
        m = np.asarray(matrix, np.float64)
        if m.shape not in ((4, 4), (3, 4)) or not np.isfinite(m).all():
            raise FrameError(f"a pose is a finite 4x4 or 3x4 matrix, got shape {m.shape}: {m.tolist()}")
        if np.abs(m[3:] - [0, 0, 0, 1]).max(initial=0) > ROTATION_TOLERANCE:
            raise FrameError(f"the last row of a pose is 0 0 0 1, got {m[3].tolist()}: is the matrix transposed?")
        rotation = m[:3, :3]
        off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if off > ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
            raise FrameError(
                f"not a rotation: |R R^T - 1| = {off:.2g}, det R = {np.linalg.det(rotation):+.3f} (expected 0 and +1)"
            )
        u, _, vt = np.linalg.svd(rotation)
        return cls(u @ vt, m[:3, 3].copy())

    @classmethod
    def from_quaternion(cls, wxyz: npt.ArrayLike, translation_m: npt.ArrayLike) -> Pose:
        """From a quaternion, scalar first, and a translation in metres. Raises FrameError on a zero quaternion and on
        numbers that are not finite."""
        q, t_m = np.asarray(wxyz, np.float64), np.array(translation_m, np.float64)
        if q.shape != (4,) or not np.isfinite(q).all() or np.linalg.norm(q) <= 1e-9:
            raise FrameError(f"a rotation quaternion has four numbers (w x y z), not all zero; got {q.tolist()}")
        if t_m.shape != (3,) or not np.isfinite(t_m).all():
            raise FrameError(f"a translation has three finite numbers, got {t_m.tolist()}")
        return cls(Rotation.from_quat(q, scalar_first=True).as_matrix(), t_m)

    @classmethod
    def exp(cls, twist: npt.ArrayLike) -> Pose:
        """Exponential map of a twist (6,): rotation vector in radians first, then the translational part in metres."""
        return cls.from_rigid(RigidTransform.from_exp_coords(np.asarray(twist, np.float64)))

    @classmethod
    def from_rigid(cls, rigid: RigidTransform) -> Pose:
        matrix = rigid.as_matrix()
        return cls(matrix[:3, :3], matrix[:3, 3])

    def log(self) -> Floats:
        """The twist (6,) whose `exp` is this pose, rotation part first, its angle in [0, pi]."""
        return RigidTransform.from_matrix(self.matrix).as_exp_coords()

    @property
    def matrix(self) -> Floats:
        """(4, 4) homogeneous matrix."""
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = self.rotation, self.translation_m
        return m

    @property
    def quaternion_wxyz(self) -> Floats:
        """(4,) unit quaternion, scalar first and not negative."""
        return Rotation.from_matrix(self.rotation).as_quat(canonical=True, scalar_first=True)

    def inverse(self) -> Pose:
        return Pose(self.rotation.T, -self.rotation.T @ self.translation_m)

    @overload
    def __matmul__(self, other: Pose) -> Pose: ...
    @overload
    def __matmul__(self, other: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]: ...
    def __matmul__(self, other: Pose | Floats) -> Pose | Floats:
        """Compose with a pose, or map points (N, 3)."""
        if isinstance(other, Pose):
            return Pose(self.rotation @ other.rotation, self.rotation @ other.translation_m + self.translation_m)
        return other @ self.rotation.T + self.translation_m

    def nudged(self, motion: Floats) -> Pose:
        """Turned by a rotation vector (first three, radians) and shifted (last three, metres), both in the axes of
        `to`, the turn about the origin of `from`: the small motions that refinement and filter estimate."""
        turn = Rotation.from_rotvec(motion[:3]).as_matrix()
        return Pose(turn @ self.rotation, self.translation_m + motion[3:])

    def angle_to_rad(self, other: Pose) -> float:
        """Angle of the rotation between two poses, in [0, pi]."""
        return float(np.linalg.norm(rotation_vector(self.rotation.T @ other.rotation)))

    def distance_to_m(self, other: Pose) -> float:
        return float(np.linalg.norm(self.translation_m - other.translation_m))


def rotation_vector(rotation: Floats) -> Floats:
    """(3,) radians, of the (3, 3) rotation of a pose or of a product of such."""
    return Rotation.from_matrix(rotation, assume_valid=True).as_rotvec()


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Pinhole camera without distortion, in pixels; pixel centres have integer coordinates (OpenCV)."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    @classmethod
    def from_matrix(cls, K: npt.ArrayLike, width: int, height: int) -> Intrinsics:
        """From the (3, 3) camera matrix of images of this size. Raises FrameError if it cannot belong to them."""
        k = np.asarray(K, np.float64)
        if k.shape != (3, 3) or not np.isfinite(k).all():
            raise FrameError(f"a camera matrix is 3x3 and finite, got {k.tolist()}")
        camera = cls(float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2]), int(width), int(height))
        camera.check()
        return camera

    def check(self) -> None:
        """Raises FrameError where focal length or principal point do not suit the image size."""
        if min(self.width, self.height) < 1:
            raise FrameError(f"an image has at least one pixel, got {self.width} x {self.height}")
        if self.width * self.height > MOST_PIXELS:
            raise FrameError(f"an image has at most {MOST_PIXELS} pixels, got {self.width} x {self.height}")
        values = (self.fx, self.fy, self.cx, self.cy)
        size = max(self.width, self.height)
        if not np.isfinite(values).all() or not all(0.1 * size < f < 20 * size for f in (self.fx, self.fy)):
            raise FrameError(f"focal length fx={self.fx} fy={self.fy} px does not suit {self.width} x {self.height} px")
        # A matrix of half or double resolution has its centre a quarter or a half of the image off.
        if abs(self.cx / self.width - 0.5) > 0.22 or abs(self.cy / self.height - 0.5) > 0.22:
            raise FrameError(
                f"principal point ({self.cx:.1f}, {self.cy:.1f}) is far from the centre of a "
                f"{self.width} x {self.height} image: does K belong to another resolution?"
            )

    @property
    def matrix(self) -> Floats:
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def project(self, points_cam: Floats) -> Floats:
        """(N, 3) metres in front of the camera -> (N, 2) pixels (x, y)."""
        z = points_cam[:, 2]
        return np.stack((points_cam[:, 0] / z * self.fx + self.cx, points_cam[:, 1] / z * self.fy + self.cy), axis=1)

    def unproject(self, columns: npt.NDArray, rows: npt.NDArray, depth_m: Floats) -> Floats:
        """Pixels and their z in metres, each (N,) -> points (N, 3) in camera coordinates."""
        x_m, y_m = (columns - self.cx) / self.fx * depth_m, (rows - self.cy) / self.fy * depth_m
        return np.stack((x_m, y_m, depth_m), axis=1)
