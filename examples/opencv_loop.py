"""The loop of an OpenCV program: read with cv2.VideoCapture, track, draw, write.

    python opencv_loop.py clip.mp4 120,80,40,60 tracked.avi

ssiam takes OpenCV's frames as they are: (height, width, 3) uint8, BGR.
"""

import sys
from typing import Any

import cv2

import ssiam


def main(source: str, box: str, out: str) -> None:
    """Track the object in `box` (x,y,width,height of the first frame) to the end of the video."""
    capture: Any = cv2.VideoCapture(source)
    ok, frame = capture.read()
    if not ok:
        sys.exit(f"{source}: OpenCV cannot read it; check the path")
    size_wh = frame.shape[1], frame.shape[0]
    fourcc = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter(out, fourcc, capture.get(cv2.CAP_PROP_FPS), size_wh)
    tracker = ssiam.load_tracker()
    tracker.init(frame, [float(number) for number in box.split(",")])
    while ok:
        writer.write(frame)
        ok, frame = capture.read()
        if ok:
            track = tracker.update(frame)
            if not track.lost:
                x, y, w, h = (round(number) for number in track.box)
                cv2.rectangle(frame, (x, y), (x + w, y + h), (60, 230, 90), 2)
    capture.release()
    writer.release()


if __name__ == "__main__":
    main(*sys.argv[1:])
