"""Report when a target is lost and when it is re-detected, and save an image of each return.

    python lost_and_found.py clip.mp4 120,80,40,60 returns

A lost target's box is a guess: do not use it.
"""

import sys
from pathlib import Path

import cv2

import ssiam
from ssiam.video import draw_tracks, open_source


def main(source: str, box: str, folder: str) -> None:
    """Track the object in `box` (x,y,width,height of the first frame)."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    tracker = ssiam.load_tracker()
    with open_source(source) as frames:
        tracker.init(next(frames).image, [float(number) for number in box.split(",")])
        lost_since = None
        for frame in frames:
            track = tracker.update(frame.image)
            if track.lost and lost_since is None:
                lost_since = frame.index
                print(f"frame {frame.index}: lost")
            elif not track.lost and lost_since is not None:
                print(f"frame {frame.index}: found after {frame.index - lost_since} frames")
                image = draw_tracks(frame.image, [track])
                cv2.imwrite(str(Path(folder) / f"{frame.index:06d}.jpg"), image)
                lost_since = None


if __name__ == "__main__":
    main(*sys.argv[1:])
