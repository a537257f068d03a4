"""Memory of the `ssiam track` process over a long 1280x720 video.

    python benchmarks/speed/memory.py [--frames 5000] [--clip VIDEO] [--tracker nanotrack_v3]

Loops a clip into a 1280x720 video, tracks it with all outputs, and samples the resident memory of
the process and the number of frames in its result file.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from fractions import Fraction
from itertools import cycle, islice
from pathlib import Path

import cv2
import numpy as np
import psutil

from ssiam.video import VideoSink, open_source

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import VIDEOS, nanotrack_weights

SIZE = (1280, 720)
GOAL_MB = 450
SETTLED = 500  # frame after which memory has to be constant


def write_loop(clip: str, path: Path, count: int) -> None:
    """Write `count` frames of the clip, forward and backward so that there is no cut."""
    with open_source(clip) as frames:
        images = [
            np.asarray(cv2.resize(frame.image, SIZE), np.uint8) for frame in islice(frames, 60)
        ]
    with VideoSink(path, Fraction(30)) as sink:
        for image in islice(cycle(images + images[-2:0:-1]), count):
            sink.write(image)


def samples(process: psutil.Popen, results: Path) -> list[tuple[int, float]]:
    """Frame and resident MB, sampled until the process ends."""
    found = []
    while process.poll() is None:
        lines = results.read_bytes().count(b"\n") if results.exists() else 0
        found.append((lines, process.memory_info().rss / 2**20))
        time.sleep(0.25)
    return found


def main() -> None:
    """Print samples, peak and range."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=5000)
    parser.add_argument("--clip", default=str(VIDEOS / "shaky-5.avi"))
    parser.add_argument("--tracker", default="nanotrack_v3")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_loop(arguments.clip, folder / "long.mp4", arguments.frames)
        command = [sys.executable, "-m", "ssiam", "track", str(folder / "long.mp4")]
        command += ["--box", "580,190,350,330", "--tracker", arguments.tracker]
        command += ["--results", str(folder / "r.csv"), "--out", str(folder / "o.mp4")]
        if arguments.tracker.startswith("nano"):
            command += ["--weights", str(nanotrack_weights(arguments.tracker))]
        process = psutil.Popen(command, stdout=subprocess.DEVNULL)
        frames, memory = np.array(samples(process, folder / "r.csv")).T
    if process.returncode != 0:
        raise SystemExit(f"ssiam track ended with exit code {process.returncode}")
    settled = memory[(frames >= SETTLED) & (frames < arguments.frames)]
    for frame in range(0, arguments.frames, max(arguments.frames // 10, 1)):
        print(f"frame {frame:6d}: {memory[np.searchsorted(frames, frame)]:7.1f} MB")
    middle = (settled.max() + settled.min()) / 2
    print(f"peak {memory.max():.1f} MB (goal {GOAL_MB})")
    print(
        f"from frame {SETTLED}: {settled.min():.1f} to {settled.max():.1f} MB, "
        f"+-{100 * (settled.max() - middle) / middle:.1f} % (goal 3)"
    )


if __name__ == "__main__":
    main()
