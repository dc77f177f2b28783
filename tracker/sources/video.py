"""A colour video and a folder with a depth picture for each of its frames, in the order of their names.

    video:VIDEO+FOLDER?K=fx,fy,cx,cy&distortion=k1,k2,p1,p2,k3&depth_unit=0.001

Depth is of 16 bits and registered to the colour. The camera is that of ?K (numbers, or a file with them), else of
cam_K.txt or camera.txt beside the video or in the folder.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import cv2
import numpy.typing as npt

from tracker.errors import SourceError
from tracker.frame import Frame, Provenance
from tracker.sources.camera_files import Calibration, find_calibration, read_distortion, read_K
from tracker.sources.image_files import in_order, read_image
from tracker.sources.query import number, read_query
from tracker.sources.raw_depth import metres_per_unit
from tracker.sources.raw_frame import raw_to_frame

CAMERA_FILES = ("cam_K.txt", "camera.txt")
OPTIONS = {
    "K": read_K,
    "distortion": read_distortion,
    "depth_unit": number(1e-6, 1.0, "metres per unit of the depth"),
}


class VideoWithDepth:
    """Frames in the order of the video, with its own times. argument: VIDEO+FOLDER with options.

    Raises SourceError where a part is missing, nobody tells the camera, or there are not as many pictures of the one
    as of the other.
    """

    def __init__(self, argument: str) -> None:
        self.name = f"video:{argument}"
        paths, _, query = argument.partition("?")
        given = read_query(self.name, query, OPTIONS)
        video, separator, folder = paths.rpartition("+")
        if not separator or not video or not folder:
            raise SourceError(f"{self.name}: expected video:VIDEO+FOLDER, a video and a folder of depth pictures")
        self._video, self._folder = Path(video), Path(folder)
        self._unit_m = metres_per_unit("millimetres", self.name, override=given.get("depth_unit"))
        self._depths = in_order(self._folder.glob("*.png"))
        if not self._depths:
            raise SourceError(f"{self._folder} has no png pictures; expected one for every frame of {video}")
        self._calibration = self._camera(given.get("K"), given.get("distortion", ()))
        self._require_as_many()

    def __len__(self) -> int:
        return len(self._depths)

    def __iter__(self) -> Iterator[Frame]:
        lens, last_ns = None, -1
        with closing(_Video(self._video)) as video:
            for index, depth in enumerate(self._depths):
                bgr = video.read()
                if bgr is None:
                    raise SourceError(f"{self._video}: the video ends after {index} of {len(self._depths)} frames")
                if lens is None:
                    lens = self._calibration.lens(bgr.shape[1], bgr.shape[0])
                stamp_ns = video.stamp_ns
                if stamp_ns <= last_ns:
                    raise SourceError(f"{self._video}: frame {index} is at {stamp_ns} ns, not after {last_ns} ns")
                last_ns = stamp_ns
                provenance = Provenance(f"{self.name} {depth.stem}", "recording", 0, self._unit_m, depth.stem)
                stored = read_image(depth, cv2.IMREAD_UNCHANGED)
                yield raw_to_frame(bgr, "bgr", stored, lens, stamp_ns, index, provenance)

    def _camera(self, K: tuple[float, ...] | Path | None, distortion: tuple[float, ...]) -> Calibration:
        folders = (self._video.parent, self._folder)
        found = find_calibration(K, distortion, [folder / name for folder in folders for name in CAMERA_FILES])
        if found is None:
            raise SourceError(
                f"{self.name}: a video does not tell the camera; say ?K=fx,fy,cx,cy, or ?K=FILE, or put a cam_K.txt "
                f"into {self._video.parent}"
            )
        return found

    def _require_as_many(self) -> None:
        with closing(_Video(self._video)) as video:
            frames = video.count
            if frames != len(self._depths):  # the head of a file may err
                frames = video.counted()
        if frames != len(self._depths):
            raise SourceError(
                f"{self._video} has {frames} frames and {self._folder} {len(self._depths)} depth pictures "
                f"({self._depths[0].name} .. {self._depths[-1].name}); expected one for each"
            )


class _Video:
    """One that is open."""

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise SourceError(f"{path}: no such video")
        self._capture = cv2.VideoCapture(str(path))
        if not self._capture.isOpened():
            raise SourceError(f"{path}: not a video that can be read")
        # As the sensor has it: a picture that its orientation tag turns would no longer fit its depth.
        self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)

    @property
    def count(self) -> int:
        """Of frames, as the head of the file says."""
        return int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))

    @property
    def stamp_ns(self) -> int:
        """Of the frame that was read last."""
        return round(self._capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6)

    def counted(self) -> int:
        """The frames from here to the end."""
        count = 0
        while self._capture.grab():
            count += 1
        return count

    def read(self) -> npt.NDArray | None:
        done, bgr = self._capture.read()
        return bgr if done else None

    def close(self) -> None:
        self._capture.release()
