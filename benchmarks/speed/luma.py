"""Time of the camera motion on BGR frames and on the decoder's luma planes.

    python benchmarks/speed/luma.py [--sizes 640x360,1280x720,3840x2160] [--rounds 5] [--frames 40]

The demo clip, resized and encoded again (H.264, yuv420p), is decoded by PyAV on one thread. Every
frame is converted to BGR and given to one `CameraMotion`, and its luma plane, without a copy, to
another one, in turn, so that both see the same load of the machine. Milliseconds, medians of all
frames and rounds. "saved" is what a program saves that needs the motion alone: the conversion, and
the difference of the two motions. "corners" is the distance between the corners of the frame under
the two motions, median and largest, in pixels.
"""

from __future__ import annotations

import argparse
import io
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import EXAMPLES
from benchmarks.common.tables import head, line
from ssiam import CameraMotion
from ssiam.geometry import Image, corners_from_xywh, map_points
from ssiam.video import open_source

CLIP = EXAMPLES / "shaky-walker.mp4"


def encoded(size_wh: tuple[int, int], count: int) -> io.BytesIO:
    """The first frames of the clip at another size, as MP4."""
    file = io.BytesIO()
    with open_source(CLIP) as source, av.open(file, "w", format="mp4") as container:
        stream: Any = container.add_stream("libx264", rate=30, options={"preset": "veryfast"})
        stream.width, stream.height = size_wh
        stream.pix_fmt = "yuv420p"
        for frame in islice(source, count):
            image = np.asarray(cv2.resize(frame.image, size_wh), np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, "bgr24")))
        container.mux(stream.encode(None))
    return file


def decoded(file: io.BytesIO) -> Iterator[tuple[float, av.VideoFrame]]:
    """Each frame, and the milliseconds that it took to decode."""
    file.seek(0)
    with av.open(file, "r") as container:
        container.streams.video[0].thread_type = "NONE"
        frames = container.decode(video=0)
        while True:
            start = time.perf_counter()
            frame = next(frames, None)
            if frame is None:
                return
            yield 1e3 * (time.perf_counter() - start), frame


def luma_plane(frame: av.VideoFrame) -> Image:
    """The first plane (H, W) uint8 of a yuv420p frame, without a copy."""
    plane = frame.planes[0]
    rows = np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)  # type: ignore[call-overload]
    return np.asarray(rows[:, : plane.width])


def measure(size_wh: tuple[int, int], count: int, rounds: int) -> dict[str, list[float]]:
    """Milliseconds of each step in each frame, and distances of corners."""
    file, found = encoded(size_wh, count), defaultdict[str, list[float]](list)
    corners = corners_from_xywh((0.0, 0.0, *map(float, size_wh)))

    def timed(name: str, action: Any, *arguments: Any) -> Any:
        start = time.perf_counter()
        result = action(*arguments)
        found[name].append(1e3 * (time.perf_counter() - start))
        return result

    for _ in range(rounds):
        colored, gray = CameraMotion(), CameraMotion()
        for milliseconds, frame in decoded(file):
            found["decode"].append(milliseconds)
            image = timed("to BGR", lambda each: each.to_ndarray(format="bgr24"), frame)
            plane = timed("luma plane", luma_plane, frame)
            motions = (
                timed("motion, BGR", colored.update, image),
                timed("motion, luma", gray.update, plane),
            )
            moved = [map_points(motion.cur_from_prev, corners) for motion in motions]
            found["corners"].append(float(np.linalg.norm(moved[0] - moved[1], axis=1).mean()))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sizes", default="640x360,1280x720,3840x2160")
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--rounds", type=int, default=5)
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    steps = ("decode", "to BGR", "luma plane", "motion, BGR", "motion, luma")
    print(head(["size", *steps, "saved", "corners"]))
    for size in chosen.sizes.split(","):
        width, height = map(int, size.split("x"))
        found = measure((width, height), chosen.frames, chosen.rounds)
        medians = {name: float(np.median(values)) for name, values in found.items()}
        saved = medians["to BGR"] - medians["luma plane"]
        saved += medians["motion, BGR"] - medians["motion, luma"]
        corners = f"{medians['corners']:.3f} ({max(found['corners']):.2f})"
        cells = [f"{medians[step]:.2f}" for step in steps]
        print(line([size, *cells, f"{saved:.2f}", corners]), flush=True)


if __name__ == "__main__":
    main()
