"""Four frames of the demo's overlay video as one picture: `python docs/picture.py VIDEO OUT.jpg`."""

from __future__ import annotations

import sys

import cv2
import numpy as np


def main(video: str, out: str) -> None:
    reader = cv2.VideoCapture(video)
    count = int(reader.get(cv2.CAP_PROP_FRAME_COUNT))
    pictures = []
    for index in np.linspace(0, count - 1, 4).round().astype(int):
        reader.set(cv2.CAP_PROP_POS_FRAMES, int(index))
        read, picture = reader.read()
        if not read:
            sys.exit(f"{video}: frame {index} cannot be read")
        pictures.append(picture)
    tiled = np.vstack((np.hstack(pictures[:2]), np.hstack(pictures[2:])))
    cv2.imwrite(out, tiled, [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main(*sys.argv[1:])
