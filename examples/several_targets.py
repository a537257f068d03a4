"""Track several targets with one estimate of the camera's motion; write video and results.

python several_targets.py clip.mp4 tracked.mp4 tracked.csv 120,80,40,60 300,90,50,50
"""

import sys

import ssiam
from ssiam.video import VideoSink, draw_tracks, open_results, open_source


def main(source: str, video: str, results: str, *boxes: str) -> None:
    """Track the objects in `boxes` (x,y,width,height of the first frame)."""
    group = ssiam.TrackerGroup(ssiam.load_tracker())
    with (
        open_source(source) as frames,
        VideoSink(video, frames.fps or 25) as sink,
        open_results(results, targets=len(boxes)) as rows,
    ):
        first = next(frames).image
        group.init(first, [[float(number) for number in box.split(",")] for box in boxes])
        sink.write(first)
        for frame in frames:
            tracks = group.update(frame.image)
            sink.write(draw_tracks(frame.image, tracks))
            rows.write(frame.index, frame.time, tracks)


if __name__ == "__main__":
    main(*sys.argv[1:])
