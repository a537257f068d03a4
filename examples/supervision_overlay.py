"""Draw tracks with supervision: boxes, and the path of each target.

    python supervision_overlay.py clip.mp4 tracked.mp4 120,80,40,60 300,90,50,50

It needs supervision>=0.30; older versions bring opencv-python, which overwrites ssiam's OpenCV.
"""

import sys

import supervision as sv

import ssiam
from ssiam.exchange import to_detections
from ssiam.video import VideoSink, open_source


def main(source: str, out: str, *boxes: str) -> None:
    """Track the objects in `boxes` (x,y,width,height of the first frame) and draw them."""
    by_target = sv.ColorLookup.TRACK
    boxes_and_paths = (
        sv.BoxAnnotator(color_lookup=by_target),
        sv.TraceAnnotator(color_lookup=by_target),
    )
    group = ssiam.TrackerGroup(ssiam.load_tracker())
    with open_source(source) as frames, VideoSink(out, frames.fps or 25) as sink:
        first = next(frames).image
        group.init(first, [[float(number) for number in box.split(",")] for box in boxes])
        sink.write(first)
        for frame in frames:
            detections = to_detections(group.update(frame.image))
            image = frame.image.copy()
            for annotator in boxes_and_paths:
                image = annotator.annotate(image, detections)
            sink.write(image)


if __name__ == "__main__":
    main(*sys.argv[1:])
