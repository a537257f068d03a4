"""Give identities to a detector's boxes: move the last boxes by the camera's motion, then match.

    python detector_motion.py clip.mp4 detections.csv

The CSV file has the columns frame, x, y, w, h: a detector's boxes, pixels, frames from 0. Prints
frame, identity and box. Without the motion, a shake larger than the boxes ends identities.
"""

import csv
import sys
from pathlib import Path

import ssiam
from ssiam.geometry import XYWH, iou, map_box
from ssiam.video import open_source


def main(source: str, detections: str) -> None:
    """Match the boxes of each frame to those of the last one by their overlap."""
    boxes: dict[int, list[XYWH]] = {}
    for row in csv.DictReader(Path(detections).read_text(encoding="utf-8").splitlines()):
        x, y, w, h = (float(row[name]) for name in "xywh")
        boxes.setdefault(int(row["frame"]), []).append((x, y, w, h))
    camera = ssiam.CameraMotion()  # one for the whole video
    last, count = dict[int, XYWH](), 0
    for frame in open_source(source):
        motion = camera.update(frame.image, exclude=list(last.values()))
        moved = {identity: map_box(motion.cur_from_prev, box) for identity, box in last.items()}
        last = {}
        for box in boxes.get(frame.index, []):
            best = max(moved, key=lambda identity: float(iou(moved[identity], box)), default=None)
            if best is None or iou(moved[best], box) < 0.3:
                best = count = count + 1
            moved.pop(best, None)
            last[best] = box
            print(frame.index, best, *box)


if __name__ == "__main__":
    main(*sys.argv[1:])
